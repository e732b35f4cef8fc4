//! PLY, the Polygon File Format (Turk, "The PLY Polygon File Format", 1994).
//!
//! ASCII and binary of both byte orders; properties of any type in any order; faces as lists of any length, and
//! `tristrips` lists with −1 between strips; colours of vertices and of faces (`red`, `green`, `blue`, also with the prefix `diffuse_`).
//! Other elements and properties are stepped over.
//!
//! Records of one shape are read in parallel ([`bulk`]), others one by one.
//!
//! Limit: ASCII bodies are read word by word, so line breaks in them carry no meaning.

mod body;
mod bulk;
mod header;

use super::{Soup, colour};
use crate::error::{Fault, ParseError, Place};
use body::{Ascii, Binary, Body};
use bulk::Bulk;
use glam::DVec3;
use header::{Element, Encoding, Header, Property, Scalar};

/// Records from which on reading in parallel pays.
const BULK: u64 = 512;
/// Names of the properties that are a colour.
const COLOUR: [&str; 3] = ["red", "green", "blue"];

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, ParseError> {
    parse_from(bytes, BULK)
}

/// Faces that the header at the beginning of `head` announces.
pub(super) fn announced_faces(head: &[u8]) -> Option<u64> {
    let header = Header::parse(head).ok()?;
    let faces = header.elements.iter().find(|e| e.name == "face")?;
    Some(faces.count)
}

/// Reads elements of at least `bulk` records in parallel.
fn parse_from(bytes: &[u8], bulk: u64) -> Result<Soup, ParseError> {
    let header = Header::parse(bytes)?;
    let start = header.body.min(bytes.len());
    match header.encoding {
        Encoding::Ascii => {
            let mut body = Ascii::new(&bytes[start..], header.body_line);
            let soup = read(&header, &mut body, bulk)?;
            body.expect_end()?;
            Ok(soup)
        }
        Encoding::LittleEndian => read(&header, &mut Binary::<false>::new(bytes, start), bulk),
        Encoding::BigEndian => read(&header, &mut Binary::<true>::new(bytes, start), bulk),
    }
}

fn read(header: &Header, body: &mut impl Bulk, bulk: u64) -> Result<Soup, ParseError> {
    let mut soup = Soup::default();
    for element in &header.elements {
        bound(element, body)?;
        let at_once = element.count >= bulk;
        match element.name.as_str() {
            "vertex" => read_vertices(element, body, &mut soup, at_once)?,
            "face" if at_once && read_triangles(element, body, &mut soup).is_some() => {}
            "face" => read_faces(element, body, &mut soup)?,
            "tristrips" => read_strips(element, body, &mut soup)?,
            _ => skip(element, body)?,
        }
    }
    Ok(soup)
}

/// Refuses a count that the rest of the file cannot hold, before anything is allocated for it.
fn bound(element: &Element, body: &impl Body) -> Result<(), ParseError> {
    let least = element
        .properties
        .iter()
        .map(|p| body.least_bytes(p))
        .sum::<u64>();
    let needed = element.count.saturating_mul(least);
    // The last word of a text needs no separator after it.
    if needed <= body.remaining() + 1 {
        return Ok(());
    }
    Err(ParseError::truncated(
        body.place(),
        format!(
            "element {} announces {} records of at least {least} bytes, but {} bytes follow",
            element.name,
            element.count,
            body.remaining()
        ),
    ))
}

/// Number of records; elements without properties have no bytes, whatever count they claim.
fn records(element: &Element) -> u64 {
    if element.properties.is_empty() {
        0
    } else {
        element.count
    }
}

