//! The triangles of a cut, on the CPU: the reference of what the shaders draw, and what `export` and `measure` use.
//!
//! Vertices are welded by equal position, and triangles with two equal corners (the ones that rule R3 flattens) are
//! dropped. So a balanced cut of a closed atlas gives a closed mesh, whatever its resolutions and morphs.
//! Limit: samples that are different points of the surface but the same point of the lattice are welded too.

use super::animate::Drawn;
use super::cluster;
use super::cluster::target::Targets;
use super::cut::{Cut, Leaf};
use super::edge_morph::{SideMode, morph_of, side_modes};
use super::residency::needed_pages;
use crate::EngineError;
use glam::{DVec3, Vec3};
use marquetry_format::{
    ByteSource, ChartId, ClusterMesh, Document, PageId, PageSamples, octahedral,
};
use std::collections::HashMap;

/// A triangle mesh in lattice coordinates.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions, lattice units; whole numbers where nothing morphs.
    pub positions: Vec<DVec3>,
    /// Unit normals, one a position.
    pub normals: Vec<Vec3>,
    /// sRGB colours, one a position; empty when the file has none.
    pub colours: Vec<[u8; 3]>,
    /// Corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// One leaf, ready to be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Patch<'a> {
    /// The leaf.
    pub leaf: Leaf,
    /// Samples of its node, at its grid resolution or finer.
    pub samples: &'a PageSamples,
    /// How far it is on its way to the parent's surface.
    pub morph: f32,
    /// How its sides meet their neighbours.
    pub sides: [SideMode; 4],
}

/// A vertex as drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Position, lattice units.
    pub position: DVec3,
    /// Normal, not normalized.
    pub normal: Vec3,
    /// sRGB colour, 0..=255; white when the file has none.
    pub colour: Vec3,
}

impl Patch<'_> {
    /// Vertex (i, j) of the drawn grid; `None` outside it, or where the samples are too few.
    ///
    /// The shader's `patch_vertex` is the same function.
    pub fn vertex(&self, i: usize, j: usize) -> Option<Vertex> {
        let resolution = self.leaf.grid_resolution();
        let cells = 1usize << resolution;
        if i > cells || j > cells {
            return None;
        }
        let (i, j, morph) = self.place(i, j, cells);
        let stride = 1usize << self.samples.resolution.checked_sub(resolution)?;
        let index = (j * self.samples.side() + i) * stride;
        let odd = (i | j) & 1 == 1;
        // Even samples of a root stay: their target belongs to the resolution that introduced them.
        let attribute_morph = if odd || self.leaf.node.level > 0 {
            morph
        } else {
            0.0
        };
        let position_morph = if odd { morph } else { 0.0 };

        let samples = self.samples;
        let point = |points: &[[u32; 3]]| {
            points
                .get(index)
                .map(|point| DVec3::from_array(point.map(f64::from)))
        };
        let normal = |codes: &[[u8; 2]]| {
            codes
                .get(index)
                .map(|code| Vec3::from_array(octahedral::decode(*code)))
        };
        let colour = |colours: &[[u8; 3]]| {
            colours
                .get(index)
                .map(|colour| Vec3::from_array(colour.map(f32::from)))
        };
        let white = Vec3::splat(255.0);
        let (position, target) = (
            point(&samples.positions)?,
            point(&samples.position_targets)?,
        );
        let (own_normal, target_normal) =
            (normal(&samples.normals)?, normal(&samples.normal_targets)?);
        let own_colour = colour(&samples.colours).unwrap_or(white);
        let target_colour = colour(&samples.colour_targets).unwrap_or(white);
        Some(Vertex {
            position: position + (target - position) * f64::from(position_morph),
            normal: own_normal + (target_normal - own_normal) * attribute_morph,
            colour: own_colour + (target_colour - own_colour) * attribute_morph,
        })
    }

    /// Position of vertex (i, j) alone, lattice units: that of [`Patch::vertex`], where the samples have targets for what
    /// morphs; else the vertex at rest.
    pub fn position(&self, i: usize, j: usize) -> Option<DVec3> {
        let resolution = self.leaf.grid_resolution();
        let cells = 1usize << resolution;
        if i > cells || j > cells {
            return None;
        }
        let (i, j, morph) = self.place(i, j, cells);
        let stride = 1usize << self.samples.resolution.checked_sub(resolution)?;
        let index = (j * self.samples.side() + i) * stride;
        let point = |point: &[u32; 3]| DVec3::from_array(point.map(f64::from));
        let position = point(self.samples.positions.get(index)?);
        match self.samples.position_targets.get(index) {
            Some(target) if (i | j) & 1 == 1 => {
                Some(position + (point(target) - position) * f64::from(morph))
            }
            _ => Some(position),
        }
    }

    /// Which vertex stands in for (i, j), and its morph.
    fn place(&self, i: usize, j: usize, cells: usize) -> (usize, usize, f32) {
        let on = [j == 0, i == cells, j == cells, i == 0];
        let mut morph = None;
        let (mut to_i, mut to_j) = (i, j);
        for (side, mode) in self.sides.iter().enumerate().filter(|(side, _)| on[*side]) {
            let side_morph = match *mode {
                SideMode::Morph(morph) => morph,
                SideMode::Snap => {
                    if side % 2 == 0 {
                        to_i &= !1;
                    } else {
                        to_j &= !1;
                    }
                    1.0
                }
            };
            morph = Some(morph.map_or(side_morph, |other: f32| other.max(side_morph)));
        }
        // A grid of one cell has corners only.
        if cells == 1 {
            (i, j, 0.0)
        } else {
            (to_i, to_j, morph.unwrap_or(self.morph))
        }
    }
}

