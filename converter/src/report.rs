//! The machine-readable report of a conversion: the keys of the command line's contract.

use crate::mesh::account::{Account, Reason};
use crate::texture::stage::TextureReport;

/// What a conversion did.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Report {
    /// What was read.
    pub input: InputReport,
    /// How the surface was cut into charts.
    pub layout: LayoutReport,
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
    /// The fit of samples to the source.
    pub fit: FitReport,
    /// Input that is not in the output.
    pub lost: Lost,
    /// Input that repeats other input.
    pub merged: Merged,
    /// Textures and the colour tiles made of them.
    pub textures: TextureReport,
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
    pub components: usize,
    /// Boundary loops after welding.
    pub boundary_loops: usize,
    /// Edges of more than two triangles after welding.
    pub non_manifold_edges: usize,
    /// Vertices on the inside of border edges (T-junctions), which were joined to them.
    pub t_junctions: usize,
    /// Triangles taken away because there are far more than the target asks for.
    pub decimated: usize,
}

/// How the surface was cut into charts.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct LayoutReport {
    /// Regions, each of as many charts as it has corners.
    pub regions: u32,
    /// Area of the charts, in squares of the input's unit.
    pub chart_area: AreaReport,
    /// Handles that were cut and capped for the layout's sake.
    pub handles_cut: usize,
    /// Thin fingers that were cut off and became clusters.
    pub fingers_cut: usize,
    /// Triangles of the caps: no part of the input.
    pub cap_triangles: usize,
    /// Bound of the distance from the caps to the input, relative to the diagonal of its bounds.
    pub cap_distance_rel: f64,
}

/// Spread of the charts' areas.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct AreaReport {
    /// Smallest.
    pub min: f64,
    /// Median (of an even number, the larger of the two in the middle).
    pub median: f64,
    /// Largest.
    pub max: f64,
}

impl AreaReport {
    pub(crate) fn of(mut areas: Vec<f64>) -> Self {
        areas.sort_unstable_by(f64::total_cmp);
        Self {
            min: areas.first().copied().unwrap_or(0.0),
            median: areas.get(areas.len() / 2).copied().unwrap_or(0.0),
            max: areas.last().copied().unwrap_or(0.0),
        }
    }
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
    /// Resolutions, the coarsest (one cell a chart) included; without charts, depths of the graph of clusters.
    pub levels: u32,
    /// Samples of the pages, shared ones counted in each.
    pub samples: u64,
    /// Components that became clusters.
    pub clusters: crate::cluster::Summary,
}

/// One stage.
#[derive(Debug, Clone, serde::Serialize)]
pub struct StageReport {
    /// Its name.
    pub name: &'static str,
    /// Wall time.
    pub seconds: f64,
    /// Processor time, of all threads.
    pub cpu_seconds: f64,
    /// Largest resident set of the process up to the end of the stage.
    pub peak_rss_bytes: u64,
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
    /// Hausdorff distance, measured at all vertices and many samples: what `max_rel` bounds.
    pub hausdorff_rel: f64,
}

/// The least-squares fit of the finest surface's samples.
#[derive(Debug, Clone, serde::Serialize)]
pub struct FitReport {
    /// Samples of the finest surface, those shared by leaves counted once.
    pub points: u64,
    /// Those of them that the fit would have made worse, and that stay where the source was sampled.
    pub kept: u64,
}

/// Input that is not in the output.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Lost {
    /// Triangles.
    pub triangles: usize,
    /// Why, in words with counts.
    pub reason: Vec<String>,
}

impl Lost {
    pub(crate) fn of(account: &Account) -> Self {
        let reasons = [Reason::NonFinite, Reason::Degenerate, Reason::TooSmall];
        let (triangles, reason) = counts(account, &reasons);
        Self { triangles, reason }
    }
}

/// Triangles that repeat others: their surface is in the output once.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Merged {
    /// Triangles.
    pub triangles: usize,
    /// Why, in words with counts.
    pub reason: Vec<String>,
}

impl Merged {
    pub(crate) fn of(account: &Account) -> Self {
        let (triangles, reason) = counts(account, &[Reason::Duplicate, Reason::SecondSide]);
        Self { triangles, reason }
    }
}

fn counts(account: &Account, reasons: &[Reason]) -> (usize, Vec<String>) {
    let found = reasons
        .iter()
        .map(|&r| (r, account.lost(r).triangles))
        .filter(|&(_, n)| n > 0);
    let words = found
        .clone()
        .map(|(reason, n)| format!("{n}: {reason}"))
        .collect();
    (found.map(|(_, n)| n).sum(), words)
}
