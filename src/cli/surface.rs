//! The triangles of a uniform cut, in world coordinates, and what each level of a file costs and gives.

use super::open::Opened;
use anyhow::{Context, bail};
use glam::{DVec3, Vec3};
use marquetry_engine::lod::cluster;
use marquetry_engine::lod::mesh::extract_mesh;
use marquetry_engine::lod::uniform::{
    Fineness, bytes_before_pages, cut_bytes, cut_triangles, uniform_cut,
};
use marquetry_engine::lod::{Cut, Leaf};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, Document, PageId};
use serde::Serialize;

/// How fine a surface is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    /// All that the file has.
    Finest,
    /// At most this many triangles.
    Triangles(u64),
    /// At most this many bytes read to draw it.
    Bytes(u64),
    /// At most this error, relative to the diagonal of the bounds.
    ErrorRel(f64),
}

/// A surface with its vertices welded, in the input's units.
#[derive(Debug)]
pub(super) struct Surface {
    pub(super) positions: Vec<DVec3>,
    /// Unit length.
    pub(super) normals: Vec<Vec3>,
    /// sRGB; empty when the file has none.
    pub(super) colours: Vec<[u8; 3]>,
    /// Counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Bytes of the file that it takes to draw it.
    pub(super) bytes: u64,
    /// Guaranteed bound of its distance to the source, relative.
    pub(super) error_rel: f64,
    /// Distance between neighbouring places that a vertex can be at.
    pub(super) step: f64,
}

impl Surface {
    /// Whether `f32` coordinates relative to `origin` keep the vertices apart.
    pub(super) fn fits_f32(&self, origin: DVec3) -> bool {
        let furthest = self
            .positions
            .iter()
            .map(|p| (*p - origin).abs().max_element())
            .fold(0.0, f64::max);
        furthest * f64::from(f32::EPSILON) <= 0.25 * self.step
    }

    /// Smallest and largest coordinates; zero without vertices.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let first = self.positions.first().copied().unwrap_or_default();
        self.positions
            .iter()
            .fold((first, first), |(min, max), &p| (min.min(p), max.max(p)))
    }
}

/// The uniform cut of `opened`, whose index is loaded, that is as fine as `wanted` allows.
///
/// # Errors
/// When a page cannot be read, or even the coarsest (for an error: the finest) cut is not within `wanted`.
pub(super) fn extract(file: &str, opened: &Opened, wanted: Wanted) -> anyhow::Result<Surface> {
    let Opened { source, document } = opened;
    let scale = Scale::of(document);
    let fineness = match wanted {
        Wanted::Finest => Fineness::Finest,
        Wanted::Triangles(most) => Fineness::Triangles(most),
        Wanted::Bytes(most) => Fineness::Bytes(most),
        Wanted::ErrorRel(error) => Fineness::Error(scale.lattice_from_rel(error)),
    };
    let cut = uniform_cut(document, fineness).with_context(|| file.to_owned())?;
    let bytes = bytes_before_pages(document) + cut_bytes(document, &cut);
    let error_rel = scale.rel_from_lattice(error_of(document, &cut));
    match wanted {
        Wanted::Triangles(most) if cut_triangles(document, &cut) > most => bail!(
            "{file}: the coarsest cut has {} triangles, more than the {most} asked for",
            cut_triangles(document, &cut)
        ),
        Wanted::Bytes(most) if bytes > most => {
            bail!("{file}: the coarsest cut takes {bytes} bytes, more than the {most} asked for")
        }
        Wanted::ErrorRel(most) if error_rel > most => bail!(
            "{file}: the finest cut has an error of {error_rel:.2e}, more than the {most:.2e} asked \
             for; ask for that, or convert again with a smaller --error-rel"
        ),
        _ => {}
    }
    let mesh = extract_mesh(document, source.as_ref(), &cut).with_context(|| file.to_owned())?;
    let lattice = &document.metadata.lattice;
    let world = |p: DVec3| DVec3::from_array(lattice.origin) + lattice.step * p;
    Ok(Surface {
        positions: mesh.positions.into_iter().map(world).collect(),
        normals: mesh.normals,
        colours: mesh.colours,
        triangles: mesh.triangles,
        bytes,
        error_rel,
        step: lattice.step * f64::from(1u32 << lattice.shift),
    })
}

/// Triangles of the coarsest cut of `opened`, whose index is loaded.
pub(super) fn coarsest_triangles(Opened { document, .. }: &Opened) -> u64 {
    cut_triangles(document, &Cut::coarsest(document.charts.len()))
}