/// Puts patches together.
#[derive(Debug, Default)]
pub struct MeshBuilder {
    mesh: Mesh,
    vertices: HashMap<[u64; 3], u32>,
    coloured: bool,
}

impl MeshBuilder {
    /// An empty mesh, with colours or without.
    pub fn new(coloured: bool) -> Self {
        Self {
            coloured,
            ..Self::default()
        }
    }

    /// Adds the triangles of `patch`; `None` where its samples are too few.
    pub fn add(&mut self, patch: &Patch<'_>) -> Option<()> {
        let cells = 1usize << patch.leaf.grid_resolution();
        let side = cells + 1;
        let mut indices = Vec::with_capacity(side * side);
        for n in 0..side * side {
            indices.push(self.vertex(&patch.vertex(n % side, n / side)?)?);
        }
        for (j, i) in (0..cells).flat_map(|j| (0..cells).map(move |i| (j, i))) {
            let corner = |di: usize, dj: usize| indices[(j + dj) * side + i + di];
            let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
            for triangle in [[a, b, c], [a, c, d]] {
                if triangle[0] != triangle[1]
                    && triangle[1] != triangle[2]
                    && triangle[2] != triangle[0]
                {
                    self.mesh.triangles.push(triangle);
                }
            }
        }
        Some(())
    }

    /// Adds the triangles of a cluster, `morph` of the way to their targets (where there are none they stay); `None` where it names a vertex that it does not have.
    pub fn add_cluster(
        &mut self,
        cluster: &ClusterMesh,
        targets: &Targets,
        morph: f32,
    ) -> Option<()> {
        for corners in &cluster.triangles {
            let mut triangle = [0; 3];
            for (index, corner) in triangle.iter_mut().zip(corners) {
                let at = usize::from(*corner);
                let point = cluster.positions.get(at)?;
                let normal = cluster.normals.get(at)?;
                let colour = cluster.colours.get(at).copied().unwrap_or([255; 3]);
                let target = targets.positions.get(at).unwrap_or(point);
                let [own, target] = [point, target].map(|p| DVec3::from_array(p.map(f64::from)));
                let normals = [normal, targets.normals.get(at).unwrap_or(normal)]
                    .map(|code| Vec3::from_array(octahedral::decode(*code)));
                let colours = [colour, targets.colours.get(at).copied().unwrap_or(colour)]
                    .map(|rgb| Vec3::from_array(rgb.map(f32::from)));
                *index = self.vertex(&Vertex {
                    position: own + f64::from(morph) * (target - own),
                    normal: normals[0].lerp(normals[1], morph),
                    colour: colours[0].lerp(colours[1], morph),
                })?;
            }
            let [a, b, c] = triangle;
            if a != b && b != c && c != a {
                self.mesh.triangles.push(triangle);
            }
        }
        Some(())
    }

    /// The mesh.
    pub fn finish(self) -> Mesh {
        self.mesh
    }

    fn vertex(&mut self, vertex: &Vertex) -> Option<u32> {
        let key = vertex.position.to_array().map(f64::to_bits);
        if let Some(index) = self.vertices.get(&key) {
            return Some(*index);
        }
        let index = u32::try_from(self.mesh.positions.len()).ok()?;
        self.vertices.insert(key, index);
        self.mesh.positions.push(vertex.position);
        self.mesh.normals.push(vertex.normal.normalize_or(Vec3::Z));
        if self.coloured {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between two bytes"
            )]
            self.mesh
                .colours
                .push(vertex.colour.to_array().map(|c| c.round() as u8));
        }
        Some(index)
    }
}

