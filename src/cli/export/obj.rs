//! Wavefront OBJ: positions in full precision, colours after them as many programs have it, normals.

use crate::cli::surface::Surface;
use std::io::{self, Write};

/// Writes `surface`.
pub(in crate::cli) fn write(surface: &Surface, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# written by marquetry")?;
    let mut colours = surface.colours.iter();
    for position in &surface.positions {
        write!(out, "v {} {} {}", position.x, position.y, position.z)?;
        if let Some(colour) = colours.next() {
            for channel in colour {
                write!(out, " {:.4}", f32::from(*channel) / 255.0)?;
            }
        }
        writeln!(out)?;
    }
    for normal in &surface.normals {
        writeln!(out, "vn {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z)?;
    }
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|vertex| u64::from(vertex) + 1);
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}
