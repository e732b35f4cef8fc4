//! Wavefront OBJ.
//!
//! Polygons, `v`, `v/vt`, `v//vn` and `v/vt/vn` corners, negative indices, line continuation, and vertex colours after the coordinates (`v x y z r g b`).
//! Groups, objects, materials, texture coordinates, normals, lines, points and free-form surfaces are stepped over.

use super::text::{count_lines, integer, line_chunks, lines, number, words};
use super::{Soup, colour};
use crate::error::{Fault, ParseError, Place};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, ParseError> {
    let chunks = statement_chunks(super::detect::without_bom(bytes));
    let counts: Vec<(u64, usize)> = chunks
        .par_iter()
        .map(|chunk| {
            let is_vertex = |line: &[u8]| words(line).next() == Some(b"v");
            let vertices = statements(chunk).filter(|(_, line)| is_vertex(line));
            (count_lines(chunk) as u64, vertices.count())
        })
        .collect();
    // Lines and vertices before each piece.
    let mut before = (0, 0);
    let starts: Vec<(u64, usize)> = counts
        .iter()
        .map(|&(lines, vertices)| {
            let start = before;
            before = (before.0 + lines, before.1 + vertices);
            start
        })
        .collect();
    let parts: Vec<Result<Soup, ParseError>> = chunks
        .par_iter()
        .zip(starts)
        .map(|(chunk, (lines, vertices))| parse_chunk(chunk, lines, vertices))
        .collect();
    let mut soup = Soup::default();
    soup.positions.reserve_exact(before.1);
    for part in parts {
        let part = part?;
        if !part.colours.is_empty() {
            soup.colours.resize(soup.positions.len(), [255; 3]);
            soup.colours.extend(part.colours);
        }
        soup.positions.extend(part.positions);
        soup.faces.append(part.faces);
    }
    Ok(soup)
}

/// Pieces of whole lines, continued ones included.
fn statement_chunks(text: &[u8]) -> Vec<&[u8]> {
    let mut chunks = Vec::new();
    let (mut from, mut to) = (0, 0);
    for chunk in line_chunks(text) {
        to += chunk.len();
        let last = chunk.strip_suffix(b"\n").unwrap_or(chunk);
        let last = last.rsplit(|&b| b == b'\n').next().unwrap_or_default();
        if !last.trim_ascii().ends_with(b"\\") {
            chunks.push(&text[from..to]);
            from = to;
        }
    }
    if from < to {
        chunks.push(&text[from..]);
    }
    chunks
}

/// Statements without their comments, each with the number of its first line, counted from 1.
fn statements(text: &[u8]) -> impl Iterator<Item = (u64, Cow<'_, [u8]>)> {
    let mut lines = lines(text);
    std::iter::from_fn(move || {
        let (number, line) = lines.next()?;
        let mut line = Cow::Borrowed(line.trim_ascii());
        if line.ends_with(b"\\") {
            let mut joined = line.into_owned();
            while joined.last() == Some(&b'\\') {
                joined.pop();
                joined.push(b' ');
                if let Some((_, next)) = lines.next() {
                    joined.extend_from_slice(next.trim_ascii());
                }
            }
            line = Cow::Owned(joined);
        }
        if let Some(end) = line.iter().position(|&b| b == b'#') {
            line = match line {
                Cow::Borrowed(line) => Cow::Borrowed(&line[..end]),
                Cow::Owned(mut line) => {
                    line.truncate(end);
                    Cow::Owned(line)
                }
            };
        }
        Some((number, line))
    })
}

/// Reads a piece that comes after so many lines and vertices.
fn parse_chunk(
    chunk: &[u8],
    lines_before: u64,
    vertices_before: usize,
) -> Result<Soup, ParseError> {
    let mut soup = Soup::default();
    let mut face = Vec::new();
    for (number, line) in statements(chunk) {
        let place = Place::Line(lines_before + number);
        let mut rest = words(&line);
        match rest.next() {
            Some(b"v") => parse_vertex(rest, place, &mut soup)?,
            Some(b"f" | b"fo") => {
                face.clear();
                let vertices = vertices_before + soup.positions.len();
                for word in rest {
                    face.push(parse_corner(word, place, vertices)?);
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
    use std::fmt::Write;

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
    fn pieces_join_without_a_seam() {
        let n = 40_000_u32;
        let mut text = String::from("# many\n");
        for i in 0..n {
            // Colours begin late, and every hundredth vertex has none.
            let colour = if i > n / 2 && i % 100 != 0 {
                " 0 0 1"
            } else {
                ""
            };
            writeln!(text, "v {i} \\\n 0.5 -{i}{colour}").unwrap();
            if i > 2 {
                if i % 2 == 0 {
                    writeln!(text, "f {} {} {}", i - 1, i, i + 1).unwrap();
                } else {
                    text += "f -3 -2 -1\n";
                }
            }
        }
        assert!(statement_chunks(text.as_bytes()).len() > 2);
        let soup = parse(text.as_bytes()).unwrap();
        assert!(
            (0..n)
                .zip(&soup.positions)
                .all(|(i, p)| { *p == DVec3::new(f64::from(i), 0.5, -f64::from(i)) })
        );
        let blue = |i: u32| i > n / 2 && !i.is_multiple_of(100);
        assert_eq!(soup.colours.len(), n as usize);
        assert!(
            (0..n)
                .zip(&soup.colours)
                .all(|(i, c)| { *c == if blue(i) { [0, 0, 255] } else { [255; 3] } })
        );
        let expected: Vec<[u32; 3]> = (3..n).map(|i| [i - 2, i - 1, i]).collect();
        assert_eq!(soup.faces.triangulate(&soup.positions).unwrap().0, expected);
        text += "f 1 2 x\n";
        let place = parse(text.as_bytes()).unwrap_err().place;
        assert_eq!(place, Place::Line(u64::from(1 + 2 * n + (n - 3) + 1)));
    }

    #[test]
    fn a_continued_line_may_end_the_file_or_a_piece() {
        for text in ["v 0 0 0\nf 1 1 \\", "f 1 \\\n1 \\\n1\\\n\n"] {
            assert!(parse(text.as_bytes()).is_ok(), "{text}");
        }
        let mut text = "# \\\n".repeat(1 << 18);
        text += "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        // All one comment, continued.
        assert_eq!(parse(text.as_bytes()).unwrap().positions.len(), 2);
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
