//! From a place in the picture to a point of the model, and back.

use super::Viewer;
use crate::Camera;
use crate::camera::{Ray, View, lattice_from_world, world_from_lattice};
use crate::lod::edge_morph::{Morphs, side_modes};
use crate::lod::mesh::{Patch, base_of};
use crate::lod::{Leaf, cluster};
use crate::pick::{Hit, Part, Pick, Surface, nearest};
use glam::{DVec2, DVec3};
use marquetry_format::Bounds;

/// Part of its distance that a point may lie behind the surface and still count as on it.
const ON_SURFACE: f64 = 2e-3;

impl Viewer {
    /// The point of the drawn surface at `position_px` (physical pixels from the upper left corner); `None` on the background.
    ///
    /// Exact for the finest that is drawn there: what more detail would change is at most [`Pick::error`].
    pub fn pick(&self, position_px: [f64; 2]) -> Option<Pick> {
        self.pick_from(&self.camera, DVec2::from_array(position_px))
    }

    pub(super) fn pick_from(&self, camera: &Camera, position_px: DVec2) -> Option<Pick> {
        let metadata = &self.document.metadata;
        let ray = View::new(camera, metadata, self.viewport).ray(position_px)?;
        let hit = self.hit(&ray)?;
        let point = ray.origin + hit.depth * ray.direction;
        Some(Pick {
            world: world_from_lattice(&metadata.lattice, point),
            normal: hit.normal,
            error: f64::from(self.error_of(hit.part)) * metadata.lattice.step,
            node: match hit.part {
                Part::Leaf(leaf) => Some(leaf.node),
                Part::Cluster(_) => None,
            },
        })
    }

    /// Where a world position is in the picture: pixels from the upper left corner, and its distance along the direction
    /// of view, world length. `None` behind the eye.
    pub fn project(&self, world: DVec3) -> Option<[f64; 3]> {
        let metadata = &self.document.metadata;
        let view = View::new(&self.camera, metadata, self.viewport);
        let (place, depth) = view.project(lattice_from_world(&metadata.lattice, world))?;
        Some([place.x, place.y, depth * metadata.lattice.step])
    }

    /// Whether nothing drawn lies between the eye and `world`, a point on the surface or outside it.
    pub fn is_in_sight(&self, world: DVec3) -> bool {
        let metadata = &self.document.metadata;
        let view = View::new(&self.camera, metadata, self.viewport);
        let point = lattice_from_world(&metadata.lattice, world);
        if self.section().is_some_and(|half| !half.contains(point)) {
            return false;
        }
        let Some((_, depth)) = view.project(point) else {
            return false;
        };
        let Some(ray) = view.ray(DVec2::ZERO) else {
            return false;
        };
        let ray = Ray {
            direction: (point - ray.origin) / depth,
            ..ray
        };
        self.hit(&ray).is_none_or(|hit| {
            hit.depth >= depth * (1.0 - ON_SURFACE) - 2.0 * f64::from(self.error_of(hit.part))
        })
    }

    fn hit(&self, ray: &Ray) -> Option<Hit> {
        let document = &self.document;
        let at_rest = Morphs::new();
        let section = self.section();
        let leaves = self.drawn.cut.leaves().into_iter().filter_map(|leaf| {
            let bounds = self.forest.bounds(document, leaf.node)?;
            Some((Part::Leaf(leaf), self.grown(&bounds, leaf)))
        });
        let clusters = cluster::drawn(document, &self.drawn.cut)
            .into_iter()
            .filter_map(|id| {
                let node = document.clusters.as_ref()?.node(id)?;
                Some((Part::Cluster(id), node.bounds))
            });
        let surface = |part: Part| match part {
            Part::Leaf(leaf) => self.patch_of(leaf, &at_rest).map(Surface::Patch),
            Part::Cluster(id) => {
                let mesh = self.table.cluster_mesh(document.page_of_cluster(id))?;
                Some(Surface::Cluster(mesh))
            }
        };
        nearest(ray, leaves.chain(clusters), surface, |point| {
            section.is_none_or(|half| half.contains(point))
        })
    }

