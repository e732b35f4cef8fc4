//! Wavefront OBJ.
//!
//! Polygons, `v`, `v/vt`, `v//vn` and `v/vt/vn` corners, negative indices, line continuation, and vertex colours after the coordinates (`v x y z r g b`).
//! Groups, objects, materials, texture coordinates, normals, lines, points and free-form surfaces are stepped over.

use super::text::{integer, lines, number, words};
use super::{Soup, colour};
use crate::error::{Fault, ParseError, Place};
use glam::DVec3;
use std::borrow::Cow;

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, ParseError> {
    let mut soup = Soup::default();
    let mut face = Vec::new();
    let mut lines = lines(super::detect::without_bom(bytes));
    while let Some((line_number, line)) = lines.next() {
        let mut line = Cow::Borrowed(line.trim_ascii());
        while let Some(start) = line.strip_suffix(b"\\") {
            let mut joined = start.to_vec();
            joined.push(b' ');
            let Some((_, next)) = lines.next() else {
                line = Cow::Owned(joined);
                break;
            };
            joined.extend_from_slice(next.trim_ascii());
            line = Cow::Owned(joined);
        }
        let place = Place::Line(line_number);
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        let mut rest = words(line);
        match rest.next() {
            Some(b"v") => parse_vertex(rest, place, &mut soup)?,
            Some(b"f" | b"fo") => {
                face.clear();
                for word in rest {
                    face.push(parse_corner(word, place, soup.positions.len())?);
                }
                soup.faces.push(&face, place);
            }
            _ => {}
        }
    }
    Ok(soup)
}

fn parse_vertex<'a>(
    rest: impl Iterator<Item = &'a [u8]>,
    place: Place,
    soup: &mut Soup,
) -> Result<(), ParseError> {
    let mut values = [0.0; 7];
    let mut n = 0;
    for word in rest.take(values.len()) {
        values[n] = number(word, place, "a vertex coordinate")?;
        n += 1;
    }
    if n < 3 {
        return Err(ParseError::syntax(
            place,
            format!("a vertex has {n} of 3 coordinates"),
        ));
    }
    soup.positions
        .push(DVec3::new(values[0], values[1], values[2]));
    // Four values are a weight for curves; six or seven are a colour, the seventh its opacity.
    if n >= 6 {
        soup.colours.resize(soup.positions.len() - 1, [255; 3]);
        soup.colours
            .push(colour::bytes_from_either([values[3], values[4], values[5]]));
    }
    Ok(())
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 0. Positive indices may
/// point ahead; they are checked when all vertices are known.
fn parse_corner(word: &[u8], place: Place, vertices: usize) -> Result<u32, ParseError> {
    let first = word.split(|&b| b == b'/').next().unwrap_or_default();
    let index = integer(first, place, "index of a vertex")?;
    let from_zero = match index {
        0 => {
            return Err(ParseError::syntax(
                place,
                "vertices are counted from 1, a face refers to vertex 0",
            ));
        }
        1.. => index - 1,
        _ => index.saturating_add(i64::try_from(vertices).unwrap_or(i64::MAX)),
    };
    u32::try_from(from_zero)
        .ok()
        .filter(|&i| i != u32::MAX)
        .ok_or_else(|| {
            let fault = Fault::IndexOutOfRange {
                index: from_zero,
                vertices: vertices as u64,
            };
            ParseError::at(place, fault)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(text: &str) -> Result<Vec<[u32; 3]>, ParseError> {
        let soup = parse(text.as_bytes())?;
        Ok(soup.faces.triangulate(&soup.positions)?.0)
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn all_forms_of_a_face_give_the_same() {
        for face in [
            "f 1 2 3 4",
            "f 1/7 2/8 3/9 4/1",
            "f 1//7 2//8 3//9 4//1",
            "f 1/2/3 2/3/4 3/4/5 4/5/6",
            "f -4 -3 -2 -1",
            "f 1 2 \\\n3 4",
            "g a b\nusemtl x\r\nf 1 2 3 4 # four",
        ] {
            let t = triangles(&format!("{SQUARE}{face}\n")).unwrap();
            assert_eq!(t, [[0, 1, 2], [0, 2, 3]], "{face}");
        }
    }

    #[test]
    fn faces_may_come_before_their_vertices() {
        assert_eq!(
            triangles(&format!("f 1 2 3\n{SQUARE}")).unwrap(),
            [[0, 1, 2]]
        );
    }

    #[test]
    fn vertices_without_colour_are_white() {
        let soup = parse(b"v 0 0 0\nv 1 0 0 1 0 0\nv 1 1 0 0 0.5 1\nf 1 2 3").unwrap();
        assert_eq!(soup.colours, [[255; 3], [255, 0, 0], [0, 128, 255]]);
        assert!(parse(b"v 0 0 0 1\nv 1 0 0 1").unwrap().colours.is_empty());
    }

    #[test]
    fn faults_name_their_line() {
        for (text, line) in [
            ("v 0 0\n", 1),
            ("v 0 0 0\nf 1 0 1\n", 2),
            ("v 0 0 0\nf -2 1 1\n", 2),
            ("v 0 0 0\n\nf 1 1 5\n", 3),
            ("v 0 0 0\nf 1 1 99999999999999999999\n", 2),
            ("v 0 1,5 0\n", 1),
        ] {
            assert_eq!(
                triangles(text).unwrap_err().place,
                Place::Line(line),
                "{text}"
            );
        }
    }
}
