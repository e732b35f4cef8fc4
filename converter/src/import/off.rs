//! OFF, the Object File Format of Geomview, ASCII.
//!
//! The variants `ST`, `C` and `N` in any combination; comments; polygons; colours of vertices and of faces. Normals, texture coordinates
//! and numbers of colours in a map are stepped over. Limit: one vertex or face a line, as every writer does; `4OFF`, `nOFF` and the binary form are refused.

use super::text::{count_lines, integer, line_chunks, lines, number, words};
use super::{Soup, colour};
use crate::error::{Fault, ParseError, Place};
use glam::DVec3;
use rayon::prelude::*;

/// What the keyword says of a vertex line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Keyword {
    colour: bool,
    normal: bool,
    other_dimension: bool,
}

/// Parses `[ST][C][N][4][n]OFF`; the rest of the word is returned, for files that forget the line break.
fn keyword(word: &[u8]) -> Option<(Keyword, &[u8])> {
    let take = |rest: &mut &[u8], prefix: &[u8]| match rest.strip_prefix(prefix) {
        Some(tail) => {
            *rest = tail;
            true
        }
        None => false,
    };
    let mut rest = word;
    // Texture coordinates come last on the line, where they do not matter.
    take(&mut rest, b"ST");
    let mut keyword = Keyword {
        colour: take(&mut rest, b"C"),
        normal: take(&mut rest, b"N"),
        other_dimension: false,
    };
    keyword.other_dimension |= take(&mut rest, b"4");
    keyword.other_dimension |= take(&mut rest, b"n");
    let rest = rest.strip_prefix(b"OFF")?;
    rest.iter()
        .all(u8::is_ascii_digit)
        .then_some((keyword, rest))
}

/// Whether the text begins with the keyword, comments aside.
pub(super) fn has_keyword(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 16)];
    content(head).next().is_some_and(|(_, line)| {
        words(line)
            .next()
            .is_some_and(|word| keyword(word).is_some())
    })
}

/// Lines with their comments cut off, without the empty ones.
fn content(text: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    lines(super::detect::without_bom(text))
        .map(|(number, line)| (number, stripped(line)))
        .filter(|(_, line)| !line.is_empty())
}

/// `line` without its comment and the white space around it.
fn stripped(line: &[u8]) -> &[u8] {
    line.split(|&b| b == b'#')
        .next()
        .unwrap_or_default()
        .trim_ascii()
}