fn read_vertices(
    element: &Element,
    body: &mut impl Bulk,
    soup: &mut Soup,
    at_once: bool,
) -> Result<(), ParseError> {
    let bad = |cause: &str| {
        ParseError::at(
            Place::File,
            Fault::Header {
                format: "PLY",
                cause: cause.to_owned(),
            },
        )
    };
    let Some([x, y, z]) = scalars(element, ["x", "y", "z"]) else {
        return Err(bad("element vertex has no properties x, y and z"));
    };
    let rgb = scalars(element, COLOUR);
    if !soup.positions.is_empty() {
        return Err(bad("element vertex occurs twice"));
    }
    let count = usize::try_from(records(element)).unwrap_or(usize::MAX);
    if at_once && let Some((columns, starts)) = bulk::shape(element, body) {
        let position =
            |values: &[f64]| DVec3::new(values[starts[x]], values[starts[y]], values[starts[z]]);
        let done = if let Some(rgb) = rgb {
            let scalar = element.properties[rgb[0]].scalar;
            let rows = body.rows(count, &columns, |values| {
                let colour = read_colour(rgb.map(|i| values[starts[i]]), scalar);
                Some((position(values), colour))
            });
            rows.map(|rows| (soup.positions, soup.colours) = rows.into_iter().unzip())
        } else {
            let rows = body.rows(count, &columns, |values| Some(position(values)));
            rows.map(|rows| soup.positions = rows)
        };
        if done.is_some() {
            return Ok(());
        }
    }
    soup.positions.reserve_exact(count);
    soup.colours
        .reserve_exact(if rgb.is_some() { count } else { 0 });
    let mut values = vec![0.0; element.properties.len()];
    for _ in 0..count {
        for (value, property) in values.iter_mut().zip(&element.properties) {
            *value = match property.list {
                None => body.scalar(property.scalar)?,
                Some(length) => {
                    skip_list(property, length, body)?;
                    0.0
                }
            };
        }
        soup.positions
            .push(DVec3::new(values[x], values[y], values[z]));
        if let Some(rgb) = rgb {
            soup.colours.push(read_colour(
                rgb.map(|i| values[i]),
                element.properties[rgb[0]].scalar,
            ));
        }
    }
    Ok(())
}

/// The properties of these names that are no lists, if all are there.
fn scalars(element: &Element, names: [&str; 3]) -> Option<[usize; 3]> {
    let find = |name: &str| {
        element.properties.iter().position(|p| {
            p.list.is_none() && (p.name == name || p.name.strip_prefix("diffuse_") == Some(name))
        })
    };
    let [first, second, third] = names.map(find);
    Some([first?, second?, third?])
}

fn read_colour(rgb: [f64; 3], scalar: Scalar) -> [u8; 3] {
    match scalar {
        Scalar::F32 | Scalar::F64 => colour::bytes_from_either(rgb),
        Scalar::U16 | Scalar::I16 => rgb.map(|c| colour::byte_from_unit(c / 65535.0)),
        _ => rgb.map(|c| colour::byte_from_unit(c / 255.0)),
    }
}

/// The property that holds a face's corners: the one so named, else the first list.
fn corner_list(element: &Element) -> Result<usize, ParseError> {
    let lists = || {
        element
            .properties
            .iter()
            .enumerate()
            .filter(|(_, p)| p.list.is_some())
    };
    lists()
        .find(|(_, p)| p.name == "vertex_indices" || p.name == "vertex_index")
        .or_else(|| lists().next())
        .map(|(i, _)| i)
        .ok_or_else(|| {
            let cause = format!("element {} has no list of vertex indices", element.name);
            ParseError::at(
                Place::File,
                Fault::Header {
                    format: "PLY",
                    cause,
                },
            )
        })
}

/// Calls `each` with the corners of every record, −1 standing for itself, and with the values of its properties, 0 for lists.
fn for_each_list<B: Body>(
    element: &Element,
    body: &mut B,
    mut each: impl FnMut(&[i64], &[f64], Place) -> Result<(), ParseError>,
) -> Result<(), ParseError> {
    if records(element) == 0 {
        return Ok(());
    }
    let corners = corner_list(element)?;
    let mut list = Vec::new();
    let mut values = vec![0.0; element.properties.len()];
    for _ in 0..element.count {
        let place = body.next_place();
        for (i, property) in element.properties.iter().enumerate() {
            match property.list {
                None => values[i] = body.scalar(property.scalar)?,
                Some(length) if i == corners => {
                    let n = body.list_length(length, property.scalar)?;
                    list.clear();
                    for _ in 0..n {
                        list.push(body.index(property.scalar)?);
                    }
                }
                Some(length) => skip_list(property, length, body)?,
            }
        }
        each(&list, &values, place)?;
    }
    Ok(())
}

