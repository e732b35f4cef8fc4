//! STL, stereolithography (3D Systems, 1987).
//!
//! ASCII with any number of solids, and binary, also where its comment begins with "solid". Normals, attribute bytes and
//! the names of solids are not read. Limit: ASCII facets with more than three vertices are polygons to us.

use super::Soup;
use super::text::{Words, count_lines, line_chunks, quoted, words};
use crate::error::{ParseError, Place};
use glam::DVec3;
use rayon::prelude::*;

/// Comment and number of triangles.
const HEADER: usize = 84;
/// Normal, three corners, attribute bytes.
const RECORD: usize = 50;

/// Whether the length is exactly what a binary file's count asks for, which no text meets by chance.
pub(super) fn has_binary_length(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|n| n > 0 && n * RECORD as u64 + HEADER as u64 == bytes.len() as u64)
}

fn count(bytes: &[u8]) -> Option<u64> {
    let field = bytes.get(HEADER - 4..)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*field)))
}

/// Triangles that the beginning of a binary file of `length` bytes announces, if they are all that it holds.
pub(super) fn announced_faces(head: &[u8], length: u64) -> Option<u64> {
    count(head).filter(|&n| n > 0 && n * RECORD as u64 + HEADER as u64 == length)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, ParseError> {
    if !has_binary_length(bytes) && is_text(bytes) {
        return parse_ascii(super::detect::without_bom(bytes));
    }
    parse_binary(bytes)
}

/// "solid" first, and no control characters in what follows, as a binary count or coordinate would have.
fn is_text(bytes: &[u8]) -> bool {
    let text = super::detect::without_bom(bytes).trim_ascii_start();
    text.get(..5)
        .is_some_and(|h| h.eq_ignore_ascii_case(b"solid"))
        && bytes[..bytes.len().min(1024)]
            .iter()
            .all(|&b| b >= 0x20 || b.is_ascii_whitespace())
}

fn parse_binary(bytes: &[u8]) -> Result<Soup, ParseError> {
    let Some(announced) = count(bytes) else {
        return Err(ParseError::truncated(
            Place::Byte(bytes.len() as u64),
            format!("a binary STL file begins with {HEADER} bytes"),
        ));
    };
    let records = bytes[HEADER..].chunks_exact(RECORD);
    if (records.len() as u64) < announced {
        return Err(ParseError::truncated(
            Place::Byte(bytes.len() as u64),
            format!(
                "{announced} triangles are announced, {} are there",
                records.len()
            ),
        ));
    }
    // Bounded: the file holds as many records.
    let announced = usize::try_from(announced).unwrap_or(usize::MAX);
    let end = Place::Byte((HEADER + announced * RECORD) as u64);
    super::vertex_id(3 * announced, end)?;
    let corners: Vec<[DVec3; 3]> = bytes[HEADER..HEADER + announced * RECORD]
        .par_chunks_exact(RECORD)
        .map(|record| {
            let number = |i: usize| {
                let bytes = record.get(12 + 4 * i..16 + 4 * i);
                let bytes = bytes.and_then(|b| b.first_chunk().copied());
                bytes.map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)))
            };
            [0, 3, 6].map(|i| DVec3::new(number(i), number(i + 1), number(i + 2)))
        })
        .collect();
    let mut soup = Soup {
        positions: corners.into_flattened(),
        ..Soup::default()
    };
    let triangles = (0..soup.positions.len())
        .step_by(3)
        .map(|first| {
            let first = super::vertex_id(first, end)?;
            Ok([first, first + 1, first + 2])
        })
        .collect::<Result<_, ParseError>>()?;
    soup.faces.extend_checked(triangles);
    Ok(soup)
}

fn parse_ascii(text: &[u8]) -> Result<Soup, ParseError> {
    let chunks = facet_chunks(text);
    let mut line = 1;
    let starts: Vec<u64> = chunks
        .par_iter()
        .map(|chunk| count_lines(chunk) as u64)
        .collect::<Vec<_>>()
        .into_iter()
        .map(|lines| {
            line += lines;
            line - lines
        })
        .collect();
    let parts: Vec<Result<Part, ParseError>> = chunks
        .par_iter()
        .zip(starts)
        .map(|(chunk, line)| parse_chunk(chunk, line))
        .collect();
    let mut soup = Soup::default();
    let mut open_solid = false;
    let mut end = (Place::Line(1), false);
    for part in parts {
        let part = part?;
        let first = super::vertex_id(soup.positions.len(), part.end)?;
        super::vertex_id(soup.positions.len() + part.soup.positions.len(), part.end)?;
        soup.positions.extend(part.soup.positions);
        soup.faces.append(part.soup.faces.shifted(first));
        open_solid = part.open_solid.unwrap_or(open_solid);
        end = (part.end, part.open_facet);
    }
    if open_solid || end.1 {
        return Err(ParseError::truncated(end.0, "\"endsolid\" is missing"));
    }
    Ok(soup)
}

/// Pieces of which all but the first begin with a facet.
fn facet_chunks(text: &[u8]) -> Vec<&[u8]> {
    /// Lines in which a facet begins, in any file with one keyword a line.
    const LINES: usize = 64;
    let is_facet = |line: &[u8]| {
        let word = words(line).next().unwrap_or_default();
        word.eq_ignore_ascii_case(b"facet")
    };
    let mut chunks = Vec::new();
    let (mut from, mut to) = (0, 0);
    for chunk in line_chunks(text) {
        let mut start = 0;
        for line in chunk.split_inclusive(|&b| b == b'\n').take(LINES) {
            if to > 0 && is_facet(line) {
                chunks.push(&text[from..to + start]);
                from = to + start;
                break;
            }
            start += line.len();
        }
        to += chunk.len();
    }
    chunks.push(&text[from..]);
    chunks
}

