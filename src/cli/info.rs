//! `marquetry info`: what is in a file.

use super::output::{self, Output};
use super::surface::{self, Level};
use super::{Verdict, open};
use marquetry_format::{BytesByPart, ContentKind};
use serde::Serialize;
use std::fmt::Write as _;

/// Say what is in a file
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
}

#[derive(Debug, Serialize)]
struct Report {
    format: Version,
    kind: ContentKind,
    content_id: String,
    bounds: Bounds,
    /// `x`, `y` or `z`.
    up: &'static str,
    charts: usize,
    /// Resolutions, the coarsest included; without charts, depths of the graph of clusters.
    levels: usize,
    /// Of charts and clusters.
    pages: u32,
    /// `null` in a file without clusters.
    clusters: Option<Clusters>,
    colours: bool,
    bytes: BytesByPart,
    first_read_bytes: u64,
    first_image_bytes: u64,
    /// Coarsest first: every chart at that resolution, or its finest where that is less; without charts, every cluster of that depth, or the
    /// finest.
    level: Vec<Level>,
    error: ErrorReport,
    source: Provenance,
}

#[derive(Debug, Serialize)]
struct Clusters {
    nodes: u32,
    leaves: usize,
    levels: u32,
    /// Of all leaves.
    triangles: u64,
}

impl Clusters {
    fn of(tree: &marquetry_format::Clusters) -> Self {
        let leaves = tree.nodes.iter().filter(|node| node.children.is_empty());
        let deepest = tree.nodes.iter().map(|node| node.level).max().unwrap_or(0);
        Self {
            nodes: tree.count(),
            leaves: leaves.count(),
            levels: u32::from(deepest) + 1,
            triangles: tree.leaf_triangles(),
        }
    }
}

#[derive(Debug, Serialize)]
struct Version {
    major: u16,
    minor: u16,
}

#[derive(Debug, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

/// Relative to the diagonal of the bounds.
#[expect(clippy::struct_field_names, reason = "keys of the report")]
#[derive(Debug, Serialize)]
struct ErrorReport {
    target_rel: f64,
    max_rel: f64,
    rms_rel: f64,
}

#[derive(Debug, Serialize)]
struct Provenance {
    name: String,
    triangles: u64,
    vertices: u64,
    generator: String,
}

pub(super) fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<Verdict> {
    let document = open::open_indexed(&arguments.file)?.document;
    let metadata = &document.metadata;
    let (major, minor) = document.version();
    let level = surface::levels(&document);
    let report = Report {
        format: Version { major, minor },
        kind: metadata.kind,
        content_id: document.content_id_hex(),
        bounds: Bounds {
            min: metadata.bounds_min,
            max: metadata.bounds_max,
        },
        up: match metadata.up_axis {
            0 => "x",
            1 => "y",
            _ => "z",
        },
        charts: document.charts.len(),
        levels: level.len(),
        pages: document.stored_page_count(),
        clusters: document.clusters.as_ref().map(Clusters::of),
        colours: metadata.has_colours,
        bytes: document.bytes_by_part(),
        first_read_bytes: document.first_read_bytes(),
        first_image_bytes: document.front_bytes(),
        level,
        error: ErrorReport {
            target_rel: metadata.target_error_rel,
            max_rel: metadata.max_error_rel,
            rms_rel: metadata.rms_error_rel,
        },
        source: Provenance {
            name: metadata.source_name.clone(),
            triangles: metadata.source_triangles,
            vertices: metadata.source_vertices,
            generator: metadata.generator.clone(),
        },
    };
    output.say(&describe(&arguments.file, &report));
    output.report(&report)?;
    Ok(Verdict::Good)
}

fn describe(file: &str, report: &Report) -> String {
    let size = output::bytes;
    let Version { major, minor } = report.format;
    let (bytes, source, error) = (&report.bytes, &report.source, &report.error);
    let [min, max] =
        [report.bounds.min, report.bounds.max].map(|p| p.map(|c| format!("{c}")).join(", "));
    let kind = match report.kind {
        ContentKind::Scan => "scan",
        ContentKind::Terrain => "terrain",
        ContentKind::Scene => "scene",
    };
    let mut text = format!(
        "{file}: {kind}, format {major}.{minor}, content {}\n\
         made of    {} ({} triangles, {} vertices) by {}\n\
         bounds     {min} to {max}, {} up\n\
         contents   {} charts, {} levels, {} pages\n\
         bytes      {}: header {}, index {}, geometry {}, normals {}, colour {}, thumbnail {}\n\
         opening    {} in the first read, {} for the first image\n\
         error      {:.2e} rms, at most {:.2e} of the diagonal (target {:.2e})\n",
        report.content_id,
        source.name,
        source.triangles,
        source.vertices,
        source.generator,
        report.up,
        report.charts,
        report.levels,
        report.pages,
        size(bytes.total),
        size(bytes.header),
        size(bytes.index),
        size(bytes.geometry),
        size(bytes.normals),
        size(bytes.colour),
        size(bytes.thumbnail),
        size(report.first_read_bytes),
        size(report.first_image_bytes),
        error.rms_rel,
        error.max_rel,
        error.target_rel,
    );
    if let Some(clusters) = &report.clusters {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "clusters   {} in {} levels, {} triangles in {} leaves",
            clusters.nodes, clusters.levels, clusters.triangles, clusters.leaves
        );
    }
    text.push_str("level   triangles        bytes      error");
    for (number, level) in report.level.iter().enumerate() {
        // Writing to a string does not fail.
        let _ = write!(
            text,
            "\n{number:>5} {:>11} {:>12} {:>10.2e}",
            level.triangles,
            size(level.bytes),
            level.error_rel
        );
    }
    text
}