/// One level of a file: every chart at one resolution, or at its finest where that is less; clusters as coarse as the
/// charts' error allows. In a file without charts, clusters of one depth of the graph, or the finest where that is less.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Level {
    /// Triangles drawn, the flat ones beside coarser neighbours included.
    pub(super) triangles: u64,
    /// Bytes of the file that it takes to draw it.
    pub(super) bytes: u64,
    /// Guaranteed bound of its distance to the source, relative to the diagonal of the bounds.
    pub(super) error_rel: f64,
}

/// All levels of `document`, whose index is loaded, coarsest first.
pub(super) fn levels(document: &Document) -> Vec<Level> {
    let scale = Scale::of(document);
    let before_pages = bytes_before_pages(document);
    let (cuts, errors): (Vec<_>, Vec<_>) = level_cuts(document)
        .into_iter()
        .map(|cut| {
            let error = error_of(document, &cut);
            (cut, error)
        })
        .unzip();
    cuts.iter()
        .zip(errors)
        .map(|(cut, error)| Level {
            triangles: cut_triangles(document, cut),
            bytes: before_pages + cut_bytes(document, cut),
            error_rel: scale.rel_from_lattice(error),
        })
        .collect()
}

/// The cuts of all levels. At the last, clusters are at their finest; at the others where their error is about the charts'.
fn level_cuts(document: &Document) -> Vec<Cut> {
    if document.charts.is_empty() {
        return cluster_cuts(document);
    }
    let mut cuts: Vec<Cut> = (0..)
        .map_while(|resolution| cut_at_resolution(document, resolution))
        .collect();
    let last = cuts.len().saturating_sub(1);
    for (level, cut) in cuts.iter_mut().enumerate() {
        let most = if level == last {
            -1.0
        } else {
            chart_error(document, cut)
        };
        cluster::refine(document, cut, |_, _, over| f64::from(over) > most);
    }
    cuts
}

/// A cut for every depth of the graph of clusters.
fn cluster_cuts(document: &Document) -> Vec<Cut> {
    let nodes = document.clusters.iter().flat_map(|graph| &graph.nodes);
    let deepest = nodes.map(|node| node.level).max().unwrap_or(0);
    let cut_at = |depth| {
        let mut cut = Cut::coarsest(0);
        cluster::refine(document, &mut cut, |_, node, _| node.level < depth);
        cut
    };
    (0..=deepest).map(cut_at).collect()
}

/// Every chart at `resolution` or its finest; `None` where no chart has that resolution.
fn cut_at_resolution(document: &Document, resolution: u8) -> Option<Cut> {
    let mut cut = Cut::coarsest(document.charts.len());
    let mut reached = resolution == 0;
    for (id, chart) in (0..).map(ChartId).zip(&document.charts) {
        cut.set_root(id, resolution.min(chart.resolution));
        reached |= chart.resolution >= resolution;
        let mut stack = vec![(marquetry_format::NodeId::root(id), PageId(id.0))];
        while let Some((node, page)) = stack.pop() {
            if PAGE_RESOLUTION + node.level >= resolution {
                // Of roots their own resolution tells it.
                reached |= node.level > 0;
                continue;
            }
            let Some(first) = document.first_child(page) else {
                continue;
            };
            cut.split(node);
            for (quadrant, child) in marquetry_engine::lod::cut::QUADRANTS.into_iter().zip(0..) {
                stack.push((node.child(quadrant), PageId(first.0 + child)));
            }
        }
    }
    reached.then_some(cut)
}

/// Largest geometric error of what `cut` draws, lattice units.
fn error_of(document: &Document, cut: &Cut) -> f64 {
    chart_error(document, cut).max(cluster::error(document, cut))
}

/// Largest geometric error of the leaves of `cut`, lattice units.
fn chart_error(document: &Document, cut: &Cut) -> f64 {
    let error = |leaf: Leaf| {
        let entry = document.page(document.page_of_node(leaf.node)?)?;
        let place = if leaf.node.level == 0 {
            leaf.resolution
        } else {
            0
        };
        entry.errors.get(usize::from(place)).copied()
    };
    cut.leaves()
        .into_iter()
        .filter_map(error)
        .map(f64::from)
        .fold(0.0, f64::max)
}

/// Between lattice units and parts of the diagonal.
struct Scale {
    step: f64,
    diagonal: f64,
}

impl Scale {
    fn of(document: &Document) -> Self {
        let metadata = &document.metadata;
        let [min, max] = [metadata.bounds_min, metadata.bounds_max].map(DVec3::from_array);
        Self {
            step: metadata.lattice.step,
            diagonal: (max - min).length(),
        }
    }

    fn rel_from_lattice(&self, length: f64) -> f64 {
        if self.diagonal > 0.0 {
            length * self.step / self.diagonal
        } else {
            0.0
        }
    }

    fn lattice_from_rel(&self, error: f64) -> f64 {
        error * self.diagonal / self.step
    }
}
