//! `marquetry export`: the reconstructed mesh of a cut, as PLY, OBJ or GLB.

mod glb;
mod obj;
mod ply;

use super::output::{self, Output};
use super::surface::{self, Wanted};
use super::{Verdict, args, open};
use anyhow::bail;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Export the mesh of a uniform cut, watertight wherever the input was
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
    /// The mesh to write; its extension (ply, obj, glb) is the format
    #[arg(short, long, value_name = "MESH", value_parser = mesh_path)]
    output: PathBuf,
    /// The finest cut of at most N triangles [default: the finest there is]
    #[arg(long, value_name = "N", conflicts_with = "error_rel")]
    triangles: Option<u64>,
    /// The coarsest cut of at most this error, relative to the diagonal of the bounds
    #[arg(long, value_name = "E", value_parser = args::relative)]
    error_rel: Option<f64>,
}

/// Formats of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Ply,
    Obj,
    Glb,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }
}

fn mesh_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match Format::of(&path) {
        Some(_) => Ok(path),
        None => Err("expected a name that ends in .ply, .obj or .glb".to_owned()),
    }
}

#[derive(Debug, Serialize)]
struct Report {
    path: String,
    bytes: u64,
    triangles: usize,
    vertices: usize,
    /// Guaranteed bound of the distance to the source, relative to the diagonal of the bounds.
    error_rel: f64,
}

pub(super) fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<Verdict> {
    let wanted = match (arguments.triangles, arguments.error_rel) {
        (Some(most), _) => Wanted::Triangles(most),
        (None, Some(error)) => Wanted::ErrorRel(error),
        (None, None) => Wanted::Finest,
    };
    let opened = open::open_indexed(&arguments.file)?;
    let surface = surface::extract(&arguments.file, &opened, wanted)?;
    let path = &arguments.output;
    match Format::of(path) {
        Some(Format::Ply) => output::write_file(path, |out| ply::write(&surface, out))?,
        Some(Format::Obj) => output::write_file(path, |out| obj::write(&surface, out))?,
        Some(Format::Glb) => output::write_file(path, |out| glb::write(&surface, out))?,
        None => bail!(
            "{}: its name does not say which format it is",
            path.display()
        ),
    }
    let report = Report {
        path: path.display().to_string(),
        bytes: std::fs::metadata(path)?.len(),
        triangles: surface.triangles.len(),
        vertices: surface.positions.len(),
        error_rel: surface.error_rel,
    };
    output.say(&format!(
        "{}: {} triangles, {} vertices, {}, error at most {:.2e} of the diagonal",
        report.path,
        report.triangles,
        report.vertices,
        output::bytes(report.bytes),
        report.error_rel
    ));
    output.report(&report)?;
    Ok(Verdict::Good)
}

#[cfg(test)]
mod tests {
    use super::super::surface::Surface;
    use super::*;
    use glam::{DVec3, Vec3};
    use marquetry_converter::import;

    /// A tetrahedron far from the origin, so that `f32` coordinates would fall together.
    fn tetrahedron(offset: f64, coloured: bool) -> Surface {
        let at = |x, y, z| DVec3::splat(offset) + DVec3::new(x, y, z);
        Surface {
            positions: vec![
                at(0.0, 0.0, 0.0),
                at(1.0, 0.0, 0.0),
                at(0.0, 1.0, 0.0),
                at(0.0, 0.0, 1.0),
            ],
            normals: vec![Vec3::NEG_ONE.normalize_or_zero(), Vec3::X, Vec3::Y, Vec3::Z],
            colours: if coloured {
                vec![[0, 0, 0], [255, 0, 0], [10, 128, 200], [255, 255, 255]]
            } else {
                Vec::new()
            },
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            bytes: 0,
            error_rel: 0.0,
            step: 1e-3,
        }
    }

    #[test]
    fn every_format_reads_back_as_it_was() {
        for (name, write) in [
            (
                "a.ply",
                ply::write as fn(&Surface, &mut dyn std::io::Write) -> std::io::Result<()>,
            ),
            ("a.obj", obj::write),
            ("a.glb", glb::write),
        ] {
            for (offset, coloured) in [(0.0, false), (0.0, true), (1e7, true)] {
                let surface = tetrahedron(offset, coloured);
                let mut bytes = Vec::new();
                write(&surface, &mut bytes).unwrap();
                let (mesh, _) = import::import_bytes(bytes, Path::new(name)).unwrap();
                assert_eq!(mesh.triangles, surface.triangles, "{name}");
                assert_eq!(mesh.colours, surface.colours, "{name}");
                for (read, wrote) in mesh.positions.iter().zip(&surface.positions) {
                    assert!(
                        read.distance(*wrote) < 1e-6,
                        "{name}: {read} is not {wrote}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_format_follows_from_the_extension() {
        assert_eq!(Format::of(Path::new("a/b.PLY")), Some(Format::Ply));
        assert_eq!(Format::of(Path::new("b.tar.glb")), Some(Format::Glb));
        for name in ["ply", "a.fbx", "a.", ""] {
            assert_eq!(Format::of(Path::new(name)), None, "{name}");
        }
    }
}
