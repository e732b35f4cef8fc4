//! What a conversion is asked for.

use crate::mesh::decimate;

/// Which axis points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Up {
    /// x.
    X,
    /// y.
    #[default]
    Y,
    /// z.
    Z,
}

/// What charts are made of. The rest is clusters of its own triangles, simplified within the target unless there are colours or images.
///
/// Whatever is asked for, torn meshes and components too small for charts have none, and meshes with a component too large for a graph of
/// clusters, and those that are mostly thinner than the lattice tells, have them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Charts {
    /// Meshes with colours of vertices and without images, where they are fit for it.
    #[default]
    Auto,
    /// All that is fit for it.
    Always,
    /// Nothing.
    Never,
}

impl Charts {
    /// Whether a mesh may have charts; it `is_coloured` with colours of vertices and without images.
    pub(super) fn of(self, is_coloured: bool) -> bool {
        match self {
            Self::Auto => is_coloured,
            Self::Always => true,
            Self::Never => false,
        }
    }
}

/// What a conversion is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// Target RMS error, relative to the diagonal of the bounds; > 0.
    pub error_rel: f64,
    /// Write the file even where the target is missed.
    pub allow_worse: bool,
    /// What charts are made of.
    pub charts: Charts,
    /// Which axis points up.
    pub up: Up,
    /// Ceiling of working memory in bytes; what needs more is refused ([`crate::memory`]).
    pub memory_bytes: u64,
    /// Threads; `None` for all.
    pub threads: Option<usize>,
    /// Samples for a triangle of the source that charts may take; where they need more, clusters of its triangles are
    /// smaller (`ARCHITECTURE.md`).
    pub samples_per_triangle: u64,
    /// Triangles from which on a mesh without colours or images is decimated before charts are made of it, to about half as many
    /// ([`decimate`]).
    pub decimate_above: usize,
    /// Put a picture of the model into the file ([`crate::thumbnail`]).
    pub thumbnail: bool,
    /// Triangles up to which a mesh that becomes clusters is kept while it is converted, to measure against, where `memory_bytes` allows it;
    /// of larger ones only points are.
    pub keep_up_to: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            error_rel: 1e-4,
            allow_worse: false,
            charts: Charts::default(),
            up: Up::Y,
            memory_bytes: 4 << 30,
            threads: None,
            samples_per_triangle: 8,
            decimate_above: decimate::MANY,
            thumbnail: true,
            keep_up_to: decimate::MOST_KEPT,
        }
    }
}
