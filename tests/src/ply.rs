//! PLY as `marquetry export` writes it, read apart from the converter's own importer; and a writer for test input.

use crate::meshes::Model;
use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use std::fmt::Write as _;
use std::path::Path;

/// Writes a binary little-endian PLY file with `f64` coordinates.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, model: &Model) -> Result<()> {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    writeln!(header, "element vertex {}", model.positions.len())?;
    header += "property double x\nproperty double y\nproperty double z\n";
    writeln!(header, "element face {}", model.triangles.len())?;
    header += "property list uchar uint vertex_indices\nend_header\n";
    let mut bytes = header.into_bytes();
    for position in &model.positions {
        bytes.extend(position.to_array().iter().flat_map(|x| x.to_le_bytes()));
    }
    for triangle in &model.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|index| index.to_le_bytes()));
    }
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// Reads a PLY file of triangles, binary little-endian or ASCII; properties other than positions and indices are skipped.
///
/// # Errors
/// When it is anything else, or cut short.
pub fn read(path: &Path) -> Result<Model> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    parse(&bytes).with_context(|| path.display().to_string())
}

fn parse(bytes: &[u8]) -> Result<Model> {
    const END: &[u8] = b"end_header\n";
    let end = bytes
        .windows(END.len())
        .position(|window| window == END)
        .context("no end of the header")?;
    let header = std::str::from_utf8(&bytes[..end])?;
    let mut body = Body {
        rest: &bytes[end + END.len()..],
        ascii: header.contains("format ascii"),
    };
    ensure!(
        body.ascii || header.contains("format binary_little_endian"),
        "neither ASCII nor little-endian"
    );
    let mut elements: Vec<Element> = Vec::new();
    for line in header.lines() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match (words.as_slice(), elements.last_mut()) {
            (["element", name, count], _) => {
                elements.push(Element {
                    name,
                    count: count.parse()?,
                    properties: Vec::new(),
                });
            }
            (["property", "list", count, item, name], Some(element)) => {
                element.properties.push(Property {
                    name,
                    list: Some(count),
                    kind: item,
                });
            }
            (["property", kind, name], Some(element)) => {
                element.properties.push(Property {
                    name,
                    list: None,
                    kind,
                });
            }
            _ => {}
        }
    }
    let mut model = Model::default();
    for element in &elements {
        for _ in 0..element.count {
            body.element(element, &mut model)?;
        }
    }
    Ok(model)
}

struct Element<'a> {
    name: &'a str,
    count: usize,
    properties: Vec<Property<'a>>,
}

struct Property<'a> {
    name: &'a str,
    /// Type of the count of a list.
    list: Option<&'a str>,
    kind: &'a str,
}

struct Body<'a> {
    rest: &'a [u8],
    ascii: bool,
}

impl Body<'_> {
    fn element(&mut self, element: &Element<'_>, model: &mut Model) -> Result<()> {
        let mut position = DVec3::ZERO;
        for property in &element.properties {
            let Some(count_kind) = property.list else {
                let value = self.number(property.kind)?;
                match property.name {
                    "x" => position.x = value,
                    "y" => position.y = value,
                    "z" => position.z = value,
                    _ => {}
                }
                continue;
            };
            let count = self.number(count_kind)?;
            ensure!(
                count.to_bits() == 3.0_f64.to_bits(),
                "a face of {count} corners"
            );
            let mut triangle = [0; 3];
            for corner in &mut triangle {
                let index = self.number(property.kind)?;
                ensure!(
                    index >= 0.0 && index < model.positions.len() as f64,
                    "vertex {index} does not exist"
                );
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "checked above"
                )]
                let index = index as u32;
                *corner = index;
            }
            model.triangles.push(triangle);
        }
        if element.name == "vertex" {
            model.positions.push(position);
        }
        Ok(())
    }

    fn number(&mut self, kind: &str) -> Result<f64> {
        if self.ascii {
            let text = self.rest.trim_ascii_start();
            let end = text
                .iter()
                .position(u8::is_ascii_whitespace)
                .unwrap_or(text.len());
            let (word, rest) = text.split_at(end);
            self.rest = rest;
            return Ok(std::str::from_utf8(word)?.parse()?);
        }
        Ok(match kind {
            "char" | "int8" => f64::from(i8::from_le_bytes(self.take()?)),
            "uchar" | "uint8" => f64::from(u8::from_le_bytes(self.take()?)),
            "short" | "int16" => f64::from(i16::from_le_bytes(self.take()?)),
            "ushort" | "uint16" => f64::from(u16::from_le_bytes(self.take()?)),
            "int" | "int32" => f64::from(i32::from_le_bytes(self.take()?)),
            "uint" | "uint32" => f64::from(u32::from_le_bytes(self.take()?)),
            "float" | "float32" => f64::from(f32::from_le_bytes(self.take()?)),
            "double" | "float64" => f64::from_le_bytes(self.take()?),
            _ => bail!("unknown type {kind}"),
        })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk().context("cut short")?;
        self.rest = rest;
        Ok(*bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;

    #[test]
    fn what_is_written_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("torus.ply");
        let model = meshes::torus(7, 5);
        write(&path, &model).unwrap();
        assert_eq!(read(&path).unwrap(), model);
    }

    #[test]
    fn colours_and_normals_are_passed_over() {
        let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                    property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                    0 0 0 9\n1 0 0 9\n0 1 0 9\n3 0 1 2\n";
        let model = parse(text.as_bytes()).unwrap();
        assert_eq!(model.positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(model.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn cut_short_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("torus.ply");
        write(&path, &meshes::torus(7, 5)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(parse(&bytes[..bytes.len() - 1]).is_err());
    }
}