fn read_faces(element: &Element, body: &mut impl Body, soup: &mut Soup) -> Result<(), ParseError> {
    soup.faces
        .reserve(usize::try_from(records(element)).unwrap_or(0));
    let mut face = Vec::new();
    let vertices = soup.positions.len();
    let rgb = scalars(element, COLOUR);
    for_each_list(element, body, |list, values, place| {
        face.clear();
        for &index in list {
            face.push(vertex_index(index, vertices, place)?);
        }
        soup.faces.push(&face, place);
        if let Some(rgb) = rgb.filter(|_| face.len() >= 3) {
            let scalar = element.properties[rgb[0]].scalar;
            let colour = read_colour(rgb.map(|i| values[i]), scalar);
            soup.face_colours.push(Some(colour));
        }
        Ok(())
    })
}

/// Reads the faces in parallel if all are triangles of known vertices; else reads nothing.
fn read_triangles(element: &Element, body: &mut impl Bulk, soup: &mut Soup) -> Option<()> {
    let (columns, starts) = bulk::shape(element, body)?;
    let corners = corner_list(element).ok()?;
    let first = starts[corners];
    let length = starts.get(corners + 1).map_or(columns.len(), |&next| {
        next - usize::from(element.properties[corners + 1].list.is_some())
    }) - first;
    if length != 3 {
        return None;
    }
    let vertices = soup.positions.len() as f64;
    let triangle = |values: &[f64]| {
        let mut triangle = [0; 3];
        for (corner, &index) in triangle.iter_mut().zip(&values[first..first + 3]) {
            if !(index >= 0.0 && index < vertices && index.fract() == 0.0) {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked: an integer below the number of vertices; of more than 32 bits can number, `finish` tells"
            )]
            let index = index as u32;
            *corner = index;
        }
        Some(triangle)
    };
    let count = usize::try_from(element.count).ok()?;
    let triangles = if let Some(rgb) = scalars(element, COLOUR) {
        let scalar = element.properties[rgb[0]].scalar;
        let rows = body.rows(count, &columns, |values| {
            let colour = read_colour(rgb.map(|i| values[starts[i]]), scalar);
            Some((triangle(values)?, Some(colour)))
        })?;
        let (triangles, colours): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        soup.face_colours.extend(colours);
        triangles
    } else {
        body.rows(count, &columns, triangle)?
    };
    soup.faces.extend_checked(triangles);
    Some(())
}

fn read_strips(element: &Element, body: &mut impl Body, soup: &mut Soup) -> Result<(), ParseError> {
    let mut strip = Vec::new();
    let vertices = soup.positions.len();
    for_each_list(element, body, |list, _, place| {
        for part in list.split(|&i| i == -1) {
            strip.clear();
            for &index in part {
                strip.push(vertex_index(index, vertices, place)?);
            }
            soup.faces.push_strip(&strip, place);
        }
        Ok(())
    })
}

fn vertex_index(index: i64, vertices: usize, place: Place) -> Result<u32, ParseError> {
    u32::try_from(index)
        .ok()
        .filter(|&i| i != u32::MAX)
        .ok_or_else(|| {
            ParseError::at(
                place,
                Fault::IndexOutOfRange {
                    index,
                    vertices: vertices as u64,
                },
            )
        })
}

fn skip(element: &Element, body: &mut impl Body) -> Result<(), ParseError> {
    for _ in 0..records(element) {
        for property in &element.properties {
            match property.list {
                None => {
                    body.scalar(property.scalar)?;
                }
                Some(length) => skip_list(property, length, body)?,
            }
        }
    }
    Ok(())
}

fn skip_list(property: &Property, length: Scalar, body: &mut impl Body) -> Result<(), ParseError> {
    for _ in 0..body.list_length(length, property.scalar)? {
        body.scalar(property.scalar)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