/// What a piece of the text holds.
struct Part {
    soup: Soup,
    /// Whether a solid is open at its end, if it says so.
    open_solid: Option<bool>,
    open_facet: bool,
    end: Place,
}

fn parse_chunk(text: &[u8], line: u64) -> Result<Part, ParseError> {
    let mut soup = Soup::default();
    let mut words = Words::new(text, line);
    let mut face: Vec<u32> = Vec::new();
    let mut open_solid = None;
    while let Some(word) = words.next() {
        let place = words.place();
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                // The rest of the line is a name, which may be any text.
                words.skip_line();
                open_solid = Some(true);
            }
            b"endsolid" => {
                words.skip_line();
                open_solid = Some(false);
            }
            b"facet" => face.clear(),
            b"normal" => {
                // Some writers put nonsense here; it is not used.
                for _ in 0..3 {
                    words.next();
                }
            }
            b"outer" | b"loop" | b"endfacet" => {}
            b"vertex" => {
                let (x, y, z) = (words.number("x")?, words.number("y")?, words.number("z")?);
                face.push(super::vertex_id(soup.positions.len(), place)?);
                soup.positions.push(DVec3::new(x, y, z));
            }
            b"endloop" => {
                if face.len() < 3 {
                    let cause = format!("a facet has {} vertices instead of 3", face.len());
                    return Err(ParseError::syntax(place, cause));
                }
                soup.faces.push(&face, place);
                face.clear();
            }
            _ => {
                return Err(ParseError::syntax(
                    place,
                    format!("{} is no STL keyword", quoted(word)),
                ));
            }
        }
    }
    Ok(Part {
        soup,
        open_solid,
        open_facet: !face.is_empty(),
        end: words.place(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    fn binary(comment: &[u8], corners: &[[f32; 9]]) -> Vec<u8> {
        let mut file = vec![b' '; 80];
        file[..comment.len()].copy_from_slice(comment);
        file.extend(u32::try_from(corners.len()).unwrap().to_le_bytes());
        for c in corners {
            file.extend([0; 12]);
            file.extend(c.iter().flat_map(|x| x.to_le_bytes()));
            file.extend([0; 2]);
        }
        file
    }

    const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5];

    #[test]
    fn binary_that_begins_with_solid_is_binary() {
        let file = binary(b"solid made by a careless writer", &[CORNERS, CORNERS]);
        let soup = parse(&file).unwrap();
        assert_eq!(soup.positions.len(), 6);
        assert_eq!(soup.positions[2], DVec3::new(0.0, 1.0, 0.5));
    }

    #[test]
    fn bytes_after_the_last_binary_record_are_ignored() {
        let mut file = binary(b"", &[CORNERS]);
        file.extend([7; 11]);
        assert_eq!(parse(&file).unwrap().faces.len(), 1);
    }

    #[test]
    fn cut_binary_names_both_counts() {
        let file = binary(b"", &[CORNERS, CORNERS]);
        let error = parse(&file[..file.len() - 3]).unwrap_err();
        assert!(
            error
                .fault
                .to_string()
                .contains("2 triangles are announced, 1 are there"),
            "{}",
            error.fault
        );
    }

    #[test]
    fn solids_of_a_text_are_read_together() {
        let one = "solid vertex facet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1E-014 0\n\
                   endloop\nendfacet\nendsolid vertex facet\n";
        let soup = parse(format!("{one}solid\nendsolid\n{one}").as_bytes()).unwrap();
        assert_eq!((soup.positions.len(), soup.faces.len()), (6, 2));
    }

    #[test]
    fn pieces_join_without_a_seam() {
        let n = 20_000_u32;
        let mut text = String::from("solid many\n");
        for i in 0..n {
            write!(text, "facet normal 0 0 1\n outer loop\n  vertex {i} 0 0\n  vertex {i} 1 0\n  vertex {i} 0 1\n").unwrap();
            if i % 50 == 0 {
                writeln!(text, "vertex {i} 0 -1").unwrap();
            }
            text += " endloop\n\nendfacet\n";
            if i % 60 == 0 {
                text += "endsolid many\n\nsolid again\n";
            }
        }
        assert!(facet_chunks(text.as_bytes()).len() > 2);
        assert!(parse(text.as_bytes()).is_err());
        text += "endsolid";
        let soup = parse(text.as_bytes()).unwrap();
        let (triangles, _) = soup.faces.triangulate(&soup.positions).unwrap();
        assert_eq!(triangles.len(), (n + n.div_ceil(50)) as usize);
        for t in &triangles {
            let x = t.map(|v| soup.positions[v as usize].x.to_bits());
            assert!(x[0] == x[1] && x[1] == x[2] && t[0] != t[1]);
        }
        let wrong = text.replace("vertex 19999 1 0", "vertex 19999 one 0");
        let lines = text.lines().count() as u64;
        // After it: a vertex, the ends of the loop and the facet with an empty line, and the end of the solid.
        let expected = Place::Line(lines - 5);
        assert_eq!(parse(wrong.as_bytes()).unwrap_err().place, expected);
    }

    #[test]
    fn text_cut_anywhere_is_refused() {
        let text =
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                     endloop\nendfacet\nendsolid a";
        assert!(parse(text).is_ok());
        for end in 5..text.len() - b"endsolid a".len() {
            assert!(parse(&text[..end]).is_err(), "{end}");
        }
    }
}
