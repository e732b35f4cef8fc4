//! Vertex regions: disks whose adjacency is the dual of a coarse triangulation.
//!
//! Method: vertices are merged bottom-up under the link condition (`contract`), which is valid for any genus and boundary
//! but leaves ragged borders. Voronoi cells of the regions' centres straighten them (`voronoi`); where those
//! are not valid, seeds are added until they are (`repair`), and the cells are merged again under the link
//! condition. One more Lloyd iteration, vertex by vertex and valid at every step, makes the unions round (`relax`). A region that sticks out too far to
//! be flattened is split when somebody has tried ([`split_at()`]).
//! [`verify()`] checks the result by counting. All lengths are relative; equal input gives equal output.
//! Limits: the count exceeds the target where handles and boundary loops ask for more; a pillow (two triangles with the
//! same corners) cannot be segmented.

mod complex;
mod contract;
mod front;
mod protrude;
mod relax;
mod repair;
mod surface;
mod verify;
mod voronoi;

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "test meshes are small")]
mod test_meshes;
#[cfg(test)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::case_sensitive_file_extension_comparisons,
    reason = "known files are read"
)]
mod test_scans;
#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "test meshes are small")]
mod tests;

pub use protrude::split_at;
pub use verify::{Violation, verify};

use crate::mesh::{ManifoldMesh, NONE};
use complex::{Complex, id};
use contract::{Cell, Goal, Partition};
use surface::Surface;
use voronoi::Voronoi;

/// The label of every vertex of a [`ManifoldMesh`].
///
/// Let K be the mesh with every boundary loop closed by a virtual vertex of its own region. Then: every region's dual cell
/// is a disk, two regions meet in at most one arc, three in at most one triangle, and every region has at least
/// three neighbours.
#[derive(Debug, Clone, Default)]
pub struct Segmentation {
    /// Region of every vertex, `0..regions`; 0 for a vertex without triangles.
    pub labels: Vec<u32>,
    /// Number of regions.
    pub regions: u32,
    /// For half-edge `3 * t + k` whose ends have different labels: where, from its start (0) to its end (1), the border of the two
    /// regions crosses the edge, in `[0.05, 0.95]`; both half-edges of an edge agree (`1 - f`). 0.5 elsewhere.
    pub crossings: Vec<f32>,
}

/// Cuts `mesh` into about `target_regions` regions (more where topology asks).
///
/// The result is valid (see [`verify()`]) for every simplicial manifold mesh.
pub fn segment(mesh: &ManifoldMesh, target_regions: u32) -> Segmentation {
    let surface = Surface::of(mesh);
    let goals = goals(&surface, target_regions);
    let mut labels = merge_vertices(&surface, &goals);
    let cells = straighten(mesh, &surface, &labels);
    labels = merge_cells(mesh, &surface, &cells, &goals, &[]);
    let distances = relax(mesh, &surface, &mut labels);
    let crossings = voronoi::crossings(mesh, &surface, &labels.of, &distances);
    for label in &mut labels.of {
        *label = if *label == NONE { 0 } else { *label };
    }
    let segmentation = Segmentation {
        labels: labels.of,
        regions: labels.count,
        crossings,
    };
    if let Err(violation) = verify(mesh, &segmentation) {
        tracing::error!(%violation, "the mesh is not a simplicial manifold");
    }
    segmentation
}

/// A label for every vertex, [`NONE`] for those without triangles.
#[derive(Debug)]
struct Labels {
    of: Vec<u32>,
    count: u32,
}

impl Labels {
    /// Renumbers by first appearance.
    fn numbered(mut of: Vec<u32>, bound: usize) -> Self {
        let mut numbers = vec![NONE; bound];
        let mut count = 0;
        for label in of.iter_mut().filter(|label| **label != NONE) {
            let number = &mut numbers[*label as usize];
            if *number == NONE {
                *number = count;
                count += 1;
            }
            *label = *number;
        }
        Self { of, count }
    }
}

/// Every component's share of the target, by area.
fn goals(surface: &Surface, target_regions: u32) -> Vec<Goal> {
    let areas: Vec<f64> = (0..surface.components.len())
        .map(|component| surface.area(component))
        .collect();
    let total: f64 = areas.iter().sum();
    areas
        .iter()
        .map(|&area| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at most the u32 target"
            )]
            let regions = (f64::from(target_regions) * (area / total))
                .round()
                .max(1.0) as usize;
            // No closed surface has fewer than four regions, no disk fewer than three.
            Goal {
                regions,
                mean_area: area / regions.max(4) as f64,
            }
        })
        .collect()
}

/// The virtual vertices of every component's loops.
fn loops_of(surface: &Surface) -> Vec<usize> {
    let mut counts = vec![0; surface.components.len()];
    for members in &surface.loops {
        counts[surface.component_of[members[0] as usize] as usize] += 1;
    }
    counts
}

