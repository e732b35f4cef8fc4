//! Which components are too small for charts, or too ragged.
//!
//! A component hangs together by welded vertices, cuts made for topology's sake included: no crack can open within one.
//! It is small if a leaf has room for it as it is, and ragged if it has a boundary loop for every few triangles, each of which asks
//! for regions of its own: photogrammetry and foliage can be thousands of sheets of a dozen triangles, a sheet being
//! what hangs together by edges, and to show one takes a dozen charts. Of other components the sheets that are small or ragged are taken out.
//! What is left follows only where charts turn out to cost more.
//! Limit: where a sheet was cut off another, coarse levels of both may gape by as much as their errors.

use super::leaf;
use crate::mesh::adjacency::{UnionFind, id, label};
use crate::mesh::{ManifoldMesh, NONE};
use glam::DVec3;
use marquetry_format::cluster::{MAX_CLUSTER_TRIANGLES, MAX_CLUSTER_VERTICES};

/// A sheet is ragged if it has fewer triangles than so many for each of its boundary loops.
///
/// A loop takes about one region, four charts: below, these have hardly more triangles than the clusters of the sheet itself.
const TRIANGLES_A_LOOP: usize = 250;

/// A mesh without its small components, and these.
#[derive(Debug, Default)]
pub struct Selection {
    /// The surface that is to have charts; may be without triangles.
    pub rest: ManifoldMesh,
    /// All small components; may be without triangles.
    pub small: ManifoldMesh,
    /// Triangles of `small`, component by component, in order of first occurrence.
    pub components: Vec<Vec<u32>>,
}

/// The components of a mesh.
struct Components {
    /// Component of every triangle.
    of: Vec<u32>,
    /// Triangles and vertices of every component.
    sizes: Vec<[usize; 2]>,
}

impl Components {
    fn of(mesh: &ManifoldMesh) -> Self {
        let origins = mesh.origin.iter().map(|&o| o as usize + 1).max();
        let mut sets = UnionFind::new(origins.unwrap_or(0));
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.origin[v as usize]);
            sets.union(a, b);
            sets.union(a, c);
        }
        let first = |t: &[u32; 3]| mesh.origin[t[0] as usize];
        let (of, count) = label(&mut sets, mesh.triangles.iter().map(first));
        let sizes = sizes(mesh, &of, count as usize);
        Self { of, sizes }
    }

    /// The sheets of those components that are not `whole`, and all others as they are.
    fn of_sheets(&self, mesh: &ManifoldMesh, is_whole: &[bool]) -> Self {
        let (sheet_of, sheets) = mesh.components();
        let first = id(self.sizes.len());
        let part = |(&component, sheet): (&u32, u32)| {
            if is_whole[component as usize] {
                component
            } else {
                first + sheet
            }
        };
        let of: Vec<u32> = self.of.iter().zip(sheet_of).map(part).collect();
        let sizes = sizes(mesh, &of, self.sizes.len() + sheets as usize);
        Self { of, sizes }
    }

    /// Which parts are small, or ragged. `loops` has a half-edge of every boundary loop.
    fn for_clusters(&self, loops: &[u32]) -> Vec<bool> {
        let mut loop_count = vec![0; self.sizes.len()];
        for &h in loops {
            loop_count[self.of[h as usize / 3] as usize] += 1;
        }
        let wanted = |(&[t, v], loops): (&[usize; 2], usize)| {
            let is_small = t <= MAX_CLUSTER_TRIANGLES && v <= MAX_CLUSTER_VERTICES;
            let is_ragged = t < TRIANGLES_A_LOOP * loops && t.max(v) <= leaf::MOST_TRIANGLES;
            t > 0 && (is_small || is_ragged)
        };
        self.sizes.iter().zip(loop_count).map(wanted).collect()
    }

    /// Lists of the triangles of the `wanted` components, numbered as if there were no others, from `first` on.
    fn lists(&self, wanted: &[bool], first: u32) -> Vec<Vec<u32>> {
        let mut lists: Vec<Vec<u32>> = Vec::new();
        let mut place = vec![NONE; self.sizes.len()];
        let chosen = self.of.iter().filter(|&&c| wanted[c as usize]);
        for (next, &component) in (first..).zip(chosen) {
            let slot = &mut place[component as usize];
            if *slot == NONE {
                *slot = id(lists.len());
                lists.push(Vec::new());
            }
            lists[*slot as usize].push(next);
        }
        lists
    }
}

/// Triangles and vertices of each of `count` parts; no vertex is in two.
fn sizes(mesh: &ManifoldMesh, of: &[u32], count: usize) -> Vec<[usize; 2]> {
    let mut sizes = vec![[0usize; 2]; count];
    let mut is_counted = vec![false; mesh.positions.len()];
    for (t, &part) in mesh.triangles.iter().zip(of) {
        let size = &mut sizes[part as usize];
        size[0] += 1;
        for &v in t {
            let is_new = !std::mem::replace(&mut is_counted[v as usize], true);
            size[1] += usize::from(is_new);
        }
    }
    sizes
}