/// Faces that the beginning of a file announces.
pub(super) fn announced_faces(head: &[u8]) -> Option<u64> {
    let mut lines = content(head).peekable();
    let (_, _, faces) = parse_header(&mut lines, Place::File).ok()?;
    Some(faces)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, ParseError> {
    let end = Place::Byte(bytes.len() as u64);
    let (kind, vertices, faces, body) = {
        let mut lines = content(bytes).peekable();
        let (kind, vertices, faces) = parse_header(&mut lines, end)?;
        (kind, vertices, faces, lines.peek().copied())
    };

    // A vertex takes 6 bytes and a face 2 at least ("0 0 0\n", "0\n").
    let needed = vertices
        .saturating_mul(6)
        .saturating_add(faces.saturating_mul(2));
    if needed > bytes.len() as u64 + 1 {
        let missing = format!(
            "{vertices} vertices and {faces} faces are announced, more than the file can hold"
        );
        return Err(ParseError::truncated(Place::File, missing));
    }
    let Some((first_line, first)) = body.filter(|_| vertices + faces > 0) else {
        return missing(0, vertices, faces, end).map_or(Ok(Soup::default()), Err);
    };
    // The text from the first line on; `first` is a part of `bytes`.
    let from = first.as_ptr().addr() - bytes.as_ptr().addr();
    let chunks = line_chunks(&bytes[from..]);
    let counts: Vec<(u64, u64)> = chunks
        .par_iter()
        .map(|chunk| {
            let with_content = lines(chunk).filter(|(_, line)| !stripped(line).is_empty());
            (count_lines(chunk) as u64, with_content.count() as u64)
        })
        .collect();
    // Line number and record that each piece begins with.
    let mut before = (first_line, 0);
    let starts: Vec<(u64, u64)> = counts
        .iter()
        .map(|&(lines, records)| {
            let start = before;
            before = (before.0 + lines, before.1 + records);
            start
        })
        .collect();
    let parts: Vec<(Soup, FaceColours)> = chunks
        .par_iter()
        .zip(starts)
        .map(|(chunk, (line, record))| parse_chunk(chunk, line, record, kind, vertices, faces))
        .collect::<Vec<_>>()
        .into_iter()
        .collect::<Result<_, _>>()?;
    if let Some(error) = missing(before.1, vertices, faces, end) {
        return Err(error);
    }
    let mut soup = Soup::default();
    soup.positions
        .reserve_exact(usize::try_from(vertices).unwrap_or(0));
    soup.faces.reserve(usize::try_from(faces).unwrap_or(0));
    let mut face_colours = FaceColours::default();
    for (part, colours) in parts {
        soup.positions.extend(part.positions);
        soup.colours.extend(part.colours);
        face_colours.append(soup.faces.filed(), colours);
        soup.faces.append(part.faces);
    }
    soup.face_colours = face_colours.into_bytes(soup.faces.filed());
    Ok(soup)
}

/// Colours of faces of three and more corners as they stand; none from the last that has one on.
#[derive(Debug, Default)]
struct FaceColours(Vec<Option<[f32; 3]>>);

impl FaceColours {
    /// The colour of the face after `before` others.
    fn push(&mut self, before: usize, colour: Option<[f32; 3]>) {
        if colour.is_some() {
            self.0.resize(before, None);
            self.0.push(colour);
        }
    }

    /// The colours of what comes after `before` faces.
    fn append(&mut self, before: usize, other: Self) {
        if !other.0.is_empty() {
            self.0.resize(before, None);
            self.0.extend(other.0);
        }
    }

    /// Of `faces` faces. Channels end at 255 if any is above 1, else at 1: files do not say which.
    fn into_bytes(mut self, faces: usize) -> Vec<Option<[u8; 3]>> {
        if self.0.is_empty() {
            return Vec::new();
        }
        self.0.resize(faces, None);
        let channels = || self.0.iter().flatten().flatten();
        let most = if channels().any(|&c| c > 1.0) {
            255.0
        } else {
            1.0
        };
        let byte = |c: f32| colour::byte_from_unit(f64::from(c) / most);
        self.0
            .iter()
            .map(|colour| colour.map(|rgb| rgb.map(byte)))
            .collect()
    }
}

/// What `records` lines leave missing.
fn missing(records: u64, vertices: u64, faces: u64, end: Place) -> Option<ParseError> {
    let what = if records < vertices {
        format!("{records} of {vertices} vertices are there")
    } else if records - vertices < faces {
        format!("{} of {faces} faces are there", records - vertices)
    } else {
        return None;
    };
    Some(ParseError::truncated(end, what))
}

/// Reads a piece of the body that begins with line `line` and record `record`: vertices come first, then faces.
fn parse_chunk(
    chunk: &[u8],
    line: u64,
    mut record: u64,
    kind: Keyword,
    vertices: u64,
    faces: u64,
) -> Result<(Soup, FaceColours), ParseError> {
    let (mut soup, mut colours) = (Soup::default(), FaceColours::default());
    let mut face = Vec::new();
    for (number, text) in lines(chunk) {
        let text = stripped(text);
        if text.is_empty() {
            continue;
        }
        let place = Place::Line(line + number - 1);
        if record < vertices {
            parse_vertex(text, place, kind, &mut soup)?;
        } else if record - vertices < faces {
            let colour = parse_face(text, place, vertices, &mut face)?;
            if face.len() >= 3 {
                colours.push(soup.faces.filed(), colour);
            }
            soup.faces.push(&face, place);
        } else {
            break;
        }
        record += 1;
    }
    Ok((soup, colours))
}

fn parse_header<'a>(
    lines: &mut std::iter::Peekable<impl Iterator<Item = (u64, &'a [u8])>>,
    end: Place,
) -> Result<(Keyword, u64, u64), ParseError> {
    let mut kind = Keyword::default();
    let mut counts: Vec<&[u8]> = Vec::new();
    if let Some((line_number, line)) = lines.peek() {
        let mut rest = words(line);
        if let Some((k, tail)) = rest.next().and_then(keyword) {
            kind = k;
            counts.extend(Some(tail).filter(|t| !t.is_empty()));
            counts.extend(rest);
            let binary = counts
                .first()
                .is_some_and(|w| w.eq_ignore_ascii_case(b"BINARY"));
            if kind.other_dimension || binary {
                let what = if binary {
                    "binary OFF"
                } else {
                    "OFF with other than three dimensions"
                };
                return Err(ParseError::at(
                    Place::Line(*line_number),
                    Fault::Unsupported {
                        what: what.to_owned(),
                        advice: "export as ASCII OFF or PLY",
                    },
                ));
            }
            lines.next();
        }
    }
    let mut place = Place::File;
    if counts.is_empty() {
        let (line_number, line) = lines.next().ok_or_else(|| {
            ParseError::truncated(end, "the numbers of vertices and faces are missing")
        })?;
        place = Place::Line(line_number);
        counts.extend(words(line));
    }
    let [vertices, faces, ..] = counts[..] else {
        let cause = "the numbers of vertices, faces and edges are missing".to_owned();
        return Err(ParseError::at(
            place,
            Fault::Header {
                format: "OFF",
                cause,
            },
        ));
    };
    let count = |word, what| {
        let n = integer(word, place, what)?;
        u64::try_from(n)
            .ok()
            .ok_or_else(|| ParseError::syntax(place, format!("the {what} is {n}")))
    };
    Ok((
        kind,
        count(vertices, "number of vertices")?,
        count(faces, "number of faces")?,
    ))
}

fn parse_vertex(
    line: &[u8],
    place: Place,
    kind: Keyword,
    soup: &mut Soup,
) -> Result<(), ParseError> {
    let mut rest = words(line);
    let mut next = |what: &str| match rest.next() {
        Some(word) => number(word, place, what),
        None => Err(ParseError::syntax(place, format!("a vertex has no {what}"))),
    };
    soup.positions
        .push(DVec3::new(next("x")?, next("y")?, next("z")?));
    if kind.normal {
        for what in ["normal x", "normal y", "normal z"] {
            next(what)?;
        }
    }
    if kind.colour {
        let rgb = [next("red")?, next("green")?, next("blue")?];
        soup.colours.push(colour::bytes_from_either(rgb));
    }
    Ok(())
}

/// The corners of a face, and its colour as it stands.
fn parse_face(
    line: &[u8],
    place: Place,
    vertices: u64,
    face: &mut Vec<u32>,
) -> Result<Option<[f32; 3]>, ParseError> {
    face.clear();
    let mut rest = words(line);
    let corners = integer(rest.next().unwrap_or_default(), place, "number of corners")?;
    if corners < 0 {
        return Err(ParseError::syntax(
            place,
            format!("a face has {corners} corners"),
        ));
    }
    for _ in 0..corners {
        let word = rest.next().ok_or_else(|| {
            ParseError::syntax(
                place,
                format!("a face has {} of {corners} corners", face.len()),
            )
        })?;
        let index = integer(word, place, "index of a vertex")?;
        let vertex = u32::try_from(index)
            .ok()
            .filter(|&i| u64::from(i) < vertices)
            .ok_or_else(|| ParseError::at(place, Fault::IndexOutOfRange { index, vertices }))?;
        face.push(vertex);
    }
    // One number more is a place in a map of colours.
    let mut channel = || {
        let value = number(rest.next()?, place, "colour").ok()?;
        #[expect(clippy::cast_possible_truncation, reason = "to be a byte")]
        let value = value as f32;
        Some(value)
    };
    Ok(match [channel(), channel(), channel()] {
        [Some(r), Some(g), Some(b)] => Some([r, g, b]),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    #[test]
    fn variants_put_colours_after_normals() {
        let text = b"# made by hand\nSTCNOFF\n3 1 0 # counts\n0 0 0 0 0 1 255 0 10 255 0 0\n1 0 0 0 0 1 0 255 0 255 0 0\n\
                     0 1 0 0 0 1 1 0 0 1 0 0\n3 0 1 2 255 0 0\n";
        let soup = parse(text).unwrap();
        assert_eq!(soup.colours, [[255, 0, 10], [0, 255, 0], [255, 0, 0]]);
        assert_eq!(soup.faces.len(), 1);
        assert_eq!(soup.face_colours, [Some([255, 0, 0])]);
    }

    #[test]
    fn colours_of_faces_are_bytes_or_parts_of_one_and_may_be_missing() {
        let colours = |faces: [&str; 4]| {
            let text = format!("OFF\n3 4 0\n0 0 0\n1 0 0\n0 1 0\n{}\n", faces.join("\n"));
            parse(text.as_bytes()).unwrap().face_colours
        };
        let face = "3 0 1 2";
        assert!(colours([face; 4]).is_empty());
        assert!(colours(["3 0 1 2 7", face, "3 0 1 2 1 2", "3 0 1 2 a b c"]).is_empty());
        assert_eq!(
            colours([
                face,
                "3 0 1 2 1 0 1 # dark",
                "2 0 1 9 9 9",
                "3 0 1 2 255 9 0 40"
            ]),
            [None, Some([1, 0, 1]), Some([255, 9, 0])]
        );
        assert_eq!(
            colours(["3 0 1 2 1 0 0.5", "3 0 1 2 0.2 1.0 0", "3 0 1 2 4", face]),
            [Some([255, 0, 128]), Some([51, 255, 0]), None, None]
        );
    }

    #[test]
    fn counts_may_stand_beside_the_keyword_and_the_keyword_may_be_missing() {
        let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
        for head in [
            "OFF 4 1 0\n",
            "OFF4 1 0\n",
            "OFF\r\n4 1\r\n",
            "4 1 4\n",
            "COFF\n# x\n\n4 1 0\n",
        ] {
            let text = format!("{head}{body}");
            let result = parse(text.as_bytes());
            assert_eq!(result.is_ok(), !head.starts_with('C'), "{head}");
        }
    }

    #[test]
    fn pieces_join_without_a_seam() {
        let (n, m) = (30_000_u32, 20_000_u32);
        let mut text = format!("OFF\n# {n}\n{n} {m} 0\n");
        for i in 0..n {
            let comment = if i % 7 == 0 { " # seven\n" } else { "" };
            writeln!(text, "{i} 0.5 -{i}{comment}").unwrap();
        }
        for i in 0..m {
            if i % 3 == 0 {
                let colour = if i > m / 2 { " 9 8 7" } else { "" };
                writeln!(text, "4 {i} {} {} {}{colour}", i + 1, i + 2, i + 3).unwrap();
            } else {
                write!(text, "3 {i} {} {}\r\n", i + 1, i + 2).unwrap();
            }
        }
        assert!(line_chunks(text.as_bytes()).len() > 2);
        let soup = parse(text.as_bytes()).unwrap();
        assert_eq!(soup.positions.len(), n as usize);
        assert!(
            (0..n)
                .zip(&soup.positions)
                .all(|(i, p)| { *p == DVec3::new(f64::from(i), 0.5, -f64::from(i)) })
        );
        let coloured = |i: u32| (i.is_multiple_of(3) && i > m / 2).then_some([9, 8, 7]);
        assert_eq!(soup.face_colours, (0..m).map(coloured).collect::<Vec<_>>());
        let (triangles, _) = soup.faces.triangulate(&soup.positions).unwrap();
        let mut expected = Vec::new();
        for i in 0..m {
            expected.push([i, i + 1, i + 2]);
            if i % 3 == 0 {
                expected.push([i, i + 2, i + 3]);
            }
        }
        assert_eq!(triangles, expected);
        let wrong = text.replace("3 19999 ", "3 x ");
        let place = parse(wrong.as_bytes()).unwrap_err().place;
        assert_eq!(place, Place::Line(u64::from(3 + n + n.div_ceil(7) + m)));
    }

    #[test]
    fn faults_name_their_line() {
        let cases: [(&[u8], Place, &str); 5] = [
            (
                b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
                Place::Line(6),
                "refers to vertex 3",
            ),
            (
                b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
                Place::Line(6),
                "2 of 3 corners",
            ),
            (
                b"OFF\n3 1 0\n0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n",
                Place::Line(4),
                "zero",
            ),
            (
                b"OFF\n900000000 1 0\n0 0 0\n",
                Place::File,
                "more than the file can hold",
            ),
            (b"4OFF\n3 1 0\n", Place::Line(1), "three dimensions"),
        ];
        for (text, place, part) in cases {
            let error = parse(text).unwrap_err();
            assert_eq!(error.place, place, "{}", error.fault);
            assert!(error.fault.to_string().contains(part), "{}", error.fault);
        }
    }
}
