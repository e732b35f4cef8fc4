//! The header of a PLY file.

use crate::error::{Fault, ParseError, Place};
use crate::import::text::{quoted, words};

/// How the body is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    /// Type of the value, or of each item of a list.
    pub(super) scalar: Scalar,
    /// Type of the number of items, for lists.
    pub(super) list: Option<Scalar>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Byte offset of the body.
    pub(super) body: usize,
    /// Line number of the body's first line, counted from 1.
    pub(super) body_line: u64,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        // Old Mac files end lines with `\r` alone.
        let end = if bytes.get(3) == Some(&b'\r') && bytes.get(4) != Some(&b'\n') {
            b'\r'
        } else {
            b'\n'
        };
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut at = 0;
        for number in 1.. {
            let place = Place::Line(number);
            let bad = |cause: String| {
                ParseError::at(
                    place,
                    Fault::Header {
                        format: "PLY",
                        cause,
                    },
                )
            };
            let Some(length) = bytes[at..].iter().position(|&b| b == end) else {
                // A header-only file need not end its last line.
                if bytes[at..].trim_ascii() != b"end_header" {
                    return Err(bad("it has no line end_header".to_owned()));
                }
                return Self::complete(encoding, elements, bytes.len(), number + 1);
            };
            let line = bytes[at..at + length].trim_ascii();
            at += length + 1;
            let mut word = words(line);
            match word.next() {
                Some(b"end_header") => return Self::complete(encoding, elements, at, number + 1),
                Some(b"format") => {
                    encoding = Some(match word.next() {
                        Some(b"ascii") => Encoding::Ascii,
                        Some(b"binary_little_endian") => Encoding::LittleEndian,
                        Some(b"binary_big_endian") => Encoding::BigEndian,
                        other => {
                            return Err(bad(format!(
                                "unknown format {}",
                                quoted(other.unwrap_or_default())
                            )));
                        }
                    });
                }
                Some(b"element") => elements.push(element(word).ok_or_else(|| {
                    bad(format!("{} is not \"element NAME COUNT\"", quoted(line)))
                })?),
                Some(b"property") => {
                    let property = property(word).ok_or_else(|| {
                        bad(format!(
                            "{} is not a property with known types",
                            quoted(line)
                        ))
                    })?;
                    let element = elements
                        .last_mut()
                        .ok_or_else(|| bad("a property comes before any element".to_owned()))?;
                    element.properties.push(property);
                }
                None | Some(b"ply" | b"comment" | b"obj_info") => {}
                Some(other) => return Err(bad(format!("unknown keyword {}", quoted(other)))),
            }
        }
        unreachable!("the header ends with the file at the latest")
    }

    fn complete(
        encoding: Option<Encoding>,
        elements: Vec<Element>,
        body: usize,
        body_line: u64,
    ) -> Result<Self, ParseError> {
        let bad = |cause: &str| {
            ParseError::at(
                Place::File,
                Fault::Header {
                    format: "PLY",
                    cause: cause.to_owned(),
                },
            )
        };
        let encoding = encoding.ok_or_else(|| bad("it has no line format"))?;
        if !elements.iter().any(|e| e.name == "vertex") {
            return Err(bad("it has no element vertex"));
        }
        Ok(Self {
            encoding,
            elements,
            body,
            body_line,
        })
    }
}

fn name(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

fn element<'a>(mut word: impl Iterator<Item = &'a [u8]>) -> Option<Element> {
    let name = name(word.next()?);
    let count = std::str::from_utf8(word.next()?).ok()?.parse().ok()?;
    Some(Element {
        name,
        count,
        properties: Vec::new(),
    })
}

fn property<'a>(mut word: impl Iterator<Item = &'a [u8]>) -> Option<Property> {
    let first = word.next()?;
    if first == b"list" {
        let list = Some(Scalar::parse(word.next()?)?);
        let scalar = Scalar::parse(word.next()?)?;
        return Some(Property {
            name: name(word.next()?),
            scalar,
            list,
        });
    }
    Some(Property {
        scalar: Scalar::parse(first)?,
        name: name(word.next()?),
        list: None,
    })
}