/// Takes the small components, and small and ragged sheets of others, out of `mesh`. Every triangle is in one part or the other.
pub fn select(mesh: ManifoldMesh) -> Selection {
    let components = Components::of(&mesh);
    let loops = mesh.boundary_loops();
    let is_whole = components.for_clusters(&loops);
    let components = components.of_sheets(&mesh, &is_whole);
    let is_small = components.for_clusters(&loops);
    if !is_small.contains(&true) {
        return Selection {
            rest: mesh,
            ..Selection::default()
        };
    }
    let goes = |t: usize| is_small[components.of[t] as usize];
    Selection {
        rest: part(&mesh, |t| !goes(t)),
        small: part(&mesh, goes),
        components: components.lists(&is_small, 0),
    }
}

/// No part: a triangle that is left out.
pub const DROPPED: u32 = NONE - 1;

impl Selection {
    /// Whether [`Self::take_all`] would.
    pub fn can_take_all(&self) -> bool {
        let fits = |&[t, v]: &[usize; 2]| t <= leaf::MOST_TRIANGLES && v <= leaf::MOST_TRIANGLES;
        Components::of(&self.rest).sizes.iter().all(fits)
    }

    /// Counts the rest among the small components, where [`Self::can_take_all`]; without its triangles from number `source` on, which
    /// are caps.
    pub fn take_all(&mut self, source: usize) {
        let of = Components::of(&self.rest).of;
        self.take(|t| if t < source { of[t] } else { DROPPED });
    }

    /// Counts parts of the rest among the small components: `of` says of every triangle which part it goes to, counted
    /// from 0, whether it stays ([`NONE`]), or is to be in neither ([`DROPPED`]).
    pub fn take(&mut self, of: impl Fn(usize) -> u32) {
        let goes = |t: usize| of(t) != NONE && of(t) != DROPPED;
        let taken = (0..self.rest.triangles.len()).filter(|&t| goes(t));
        let mut lists: Vec<Vec<u32>> = Vec::new();
        for (number, t) in (id(self.small.triangles.len())..).zip(taken) {
            let part = of(t) as usize;
            lists.resize_with(lists.len().max(part + 1), Vec::new);
            lists[part].push(number);
        }
        lists.retain(|list| !list.is_empty());
        self.components.extend(lists);
        let moved = part(&self.rest, goes);
        self.rest = part(&self.rest, |t| of(t) == NONE);
        let small = &mut self.small;
        let vertices = id(small.positions.len());
        let origins = small.origin.iter().map(|&o| o + 1).max().unwrap_or(0);
        let corners = |t: &[u32; 3]| t.map(|v| vertices + v);
        small.triangles.extend(moved.triangles.iter().map(corners));
        small
            .origin
            .extend(moved.origin.iter().map(|&o| origins + o));
        small.positions.extend(moved.positions);
        small.normals.extend(moved.normals);
        small.colours.extend(moved.colours);
        // Who is beside whom means nothing to clusters.
        small.twins = Vec::new();
    }
}

/// Positions and triangles of both parts.
pub fn joined(rest: ManifoldMesh, small: &ManifoldMesh) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let ManifoldMesh {
        mut positions,
        mut triangles,
        ..
    } = rest;
    let first = id(positions.len());
    positions.extend(&small.positions);
    triangles.extend(small.triangles.iter().map(|t| t.map(|v| v + first)));
    (positions, triangles)
}

/// The triangles of `mesh` that are `kept`, and their vertices.
fn part(mesh: &ManifoldMesh, kept: impl Fn(usize) -> bool) -> ManifoldMesh {
    let mut rest = ManifoldMesh::default();
    let mut vertex = vec![NONE; mesh.positions.len()];
    let mut triangle = vec![NONE; mesh.triangles.len()];
    // Origins are numbered anew, so that they stay below the number of vertices.
    let mut origin = vec![
        NONE;
        mesh.origin
            .iter()
            .map(|&o| o as usize + 1)
            .max()
            .unwrap_or(0)
    ];
    let mut origins = 0;
    for (t, corners) in mesh.triangles.iter().enumerate().filter(|&(t, _)| kept(t)) {
        triangle[t] = id(rest.triangles.len());
        rest.triangles.push(corners.map(|v| {
            let slot = &mut vertex[v as usize];
            if *slot == NONE {
                *slot = id(rest.positions.len());
                rest.positions.push(mesh.positions[v as usize]);
                let number = &mut origin[mesh.origin[v as usize] as usize];
                if *number == NONE {
                    *number = origins;
                    origins += 1;
                }
                rest.origin.push(*number);
                rest.normals.push(mesh.normals[v as usize]);
                rest.colours.extend(mesh.colours.get(v as usize));
            }
            *slot
        }));
    }
    for (twins, _) in mesh
        .twins
        .chunks_exact(3)
        .zip(&triangle)
        .filter(|&(_, &t)| t != NONE)
    {
        rest.twins.extend(twins.iter().map(|&twin| match twin {
            NONE => NONE,
            twin if triangle[twin as usize / 3] == NONE => NONE,
            twin => 3 * triangle[twin as usize / 3] + twin % 3,
        }));
    }
    let apexes = mesh.cap_apexes.iter().map(|&v| vertex[v as usize]);
    rest.cap_apexes = apexes.filter(|&v| v != NONE).collect();
    rest.cap_apexes.sort_unstable();
    rest
}
