//! What can be wrong with an input file.
//!
//! Every message names the file, the place in it, the cause, and what to do about it.

use std::path::{Path, PathBuf};
use std::{fmt, io};

/// Why an input file gave no mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file could not be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file was read, but what it holds is no usable mesh.
    #[error("{}{place}: {fault}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Where in it (after decompression).
        place: Place,
        /// What is wrong there.
        fault: Fault,
    },
    /// Triangles were read, but none has an area.
    #[error(
        "{}: none of the {triangles} triangles can be used ({non_finite} have a corner that is not finite, {degenerate} \
         have coinciding corners); check the scale and the number format of the export",
        path.as_deref().unwrap_or(Path::new("input")).display()
    )]
    NoSurface {
        /// The file, where known.
        path: Option<PathBuf>,
        /// Triangles read.
        triangles: usize,
        /// Of these, with a NaN or infinite corner.
        non_finite: usize,
        /// Of these, with at most two distinct corners.
        degenerate: usize,
    },
    /// The mesh has more triangles than 32-bit half-edges can number.
    #[error(
        "{}: {triangles} triangles are more than the {} that one mesh can hold; split the input",
        path.as_deref().unwrap_or(Path::new("input")).display(),
        MAX_TRIANGLES
    )]
    TooLarge {
        /// The file, where known.
        path: Option<PathBuf>,
        /// Triangles read.
        triangles: usize,
    },
}

/// Half-edge ids are `u32`, three a triangle, one value is reserved; halved for what subdivision may add.
pub const MAX_TRIANGLES: usize = (u32::MAX as usize - 1) / 6;

impl ImportError {
    /// The same error, with the file's name filled in where it was not known.
    #[must_use]
    pub fn in_file(mut self, file: &Path) -> Self {
        match &mut self {
            Self::NoSurface { path, .. } | Self::TooLarge { path, .. } => {
                path.get_or_insert_with(|| file.to_path_buf());
            }
            Self::Read { .. } | Self::Content { .. } => {}
        }
        self
    }
}

/// Where in a file (after decompression) a fault lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(u64),
    /// A byte offset, counted from 0.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Byte(offset) => write!(f, ", byte {offset}"),
        }
    }
}

/// What is wrong with the content of an input file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// No bytes at all.
    #[error("the file is empty; export or download it again")]
    Empty,
    /// No known mesh format.
    #[error(
        "not a mesh in a known format ({found}); give a PLY, OBJ, STL, OFF, GLB or glTF file, or one of them gzipped"
    )]
    UnknownFormat {
        /// What the file looks like.
        found: String,
    },
    /// The gzip stream is damaged.
    #[error(
        "the gzip data are damaged or cut short ({cause}); download or compress the file again"
    )]
    Gzip {
        /// What the decompressor said.
        cause: String,
    },
    /// Decompression gave more than any mesh file would.
    #[error(
        "decompressing gives more than {limit} bytes, far more than its size suggests; decompress it first if it is genuine"
    )]
    GzipBomb {
        /// The limit in bytes.
        limit: u64,
    },
    /// The header does not follow the format.
    #[error("bad {format} header: {cause}; export the file again")]
    Header {
        /// Name of the format.
        format: &'static str,
        /// What is wrong.
        cause: String,
    },
    /// The body does not follow the format.
    #[error("{cause}; the file is damaged, export it again")]
    Syntax {
        /// What is wrong.
        cause: String,
    },
    /// The file ends before what it announces.
    #[error("the file ends early: {missing}; it is cut short, copy or export it again")]
    Truncated {
        /// What was to come.
        missing: String,
    },
    /// A face refers to a vertex that does not exist.
    #[error(
        "a face refers to vertex {index}, but there are {vertices} vertices (counted from 0); export the file again"
    )]
    IndexOutOfRange {
        /// The index, counted from 0.
        index: i64,
        /// Number of vertices.
        vertices: u64,
    },
    /// The file is valid and holds no triangle.
    #[error(
        "there are no triangles ({vertices} vertices, {faces} faces); point clouds and lines cannot be converted"
    )]
    NoTriangles {
        /// Vertices stored.
        vertices: u64,
        /// Faces stored, all of them without area.
        faces: u64,
    },
    /// No vertex has finite coordinates.
    #[error(
        "none of the {vertices} vertices has finite coordinates; check the number format of the export"
    )]
    NothingFinite {
        /// Vertices stored.
        vertices: u64,
    },
    /// More than 32-bit indices can number.
    #[error("{count} {what} are more than the {limit} that one mesh can hold; split the input")]
    TooMany {
        /// Vertices or triangles.
        what: &'static str,
        /// How many.
        count: u64,
        /// The limit.
        limit: u64,
    },
    /// A part of the format that is not supported.
    #[error("{what} is not supported; {advice}")]
    Unsupported {
        /// The feature.
        what: String,
        /// What to do instead.
        advice: &'static str,
    },
    /// A file that this one refers to could not be used.
    #[error(
        "it refers to `{uri}`, which cannot be used: {cause}; keep the two files together, or export as GLB"
    )]
    Reference {
        /// The reference as written.
        uri: String,
        /// Why.
        cause: String,
    },
}

/// A fault and its place, before the file's name is added.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ParseError {
    pub(crate) place: Place,
    pub(crate) fault: Fault,
}

impl ParseError {
    pub(crate) fn at(place: Place, fault: Fault) -> Self {
        Self { place, fault }
    }

    pub(crate) fn syntax(place: Place, cause: impl Into<String>) -> Self {
        Self::at(
            place,
            Fault::Syntax {
                cause: cause.into(),
            },
        )
    }

    pub(crate) fn truncated(place: Place, missing: impl Into<String>) -> Self {
        Self::at(
            place,
            Fault::Truncated {
                missing: missing.into(),
            },
        )
    }
}
