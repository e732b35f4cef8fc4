//! Importers: a file in one of several formats to an [`ImportedMesh`].
//!
//! The format is told by content first, then by the file's extension; gzip of any of them is undone first.
//! Polygons are triangulated (fan where convex, else ear clipping). Nothing is welded and no triangle is dropped here
//! except faces with fewer than three distinct corners, which are counted.
//!
//! Limits: the file is read into memory as a whole; every count in it is bounded by its size before memory is taken;
//! gzip may expand to at most [`expansion_limit`] bytes. Curves, points, lines, normals, morph targets and skins are not read.
//! Vertex colours are sRGB with 8 bits a channel; textures of OBJ and glTF and colours of faces come as an [`Appearance`].

mod colour;
mod detect;
mod face_colours;
mod faces;
mod gltf;
mod obj;
mod obj_appearance;
mod off;
mod ply;
mod polygon;
mod references;
mod stl;
mod text;

pub use detect::Format;

use crate::error::{Fault, ImportError, ParseError, Place};
use crate::mesh::ImportedMesh;
use crate::texture::appearance::Appearance;
use faces::Faces;
use glam::DVec3;
use std::io::Read;
use std::path::Path;

/// What was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportReport {
    /// Format of the (decompressed) file.
    pub format: Format,
    /// Whether the file was gzipped.
    pub gzipped: bool,
    /// Bytes on disk, of the file itself and of the buffers that it refers to.
    pub bytes: u64,
    /// Triangles as stored, polygons triangulated; as many as the mesh has.
    pub triangles: u64,
    /// Vertices as stored, used or not.
    pub vertices: u64,
    /// Faces left out because they have fewer than three distinct corners.
    pub faces_without_area: u64,
    /// Vertices with a coordinate that is not finite; [`mod@crate::mesh::weld`] drops the triangles that touch them.
    pub non_finite_vertices: u64,
}

/// What a parser hands over: faces not triangulated, indices not checked.
#[derive(Debug, Default)]
struct Soup {
    positions: Vec<DVec3>,
    colours: Vec<[u8; 3]>,
    faces: Faces,
    /// One a face of three and more corners; empty where no face has any.
    face_colours: Vec<Option<[u8; 3]>>,
    /// Bytes read from other files.
    referenced_bytes: u64,
    /// Materials and textures.
    appearance: Appearance,
}

/// Reads the mesh in the file at `path`.
///
/// # Errors
/// [`ImportError::Read`] if the file cannot be read, [`ImportError::Content`] if it is not a mesh, damaged, or without triangles.
pub fn import(path: &Path) -> Result<(ImportedMesh, ImportReport), ImportError> {
    let bytes = std::fs::read(path).map_err(|source| ImportError::Read {
        path: path.to_path_buf(),
        source,
    })?;
    import_bytes(bytes, path)
}

/// Triangles that the file at `path` announces, read from its beginning alone: a lower bound where every face has an area.
///
/// None where the format has no counts, or the file is too short for them.
pub fn announced_triangles(path: &Path) -> Option<u64> {
    /// Enough for the header of any mesh.
    const HEAD: u64 = 1 << 16;
    let file = std::fs::File::open(path).ok()?;
    let stored = file.metadata().ok()?.len();
    let mut head = Vec::new();
    (&file).take(HEAD).read_to_end(&mut head).ok()?;
    let mut most = stored;
    if head.starts_with(&[0x1f, 0x8b]) {
        let mut text = Vec::new();
        // The head ends in the middle of the stream, which is no fault here.
        let _ = flate2::read::MultiGzDecoder::new(&head[..])
            .take(HEAD)
            .read_to_end(&mut text);
        head = text;
        most = expansion_limit(stored);
    }
    // No format needs less than three bytes a face.
    let triangles = match detect::detect(&head, Path::new("")) {
        Some(Format::Ply) => ply::announced_faces(&head),
        Some(Format::Off) => off::announced_faces(&head),
        _ => stl::announced_faces(&head, most),
    };
    triangles.filter(|&n| n <= most / 3)
}

/// Reads the mesh in `bytes`; `path` gives the extension, the folder of referenced files, and the name for messages.
///
/// # Errors
/// [`ImportError::Content`] as for [`import`].
pub fn import_bytes(
    bytes: Vec<u8>,
    path: &Path,
) -> Result<(ImportedMesh, ImportReport), ImportError> {
    parse(bytes, path).map_err(|ParseError { place, fault }| ImportError::Content {
        path: path.to_path_buf(),
        place,
        fault,
    })
}

