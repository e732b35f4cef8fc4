//! A closed surface on which as many charts as one likes meet in a corner.
//!
//! It is a trapezohedron: two rings of kites, `half` of them around either pole, so corners have three charts or `half`. Every chart lies on
//! its kite in one of eight ways. Corners of kites have coordinates of twelve bits, so what is between them is exact, and the same from
//! both sides of a border.

use super::Random;
use glam::DVec3;
use marquetry_format::{ChartId, Glue, Side};
use std::f64::consts::PI;

/// Bits of a coordinate after the point.
const GRID: f64 = 4096.0;

/// The surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crown {
    /// Charts around a pole, 3 or more.
    pub half: u32,
    /// Decides how charts lie.
    pub seed: u64,
    /// Whether some lie with their back out; such surfaces have no orientation that all charts share.
    pub mirrors: bool,
}

impl Crown {
    pub(super) fn chart_count(self) -> u32 {
        2 * self.half
    }

    /// The corners of a chart, by number: 0 and 1 are the poles.
    fn corners(self, chart: u32) -> [u32; 4] {
        let ring = |k: u32| 2 + k % (2 * self.half);
        let i = 2 * (chart / 2);
        let kite = if chart.is_multiple_of(2) {
            [0, ring(i), ring(i + 1), ring(i + 2)]
        } else {
            [1, ring(i + 3), ring(i + 2), ring(i + 1)]
        };
        let mut random = Random::new(self.seed ^ u64::from(chart) << 32);
        random.next_u64();
        let turn = random.below(4);
        let is_mirrored = self.mirrors && random.below(2) == 1;
        [0, 1, 2, 3].map(|k| {
            let step = if is_mirrored { 4 - k } else { k };
            kite[((turn + step) % 4) as usize]
        })
    }

    fn place(self, corner: u32) -> DVec3 {
        let exact = |p: DVec3| (p * GRID).round() / GRID;
        match corner {
            0 => exact(DVec3::new(0.0, 0.0, 0.9)),
            1 => exact(DVec3::new(0.0, 0.0, -0.9)),
            n => {
                let (sin, cos) = (PI * f64::from(n) / f64::from(self.half)).sin_cos();
                let height = if n.is_multiple_of(2) { 0.15 } else { -0.15 };
                exact(DVec3::new(0.8 * cos, 0.8 * sin, height))
            }
        }
    }

    /// Position and outward direction at (u, v) of a chart.
    pub(super) fn at(self, chart: u32, u: f64, v: f64) -> (DVec3, DVec3) {
        let [a, b, c, d] = self.corners(chart).map(|corner| self.place(corner));
        let position =
            a * ((1.0 - u) * (1.0 - v)) + b * (u * (1.0 - v)) + c * (u * v) + d * ((1.0 - u) * v);
        (position, position.normalize_or_zero())
    }

    pub(super) fn glue(self, chart: u32, side: u8) -> Option<Glue> {
        let ends = |chart: u32, side: u8| {
            let corners = self.corners(chart);
            [corners[side as usize % 4], corners[(side as usize + 1) % 4]]
        };
        let own = ends(chart, side);
        let sides = (0..self.chart_count()).flat_map(|chart| (0..4).map(move |side| (chart, side)));
        sides
            .filter(|&other| other != (chart, side))
            .find_map(|(other, other_side)| {
                let theirs = ends(other, other_side);
                let is_same = theirs == own || [theirs[1], theirs[0]] == own;
                is_same.then_some(Glue {
                    chart: ChartId(other),
                    side: Side(other_side),
                    reversed: theirs != own,
                })
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::animate::Drawn;
    use crate::lod::balance;
    use crate::lod::cut::Cut;
    use crate::lod::mesh::{Mesh, extract_mesh, extract_mesh_in_motion};
    use crate::lod::residency::restrict;
    use crate::testing::{Shape, random_cut, random_finest, random_rest};
    use std::collections::{BTreeMap, BTreeSet};

    fn crowns() -> impl Iterator<Item = Crown> {
        (3..=10).flat_map(|half| {
            [false, true].map(|mirrors| Crown {
                half,
                seed: u64::from(half),
                mirrors,
            })
        })
    }

    /// Edges that an odd number of triangles have.
    fn odd_edges(mesh: &Mesh) -> usize {
        let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for [a, b, c] in &mesh.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry((from.min(to), from.max(to))).or_default() += 1;
            }
        }
        edges.values().filter(|&&count| count % 2 == 1).count()
    }

    #[test]
    fn charts_are_glued_in_all_eight_ways_and_meet_by_three_to_ten() {
        let (mut ways, mut counts) = (BTreeSet::new(), BTreeSet::new());
        for crown in crowns() {
            let mut around = BTreeMap::<u32, usize>::new();
            for chart in 0..crown.chart_count() {
                for corner in crown.corners(chart) {
                    *around.entry(corner).or_default() += 1;
                }
                for side in 0..4 {
                    let glue = crown.glue(chart, side).unwrap();
                    ways.insert(((4 + glue.side.0 - side) % 4, glue.reversed));
                }
            }
            counts.extend(around.into_values());
        }
        assert_eq!(ways.len(), 8, "{ways:?}");
        assert_eq!(counts, (3..=10).collect());
    }

    #[test]
    fn corners_of_three_to_ten_charts_are_closed_at_mixed_levels_and_in_motion() {
        let mut random = Random::new(17);
        let mut mixed = 0;
        for crown in crowns() {
            let shape = Shape::Crown(crown);
            let charts = shape.charts(5);
            let finest = random_finest(&mut random, &charts, 2, 3);
            let (document, source) = shape.open(&finest).unwrap();
            let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
            for _ in 0..6 {
                let mut wanted = random_cut(&mut random, &charts, 2);
                balance::coarsen(&mut wanted, &charts);
                let mut pages = random.clone();
                let cut = restrict(&wanted, &document, |_| pages.below(4) > 0);
                random.next_u64();
                let resolutions: BTreeSet<u8> = cut
                    .leaves()
                    .iter()
                    .map(|leaf| leaf.resolution + leaf.node.level)
                    .collect();
                mixed += usize::from(resolutions.len() > 1);
                let mesh = extract_mesh(&document, &source, &cut).unwrap();
                assert_eq!(odd_edges(&mesh), 0, "{crown:?}");
                let target = random_rest(&mut random, &charts, cut);
                for _ in 0..3 {
                    drawn.advance(&target, &charts, 0.37);
                    let mesh = extract_mesh_in_motion(&document, &source, &drawn).unwrap();
                    assert_eq!(odd_edges(&mesh), 0, "{crown:?}, in motion");
                }
            }
            let verified = marquetry_format::verify::verify(&source).unwrap();
            assert!(verified.ok, "{crown:?}: {verified:?}");
        }
        assert!(mixed > 60, "{mixed} cuts of mixed levels");
    }
}
