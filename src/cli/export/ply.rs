//! Binary PLY, little-endian. Coordinates are `float`, or `double` where `float` would move vertices.

use crate::cli::surface::Surface;
use glam::DVec3;
use std::io::{self, Write};

/// Writes `surface`.
pub(in crate::cli) fn write(surface: &Surface, out: &mut dyn Write) -> io::Result<()> {
    let single = surface.fits_f32(DVec3::ZERO);
    let scalar = if single { "float" } else { "double" };
    writeln!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment written by marquetry"
    )?;
    writeln!(out, "element vertex {}", surface.positions.len())?;
    for name in ["x", "y", "z"] {
        writeln!(out, "property {scalar} {name}")?;
    }
    for name in ["nx", "ny", "nz"] {
        writeln!(out, "property float {name}")?;
    }
    if !surface.colours.is_empty() {
        for name in ["red", "green", "blue"] {
            writeln!(out, "property uchar {name}")?;
        }
    }
    writeln!(out, "element face {}", surface.triangles.len())?;
    writeln!(out, "property list uchar int vertex_indices\nend_header")?;

    let mut colours = surface.colours.iter();
    for (position, normal) in surface.positions.iter().zip(&surface.normals) {
        for coordinate in position.to_array() {
            if single {
                #[expect(clippy::cast_possible_truncation, reason = "checked by fits_f32")]
                out.write_all(&(coordinate as f32).to_le_bytes())?;
            } else {
                out.write_all(&coordinate.to_le_bytes())?;
            }
        }
        for coordinate in normal.to_array() {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        if let Some(colour) = colours.next() {
            out.write_all(colour)?;
        }
    }
    for triangle in &surface.triangles {
        out.write_all(&[3])?;
        for vertex in triangle {
            out.write_all(&vertex.to_le_bytes())?;
        }
    }
    Ok(())
}