fn parse(mut bytes: Vec<u8>, path: &Path) -> Result<(ImportedMesh, ImportReport), ParseError> {
    let stored_bytes = bytes.len() as u64;
    let gzipped = bytes.starts_with(&[0x1f, 0x8b]);
    let mut name = path.to_path_buf();
    if gzipped {
        bytes = gunzip(&bytes)?;
        if name
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("gz"))
        {
            name.set_extension("");
        }
    }
    if bytes.is_empty() {
        return Err(ParseError::at(Place::File, Fault::Empty));
    }
    let format = detect::detect(&bytes, &name).ok_or_else(|| {
        ParseError::at(
            Place::File,
            Fault::UnknownFormat {
                found: detect::describe(&bytes),
            },
        )
    })?;
    let mut soup = match format {
        Format::Ply => ply::parse(&bytes)?,
        Format::Obj => {
            let mut soup = obj::parse(&bytes)?;
            obj_appearance::read(&bytes, &name, &mut soup);
            soup
        }
        Format::Stl => stl::parse(&bytes)?,
        Format::Off => off::parse(&bytes)?,
        Format::Glb => gltf::parse_glb(&bytes, &name)?,
        Format::Gltf => gltf::parse_gltf(&bytes, &name)?,
    };
    drop(bytes);
    face_colours::put_on(&mut soup);
    finish(soup, format, gzipped, stored_bytes)
}

/// Bytes that a gzip file of `compressed` bytes may expand to: DEFLATE reaches 1032:1 on constant data, real meshes
/// stay below 30:1.
pub fn expansion_limit(compressed: u64) -> u64 {
    (1 << 26) + 100 * compressed
}

fn gunzip(bytes: &[u8]) -> Result<Vec<u8>, ParseError> {
    let limit = expansion_limit(bytes.len() as u64);
    let mut out = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes)
        .take(limit + 1)
        .read_to_end(&mut out)
        .map_err(|e| {
            ParseError::at(
                Place::File,
                Fault::Gzip {
                    cause: e.to_string(),
                },
            )
        })?;
    if out.len() as u64 > limit {
        return Err(ParseError::at(Place::File, Fault::GzipBomb { limit }));
    }
    Ok(out)
}

fn finish(
    soup: Soup,
    format: Format,
    gzipped: bool,
    stored: u64,
) -> Result<(ImportedMesh, ImportReport), ParseError> {
    let Soup {
        positions,
        mut colours,
        faces,
        referenced_bytes,
        appearance,
        ..
    } = soup;
    let vertices = positions.len() as u64;
    if u32::try_from(positions.len()).is_err() {
        let fault = Fault::TooMany {
            what: "vertices",
            count: vertices,
            limit: u64::from(u32::MAX),
        };
        return Err(ParseError::at(Place::File, fault));
    }
    let stored_faces = faces.len();
    let (triangles, faces_without_area) = faces.triangulate(&positions)?;
    if triangles.is_empty() {
        return Err(ParseError::at(
            Place::File,
            Fault::NoTriangles {
                vertices,
                faces: stored_faces,
            },
        ));
    }
    let non_finite_vertices = positions.iter().filter(|p| !p.is_finite()).count() as u64;
    if non_finite_vertices == vertices {
        return Err(ParseError::at(
            Place::File,
            Fault::NothingFinite { vertices },
        ));
    }
    if !colours.is_empty() {
        colours.resize(positions.len(), [255; 3]);
    }
    let report = ImportReport {
        format,
        gzipped,
        bytes: stored + referenced_bytes,
        triangles: triangles.len() as u64,
        vertices,
        faces_without_area,
        non_finite_vertices,
    };
    Ok((
        ImportedMesh {
            positions,
            colours,
            triangles,
            appearance,
        },
        report,
    ))
}

/// `index` as the id of a vertex.
fn vertex_id(index: usize, place: Place) -> Result<u32, ParseError> {
    // Three below the limit, so that a triangle's corners can be counted up without overflow.
    u32::try_from(index)
        .ok()
        .filter(|&i| i < u32::MAX - 3)
        .ok_or_else(|| {
            let fault = Fault::TooMany {
                what: "vertices",
                count: index as u64,
                limit: u64::from(u32::MAX - 3),
            };
            ParseError::at(place, fault)
        })
}

#[cfg(test)]
mod tests;
