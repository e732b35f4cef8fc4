//! How a conversion fails.

use crate::error::ImportError;
use crate::quadrangulate::QuadrangulateError;
use crate::texture::build::TextureError;
use crate::thumbnail::ThumbnailError;
use marquetry_evaluation::distance;
use std::path::PathBuf;

/// A conversion that failed. Nothing was written under the output's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The input cannot be read as a mesh.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The surface could not be cut into charts.
    #[error("{path}: the surface cannot be cut into charts: {source}")]
    Layout {
        /// The input.
        path: PathBuf,
        /// Why.
        source: QuadrangulateError,
    },
    /// The target was missed.
    #[error(
        "{path}: the error reached is {reached:.2e} of the diagonal, the target is {target:.2e}; \
         ask for less with --error-rel, or accept it with --allow-worse"
    )]
    AboveTarget {
        /// The input.
        path: PathBuf,
        /// RMS error, relative.
        reached: f64,
        /// Target, relative.
        target: f64,
    },
    /// The input needs more memory than it may have.
    #[error(
        "{path}: needs more than the {} MiB of memory allowed ({} MiB at stage {stage}); allow more with --memory, \
         or ask for less with --error-rel", allowed >> 20, used >> 20
    )]
    Memory {
        /// The input.
        path: PathBuf,
        /// The stage that took it.
        stage: &'static str,
        /// Bytes taken.
        used: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// The input is known to need more memory than it may have; none was taken for it.
    #[error(
        "{path}: {triangles} triangles need about {} MiB of memory, but only {} MiB are allowed; allow more with --memory, \
         or simplify or split the input", needed >> 20, allowed >> 20
    )]
    TooLarge {
        /// The input.
        path: PathBuf,
        /// Its triangles.
        triangles: u64,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// Vertices without a place.
    #[error(
        "{path}: vertex {first} (counted from 0) is not finite (NaN, infinite or beyond 1e70), as {count} in all are; \
         repair the file, or drop the triangles that touch them with --allow-worse"
    )]
    NotFinite {
        /// The input.
        path: PathBuf,
        /// The first such vertex.
        first: usize,
        /// How many there are.
        count: usize,
    },
    /// The textures cannot be used.
    #[error("{path}: {source}")]
    Textures {
        /// The input.
        path: PathBuf,
        /// Why.
        source: TextureError,
    },
    /// The result could not be measured.
    #[error("{path}: the result cannot be measured: {source}")]
    Measure {
        /// The input.
        path: PathBuf,
        /// Why.
        source: distance::MeshError,
    },
    /// No picture could be made of the model: our fault.
    #[error("{path}: no thumbnail can be made: {source}; leave it out with --no-thumbnail")]
    Thumbnail {
        /// The input.
        path: PathBuf,
        /// Why.
        source: ThumbnailError,
    },
    /// The target is no positive number.
    #[error("the target error must be a number above 0 and at most 1, not {0}")]
    Target(f64),
    /// The output cannot be written.
    #[error("{path}: cannot be written")]
    Output {
        /// The output.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file written is not what was meant: our fault.
    #[error("{path}: the file written does not read back: {source}")]
    Format {
        /// The output.
        path: PathBuf,
        /// Why.
        source: marquetry_format::Error,
    },
    /// Threads could not be started.
    #[error("cannot start threads: {0}")]
    Threads(String),
}