fn merge_vertices(surface: &Surface, goals: &[Goal]) -> Labels {
    let count = surface.cells.len();
    let mut complex = Complex::default();
    for v in 0..id(count) {
        let looped = surface.loop_of[v as usize];
        let cone = (looped != NONE).then(|| id(count) + looped);
        complex.push(surface.neighbours(v).iter().copied().chain(cone));
    }
    for members in &surface.loops {
        complex.push(members.iter().copied());
    }
    let mut partition = Partition::new(complex, surface.cells.clone());
    for ((members, virtuals), &goal) in surface.components.iter().zip(loops_of(surface)).zip(goals)
    {
        partition.reduce(members.clone(), virtuals, goal);
    }
    let mut of = partition.into_holders();
    for (label, &component) in of.iter_mut().zip(&surface.component_of) {
        if component == NONE {
            *label = NONE;
        }
    }
    Labels::numbered(of, count)
}

/// Valid cells around the regions' centres. A component that stays invalid keeps `labels`.
fn straighten(mesh: &ManifoldMesh, surface: &Surface, labels: &Labels) -> Voronoi {
    let mut voronoi = Voronoi::of(
        surface,
        &voronoi::centres(surface, &labels.of, labels.count, 0.0),
    );
    let stubborn = repair::repair(mesh, surface, &mut voronoi);
    if stubborn.is_empty() {
        return voronoi;
    }
    tracing::warn!(
        components = stubborn.len(),
        "components keep ragged borders"
    );
    let first = id(voronoi.seeds.len());
    for v in 0..labels.of.len() {
        if stubborn.binary_search(&surface.component_of[v]).is_ok() {
            voronoi.labels[v] = first + labels.of[v];
            // Borders then cross edges in their middle.
            voronoi.distances[v] = 0.0;
        }
    }
    voronoi
}

/// One Lloyd iteration from valid labels to valid labels. Returns distances to the centres, NaN where not known.
fn relax(mesh: &ManifoldMesh, surface: &Surface, labels: &mut Labels) -> Vec<f64> {
    // Full bias: the small regions that handles force would else grow into their neighbours.
    let seeds = voronoi::centres(surface, &labels.of, labels.count, 1.0);
    let Voronoi {
        labels: wanted,
        mut distances,
        ..
    } = Voronoi::of(surface, &seeds);
    let mut dual = adjacency(mesh, surface, labels);
    relax::relax(mesh, surface, &wanted, &distances, &mut dual, labels);
    for (distance, (label, wanted)) in distances.iter_mut().zip(labels.of.iter().zip(&wanted)) {
        if label != wanted {
            *distance = f64::NAN;
        }
    }
    distances
}

/// Merges cells down to the goals; cells with a vertex that is `locked` (none if empty) stay.
fn merge_cells(
    mesh: &ManifoldMesh,
    surface: &Surface,
    voronoi: &Voronoi,
    goals: &[Goal],
    locked: &[bool],
) -> Labels {
    let cells = Labels::numbered(
        voronoi.labels.clone(),
        voronoi.labels.len() + voronoi.seeds.len(),
    );
    let mut means = vec![Cell::default(); cells.count as usize];
    let mut members = vec![Vec::new(); surface.components.len()];
    for (v, &label) in cells
        .of
        .iter()
        .enumerate()
        .filter(|&(_, &label)| label != NONE)
    {
        let mean = &mut means[label as usize];
        if mean.area > 0.0 {
            *mean = mean.merged(surface.cells[v]);
        } else {
            *mean = surface.cells[v];
            members[surface.component_of[v] as usize].push(label);
        }
    }
    let mut partition = Partition::new(adjacency(mesh, surface, &cells), means);
    for (&label, _) in cells.of.iter().zip(locked).filter(|&(_, &locked)| locked) {
        partition.lock(label);
    }
    for ((members, virtuals), &goal) in members.into_iter().zip(loops_of(surface)).zip(goals) {
        partition.reduce(members, virtuals, goal);
    }
    let holders = partition.into_holders();
    let of = cells
        .of
        .iter()
        .map(|&label| {
            if label == NONE {
                NONE
            } else {
                holders[label as usize]
            }
        })
        .collect();
    Labels::numbered(of, holders.len())
}

/// Which cells and loops meet.
fn adjacency(mesh: &ManifoldMesh, surface: &Surface, cells: &Labels) -> Complex {
    let mut pairs = Vec::new();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| cells.of[v as usize]);
        for (a, b) in [(a, b), (b, c), (c, a)] {
            if a != b {
                pairs.extend([[a, b], [b, a]]);
            }
        }
    }
    for (l, members) in surface.loops.iter().enumerate() {
        for &v in members {
            let (a, b) = (cells.of[v as usize], cells.count + id(l));
            pairs.extend([[a, b], [b, a]]);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut complex = Complex::default();
    let mut rest = pairs.as_slice();
    for v in 0..cells.count + id(surface.loops.len()) {
        let (own, after) = rest.split_at(rest.partition_point(|pair| pair[0] == v));
        complex.push(own.iter().map(|pair| pair[1]));
        rest = after;
    }
    complex
}