    fn patch_of(&self, leaf: Leaf, at_rest: &Morphs) -> Option<Patch<'_>> {
        let document = &self.document;
        let base = base_of(document, leaf.node.chart)?;
        let samples = if leaf.node.level == 0 && leaf.resolution <= base.resolution {
            base
        } else {
            self.table.samples(document.page_of_node(leaf.node)?)?
        };
        Some(Patch {
            leaf,
            samples,
            morph: 0.0,
            sides: side_modes(&self.drawn.cut, at_rest, &document.charts, leaf),
        })
    }

    /// Sides that snap to a coarser neighbour may leave the leaf's own bounds, by no more than its error.
    fn grown(&self, bounds: &Bounds, leaf: Leaf) -> Bounds {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates"
        )]
        let slack = self.error_of(Part::Leaf(leaf)).ceil() as u32;
        Bounds {
            min: bounds.min.map(|c| c.saturating_sub(slack)),
            max: bounds.max.map(|c| c.saturating_add(slack)),
        }
    }

    /// Geometric error of what is drawn, lattice units.
    fn error_of(&self, part: Part) -> f32 {
        let leaf = match part {
            Part::Leaf(leaf) => leaf,
            Part::Cluster(id) => {
                let tree = self.document.clusters.as_ref();
                return tree
                    .and_then(|tree| tree.node(id))
                    .map_or(0.0, |node| node.error);
            }
        };
        let page = self
            .document
            .page_of_node(leaf.node)
            .and_then(|page| self.document.page(page));
        let chart = usize::try_from(leaf.node.chart.0)
            .ok()
            .and_then(|index| self.document.charts.get(index));
        let errors = match (page, chart) {
            (Some(page), _) => page.errors.as_slice(),
            (None, Some(chart)) => chart.base_errors.as_slice(),
            (None, None) => &[],
        };
        let own = (leaf.node.level == 0).then(|| errors.get(usize::from(leaf.resolution)));
        own.flatten().or(errors.last()).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Network, VIEWPORT};
    use crate::lod::mesh::extract_mesh;
    use crate::pick::meet;
    use crate::testing::{Random, Shape, clustered};
    use crate::{Camera, Section, ViewerOptions};
    use glam::{DVec2, DVec3};

    /// The nearest of all triangles of the drawn cut.
    fn brute_force(network: &Network, viewer: &super::Viewer, place: [f64; 2]) -> Option<DVec3> {
        let document = &viewer.document;
        let mesh = extract_mesh(document, &network.file, &viewer.drawn.cut).unwrap();
        let view = super::View::new(&viewer.camera, &document.metadata, viewer.viewport);
        let ray = view.ray(DVec2::from_array(place)).unwrap();
        let section = viewer.section();
        let mut best = f64::INFINITY;
        for triangle in &mesh.triangles {
            let corners = triangle.map(|n| mesh.positions[n as usize] - ray.origin);
            if let Some((depth, _)) = meet(ray.direction, corners)
                && depth >= ray.near
                && section.is_none_or(|half| half.contains(ray.origin + depth * ray.direction))
            {
                best = best.min(depth);
            }
        }
        best.is_finite().then(|| {
            let point = ray.origin + best * ray.direction;
            super::world_from_lattice(&document.metadata.lattice, point)
        })
    }

    #[test]
    fn picks_are_those_of_all_triangles_in_any_cache_state() {
        let mut random = Random::new(41);
        for (shape, seed) in [(Shape::Cube, 42), (Shape::Torus, 43), (Shape::Strip, 44)] {
            let mut network = Network::new(shape, seed);
            for state in 0..3u32 {
                let mut viewer = network.viewer(ViewerOptions {
                    section: (state == 2).then_some(Section::Axis {
                        axis: 2,
                        part: 0.6,
                        upper: false,
                    }),
                    ..ViewerOptions::default()
                });
                viewer.set_page_filter(Some(Box::new(move |page| page.0 % 5 != state)));
                let metadata = viewer.document.metadata.clone();
                viewer.set_camera(Camera::standard(&metadata, 18 + state as usize, 1.4).unwrap());
                network.open.clear();
                network.settle(&mut viewer);
                let (mut hits, mut hidden) = (0, 0);
                for _ in 0..40 {
                    let place = [
                        f64::from(VIEWPORT.width) * random.unit(),
                        f64::from(VIEWPORT.height) * random.unit(),
                    ];
                    let pick = viewer.pick(place);
                    let expected = brute_force(&network, &viewer, place);
                    assert_eq!(pick.is_some(), expected.is_some(), "{place:?}");
                    let (Some(pick), Some(expected)) = (pick, expected) else {
                        continue;
                    };
                    hits += 1;
                    assert!((pick.world - expected).length() < 1e-9);
                    assert!(pick.error > 0.0 && pick.normal.is_normalized());
                    let node = pick.node.unwrap();
                    assert!(viewer.drawn.cut.leaf_over(node).unwrap().node == node);
                    let [x, y, _] = viewer.project(pick.world).unwrap();
                    assert!((x - place[0]).hypot(y - place[1]) < 1e-3);
                    assert!(viewer.is_in_sight(pick.world));
                    let beyond = 0.05 * (pick.world - viewer.camera.eye);
                    if pick.error < 0.2 * beyond.length() {
                        assert!(!viewer.is_in_sight(pick.world + beyond));
                        hidden += 1;
                    }
                }
                assert!(hits > 5 && hidden > 0, "{hits} hits, {hidden} hidden");
            }
        }
    }

    #[test]
    fn no_ray_slips_through_a_seam() {
        let mut network = Network::new(Shape::Cube, 45);
        let mut viewer = network.viewer(ViewerOptions::default());
        network.settle(&mut viewer);
        let mesh = extract_mesh(&viewer.document, &network.file, &viewer.drawn.cut).unwrap();
        let lattice = viewer.document.metadata.lattice;
        // Straight at vertices and at the middles of edges, where four and more triangles meet.
        for triangle in mesh.triangles.iter().step_by(37) {
            let [a, b, c] =
                triangle.map(|n| super::world_from_lattice(&lattice, mesh.positions[n as usize]));
            let to_eye = (viewer.camera.eye - a).normalize_or_zero();
            if (b - a).cross(c - a).normalize_or_zero().dot(to_eye) < 0.2 {
                // At the outline a rounded ray may pass by.
                continue;
            }
            for world in [a, 0.5 * (a + b)] {
                let [x, y, _] = viewer.project(world).unwrap();
                assert!(viewer.pick([x, y]).is_some());
            }
        }
    }

    #[test]
    fn clusters_are_picked_like_leaves() {
        let mut network = Network::of(clustered(600).unwrap().1, 47);
        let mut viewer = network.viewer(ViewerOptions::default());
        network.settle(&mut viewer);
        let mut random = Random::new(48);
        let mut hits = 0;
        // The clusters cover little of the picture.
        for _ in 0..12_000 {
            let place = [
                f64::from(VIEWPORT.width) * random.unit(),
                f64::from(VIEWPORT.height) * random.unit(),
            ];
            let pick = viewer.pick(place);
            let expected = brute_force(&network, &viewer, place);
            assert_eq!(pick.is_some(), expected.is_some(), "{place:?}");
            if let (Some(pick), Some(expected)) = (pick, expected) {
                assert!((pick.world - expected).length() < 1e-9);
                hits += u32::from(pick.node.is_none());
            }
        }
        assert!(hits > 5, "only {hits} hits");
    }

    #[test]
    fn nothing_is_picked_on_the_background_or_nowhere() {
        let mut network = Network::new(Shape::Cube, 46);
        let mut viewer = network.viewer(ViewerOptions::default());
        assert!(viewer.pick([0.0, 0.0]).is_none());
        network.settle(&mut viewer);
        assert!(viewer.pick([1.0, 1.0]).is_none());
        assert!(viewer.pick([f64::NAN, 1.0]).is_none());
        assert!(viewer.pick([f64::INFINITY, 1.0]).is_none());
        assert!(viewer.project(DVec3::NAN).is_none());
    }
}