/// The mesh of `cut` at rest. `cut` must be balanced for the mesh to have no cracks.
///
/// Holds the decoded pages of one chart at a time.
///
/// # Errors
/// [`EngineError::IndexIncomplete`], or when a page cannot be read or is not valid.
pub fn extract_mesh(
    document: &Document,
    source: &dyn ByteSource,
    cut: &Cut,
) -> Result<Mesh, EngineError> {
    extract_mesh_in_motion(document, source, &Drawn::of(cut.clone()))
}

/// The mesh of what is drawn, with leaves and clusters on their way to what they come from.
///
/// # Errors
/// As [`extract_mesh`].
pub fn extract_mesh_in_motion(
    document: &Document,
    source: &dyn ByteSource,
    drawn: &Drawn,
) -> Result<Mesh, EngineError> {
    let Drawn { cut, morphs, .. } = drawn;
    let mut builder = MeshBuilder::new(document.metadata.has_colours);
    let mut needed = needed_pages(cut, document).into_iter().peekable();
    let mut leaves = cut.leaves().into_iter().peekable();
    while let Some(chart) = leaves.peek().map(|leaf| leaf.node.chart) {
        let mut pages = HashMap::new();
        while let Some(page) = needed.next_if(|needed| needed.node.chart == chart) {
            let samples = decode(document, source, &pages, page)?;
            pages.insert(page.page, samples);
        }
        while let Some(leaf) = leaves.next_if(|leaf| leaf.node.chart == chart) {
            let page = document
                .page_of_node(leaf.node)
                .ok_or(EngineError::IndexIncomplete(chart.0))?;
            let samples = samples_of(document, leaf, |page| pages.get(&page));
            let samples = samples(page).ok_or(EngineError::IndexIncomplete(page.0))?;
            let patch = Patch {
                leaf,
                samples,
                morph: morph_of(morphs, leaf),
                sides: side_modes(cut, morphs, &document.charts, leaf),
            };
            builder
                .add(&patch)
                .ok_or(EngineError::IndexIncomplete(page.0))?;
        }
    }
    cluster::append(document, source, drawn, &mut builder)?;
    Ok(builder.finish())
}

/// Where the samples of `leaf` come from: the base as far as it goes, so that what is drawn does not depend on what else
/// is resident; else its page.
pub(crate) fn samples_of<'a>(
    document: &'a Document,
    leaf: Leaf,
    page: impl Fn(PageId) -> Option<&'a PageSamples>,
) -> impl Fn(PageId) -> Option<&'a PageSamples> {
    move |id| match base_of(document, leaf.node.chart) {
        Some(base) if leaf.node.level == 0 && leaf.resolution <= base.resolution => Some(base),
        _ => page(id),
    }
}

/// The base's samples of `chart`.
pub(crate) fn base_of(document: &Document, chart: ChartId) -> Option<&PageSamples> {
    document.base.get(usize::try_from(chart.0).ok()?)
}

