//! STL, stereolithography (3D Systems, 1987).
//!
//! ASCII with any number of solids, and binary, also where its comment begins with "solid". Normals, attribute bytes and
//! the names of solids are not read. Limit: ASCII facets with more than three vertices are polygons to us.

use super::Soup;
use super::text::{Words, quoted};
use crate::error::{ParseError, Place};
use glam::DVec3;

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
    let mut soup = Soup::default();
    // Bounded: the file holds as many records.
    let announced = usize::try_from(announced).unwrap_or(usize::MAX);
    soup.positions.reserve_exact(3 * announced);
    soup.faces.reserve(announced);
    for (i, record) in records.take(announced).enumerate() {
        let mut corners = record[12..48]
            .chunks_exact(4)
            .map(|c| f64::from(f32::from_le_bytes([c[0], c[1], c[2], c[3]])));
        let place = Place::Byte((HEADER + i * RECORD) as u64);
        let mut next = || corners.next().unwrap_or(f64::NAN);
        for _ in 0..3 {
            let (x, y, z) = (next(), next(), next());
            soup.positions.push(DVec3::new(x, y, z));
        }
        let first = super::vertex_id(3 * i, place)?;
        soup.faces
            .push_triangle([first, first + 1, first + 2], place);
    }
    Ok(soup)
}

fn parse_ascii(text: &[u8]) -> Result<Soup, ParseError> {
    let mut soup = Soup::default();
    let mut words = Words::new(text, 1);
    let mut face: Vec<u32> = Vec::new();
    let mut open_solid = false;
    while let Some(word) = words.next() {
        let place = words.place();
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                // The rest of the line is a name, which may be any text.
                words.skip_line();
                open_solid = true;
            }
            b"endsolid" => {
                words.skip_line();
                open_solid = false;
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
    if open_solid || !face.is_empty() {
        return Err(ParseError::truncated(
            words.place(),
            "\"endsolid\" is missing",
        ));
    }
    Ok(soup)
}

#[cfg(test)]
mod tests {
    use super::*;

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
