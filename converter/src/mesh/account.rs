//! The books: what became of every imported triangle, and the topology that was found.
//!
//! Triangles in + added by subdivision = kept + lost, reason by reason, + decimated. So do their areas, up to rounding;
//! subdivision adds none.

use super::adjacency::{EdgeTable, UnionFind, end, id, label, start};
use super::decimate::Decimated;
use super::{ImportedMesh, ManifoldMesh, NONE, WeldedMesh};
use glam::DVec3;
use rayon::prelude::*;
use std::fmt;

/// Why a triangle was left out. None of these takes a point of the surface away except `NonFinite`, which has none to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Reason {
    /// A corner is NaN, infinite, or absurdly far ([`is_place`](super::is_place)).
    NonFinite,
    /// Two corners have the same position.
    Degenerate,
    /// Two corners fell together in the tolerance weld.
    TooSmall,
    /// The same three vertices in the same sense as an earlier triangle.
    Duplicate,
    /// The back of a two-sided sheet of no thickness.
    SecondSide,
}

impl Reason {
    /// All reasons, in order.
    pub const ALL: [Self; 5] = [
        Self::NonFinite,
        Self::Degenerate,
        Self::TooSmall,
        Self::Duplicate,
        Self::SecondSide,
    ];
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NonFinite => "a corner is not finite",
            Self::Degenerate => "degenerate: corners coincide",
            Self::TooSmall => "degenerate: smaller than the weld tolerance",
            Self::Duplicate => "duplicate of another triangle",
            Self::SecondSide => "back of a two-sided sheet",
        })
    }
}

/// A number of triangles and their area (input units, squared).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    /// Triangles.
    pub triangles: usize,
    /// Their area.
    pub area: f64,
}

/// Counts over the welded mesh, before anything is cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Topology {
    /// Vertices after welding.
    pub vertices: usize,
    /// Pieces that hang together by shared vertices.
    pub components: usize,
    /// Connected sets of edges with one face.
    pub boundary_loops: usize,
    /// Edges with one face.
    pub boundary_edges: usize,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
}

/// What became of the imported triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Account {
    /// What came in.
    pub imported: Tally,
    /// What was kept, with what subdivision added.
    pub kept: Tally,
    /// What was left out, by reason (index: [`Reason`] in order).
    lost: [Tally; 5],
    /// What rounding may do to the areas: slivers' areas are differences of much larger products.
    rounding: f64,
    /// Vertices put into edges that they lie on.
    pub t_junctions: usize,
    /// Area by which triangles grew (shrank, below 0) that took in vertices not exactly on their edges.
    pub gained_area: f64,
    /// What decimation took away; its area is the difference between before and after.
    pub decimated: Decimated,
    /// Triangles that subdivision added; some may be lost again.
    pub added_triangles: usize,
    /// Edges that were halved so that no two edges have the same ends.
    pub split_edges: usize,
    /// Edges cut although faces meet there, because no consistent orientation or pairing exists.
    pub cut_edges: usize,
    /// Vertices made by splitting non-manifold ones.
    pub vertex_copies: usize,
    /// Triangles turned round.
    pub flipped_triangles: usize,
    /// Distance (input units) of the tolerance weld, where one was needed.
    pub weld_tolerance: Option<f64>,
    /// The welded mesh.
    pub topology: Topology,
}

impl Account {
    /// Opens the books.
    pub fn new(mesh: &ImportedMesh) -> Self {
        let area = total_area(&mesh.positions, &mesh.triangles);
        Self {
            imported: Tally {
                triangles: mesh.triangles.len(),
                area,
            },
            rounding: rounding(&mesh.positions, &mesh.triangles),
            ..Self::default()
        }
    }

    /// What was left out for `reason`.
    pub fn lost(&self, reason: Reason) -> Tally {
        self.lost[reason as usize]
    }

    pub(super) fn lose(&mut self, reason: Reason, corners: [DVec3; 3]) {
        let tally = &mut self.lost[reason as usize];
        tally.triangles += 1;
        tally.area += finite_area(corners);
    }

    pub(super) fn close(&mut self, mesh: &ManifoldMesh) {
        self.kept = Tally {
            triangles: mesh.triangles.len(),
            area: total_area(&mesh.positions, &mesh.triangles),
        };
    }