fn decode(
    document: &Document,
    source: &dyn ByteSource,
    pages: &HashMap<PageId, PageSamples>,
    needed: super::residency::NeededPage,
) -> Result<PageSamples, EngineError> {
    let entry = document
        .page(needed.page)
        .ok_or(EngineError::IndexIncomplete(needed.page.0))?;
    let end = entry.offset.saturating_add(u64::from(entry.length));
    let bytes = source
        .read(entry.offset..end)
        .map_err(marquetry_format::Error::from)?;
    let Some((_, quadrant)) = needed.node.parent() else {
        return Ok(document.decode_root(needed.node.chart, &bytes)?);
    };
    let parent = match needed.parent {
        Some(parent) => pages.get(&parent),
        None => base_of(document, needed.node.chart),
    };
    let parent = parent.ok_or(EngineError::IndexIncomplete(needed.page.0))?;
    Ok(document.decode_child(needed.page, quadrant, parent, &bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::animate::Drawn;
    use crate::lod::balance;
    use crate::lod::residency::restrict;
    use crate::lod::uniform::{Fineness, uniform_cut};
    use crate::testing::{Random, Shape, random_cut, random_finest, random_rest};
    use std::collections::BTreeMap;

    /// Directed edges without their opposite.
    fn open_edges(mesh: &Mesh) -> usize {
        let mut edges: BTreeMap<(u32, u32), i64> = BTreeMap::new();
        for [a, b, c] in &mesh.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry((from.min(to), from.max(to))).or_default() +=
                    if from < to { 1 } else { -1 };
            }
        }
        edges.values().filter(|balance| **balance != 0).count()
    }

    fn volume(mesh: &Mesh) -> f64 {
        let corner = |index: u32| mesh.positions[index as usize];
        let signed = |t: &[u32; 3]| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0;
        mesh.triangles.iter().map(signed).sum()
    }

    #[test]
    fn closed_atlas_gives_a_closed_mesh_for_any_cut_and_residency() {
        let mut random = Random::new(5);
        for shape in [Shape::Cube, Shape::Torus] {
            let charts = shape.charts(5);
            let (document, source) = shape
                .open(&random_finest(&mut random, &charts, 2, 3))
                .unwrap();
            let finest = uniform_cut(&document, Fineness::Finest).unwrap();
            for _ in 0..12 {
                // A wish that goes beyond what the file has, and a cache that holds half of it.
                let mut wanted = random_cut(&mut random, &charts, 2);
                balance::coarsen(&mut wanted, &charts);
                let mut random_pages = random.clone();
                let cut = restrict(&wanted, &document, |_| random_pages.below(2) == 0);
                random.next_u64();
                assert!(balance::is_balanced(&cut, &charts));
                let mesh = extract_mesh(&document, &source, &cut).unwrap();
                assert_eq!(open_edges(&mesh), 0);
                // The torus has the same point in all corners, so its coarsest cuts are flat.
                assert!(shape == Shape::Torus || volume(&mesh) > 0.0);
            }
            assert_eq!(
                open_edges(&extract_mesh(&document, &source, &finest).unwrap()),
                0
            );
        }
    }

    #[test]
    fn closed_atlas_stays_closed_in_motion() {
        let mut random = Random::new(6);
        for shape in [Shape::Cube, Shape::Torus] {
            let charts = shape.charts(5);
            let (document, source) = shape
                .open(&random_finest(&mut random, &charts, 2, 3))
                .unwrap();
            let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
            for _ in 0..8 {
                let mut wanted = random_cut(&mut random, &charts, 2);
                balance::coarsen(&mut wanted, &charts);
                let target = restrict(&wanted, &document, |_| true);
                let target = random_rest(&mut random, &charts, target);
                for _ in 0..5 {
                    drawn.advance(&target, &charts, 0.37);
                    let mesh = extract_mesh_in_motion(&document, &source, &drawn).unwrap();
                    assert_eq!(open_edges(&mesh), 0);
                }
            }
        }
    }

    #[test]
    fn surface_at_morph_one_is_the_coarser_surface() {
        let charts = Shape::Strip.charts(4);
        let mut finest = Cut::coarsest(2);
        for chart in 0..2 {
            finest.set_root(ChartId(chart), 4);
        }
        let (document, source) = Shape::Strip.open(&finest).unwrap();
        let drawn = Drawn {
            morphs: finest
                .leaves()
                .iter()
                .map(|leaf| (leaf.node, 1.0))
                .collect(),
            cut: finest,
            group_morphs: Drawn::of(Cut::coarsest(0)).group_morphs,
        };
        let fine = extract_mesh_in_motion(&document, &source, &drawn).unwrap();
        let mut coarse = Cut::coarsest(2);
        for chart in 0..2 {
            coarse.set_root(ChartId(chart), 3);
        }
        let coarse = extract_mesh(&document, &source, &coarse).unwrap();
        assert_eq!(charts.len(), 2);
        // Every vertex is one of the coarse mesh, or the floor of the mean of two that share an edge there.
        let mut allowed: std::collections::BTreeSet<[i64; 3]> = std::collections::BTreeSet::new();
        #[expect(clippy::cast_possible_truncation, reason = "whole lattice coordinates")]
        let whole = |v: DVec3| v.floor().to_array().map(|c| c as i64);
        for triangle in &coarse.triangles {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let [a, b] = [a, b].map(|n: usize| coarse.positions[triangle[n] as usize]);
                allowed.extend([whole(a), whole(0.5 * (a + b))]);
            }
        }
        assert!(
            fine.positions
                .iter()
                .all(|position| allowed.contains(&whole(*position)))
        );
    }

    #[test]
    fn triangle_budget_is_kept_and_used() {
        let mut random = Random::new(9);
        let charts = Shape::Cube.charts(5);
        let (document, source) = Shape::Cube
            .open(&random_finest(&mut random, &charts, 2, 4))
            .unwrap();
        let finest = uniform_cut(&document, Fineness::Finest)
            .unwrap()
            .triangles();
        for budget in [1, 12, 200, 5_000, finest] {
            let cut = uniform_cut(&document, Fineness::Triangles(budget)).unwrap();
            assert!(cut.triangles() <= budget.max(12));
            assert!(
                extract_mesh(&document, &source, &cut)
                    .unwrap()
                    .triangles
                    .len() as u64
                    <= cut.triangles()
            );
        }
        assert_eq!(
            uniform_cut(&document, Fineness::Triangles(finest))
                .unwrap()
                .triangles(),
            finest
        );
    }
}