    /// Checks that triangles and areas balance.
    ///
    /// # Errors
    /// A sentence that says what does not.
    pub fn check(&self) -> Result<(), String> {
        let lost: usize = self.lost.iter().map(|t| t.triangles).sum();
        let decimated = self.decimated.triangles;
        let (came, added) = (self.imported.triangles, self.added_triangles);
        if came + added != self.kept.triangles + lost + decimated {
            return Err(format!(
                "{came} triangles came in and {added} were added, but {} were kept, {lost} left out and {decimated} decimated",
                self.kept.triangles
            ));
        }
        // The tolerance weld moves corners; what it may change is bounded by its distance, not by rounding.
        let allowed = if self.weld_tolerance.is_some() {
            super::weld::WELD_AREA
        } else {
            1e-9
        };
        let lost: f64 = self.lost.iter().map(|t| t.area).sum();
        let out = self.kept.area + lost + self.decimated.area - self.gained_area;
        if (self.imported.area - out).abs() > allowed * self.imported.area + self.rounding {
            return Err(format!(
                "an area of {} came in, but {out} is accounted for",
                self.imported.area
            ));
        }
        Ok(())
    }
}

/// Area of a triangle; 0 if a corner is not finite.
fn finite_area([a, b, c]: [DVec3; 3]) -> f64 {
    let area = (b - a).cross(c - a).length() / 2.0;
    if area.is_finite() { area } else { 0.0 }
}

/// Summed in blocks of fixed size, so the result is the same for any number of threads.
pub(super) fn total_area(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let blocks: Vec<f64> = triangles
        .par_chunks(1 << 13)
        .map(|block| {
            block
                .iter()
                .map(|t| finite_area(t.map(|v| positions[v as usize])))
                .sum()
        })
        .collect();
    blocks.iter().sum()
}

/// Largest sum of the errors that rounding makes in the triangles' areas, whatever order their corners are in.
fn rounding(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let longest = a
            .distance_squared(b)
            .max(b.distance_squared(c))
            .max(c.distance_squared(a));
        // Corners' coordinates are subtracted exactly enough; products of edges are not.
        let error = 8.0 * f64::EPSILON * longest;
        if error.is_finite() { error } else { 0.0 }
    };
    triangles.iter().map(of).sum()
}

impl Topology {
    /// Counts components, boundary loops and non-manifold edges.
    pub fn of(mesh: &WeldedMesh, table: &EdgeTable) -> Self {
        let n = mesh.positions.len();
        let mut whole = UnionFind::new(n);
        for t in &mesh.triangles {
            whole.union(t[0], t[1]);
            whole.union(t[0], t[2]);
        }
        let mut border = UnionFind::new(n);
        let mut ends = Vec::new();
        let mut non_manifold_edges = 0;
        for edge in table.edges() {
            match edge {
                &[h] => {
                    border.union(start(&mesh.triangles, h), end(&mesh.triangles, h));
                    ends.push(start(&mesh.triangles, h));
                }
                [_, _] => {}
                _ => non_manifold_edges += 1,
            }
        }
        Self {
            vertices: n,
            components: label(&mut whole, mesh.triangles.iter().map(|t| t[0])).1 as usize,
            boundary_edges: ends.len(),
            boundary_loops: label(&mut border, ends.into_iter()).1 as usize,
            non_manifold_edges,
        }
    }
}

impl ManifoldMesh {
    /// The component of every triangle, numbered in order of first occurrence, and how many there are.
    pub fn components(&self) -> (Vec<u32>, u32) {
        super::manifold::components(&self.twins)
    }

    /// One half-edge of every boundary loop, the lowest, ascending.
    pub fn boundary_loops(&self) -> Vec<u32> {
        let mut following = vec![NONE; self.positions.len()];
        let open = || (0..id(self.twins.len())).filter(|&h| self.twins[h as usize] == NONE);
        for h in open() {
            following[start(&self.triangles, h) as usize] = end(&self.triangles, h);
        }
        let mut loops = Vec::new();
        for h in open() {
            let mut at = start(&self.triangles, h) as usize;
            if following[at] != NONE {
                loops.push(h);
            }
            while following[at] != NONE {
                at = std::mem::replace(&mut following[at], NONE) as usize;
            }
        }
        loops
    }
}
