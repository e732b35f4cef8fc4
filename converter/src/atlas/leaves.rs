//! The leaves of all trees, and which of their samples are one.
//!
//! Samples at the same place of the surface, in neighbouring leaves of a chart or across glue, are one **point**; the corner
//! of many charts is one as well, since its samples are joined along the sides that meet there. On a border beside a
//! coarser leaf every other sample has no counterpart: it **hangs** half-way between its two neighbours, where the coarser
//! leaf's edge is.

use super::depth::Depth;
use glam::DVec3;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, Glue, NodeId, Quadrant, Side};
use std::collections::HashMap;

/// A leaf and its samples' place among those of all leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Leaf {
    /// The node.
    pub(crate) node: NodeId,
    /// log2 of its cells a side.
    pub(crate) grid: u8,
    /// Its first sample; the others follow row by row.
    pub(crate) first: usize,
}

impl Leaf {
    /// Cells a side.
    pub(crate) fn cells(self) -> usize {
        1 << self.grid
    }

    /// Its samples.
    pub(crate) fn range(self) -> std::ops::Range<usize> {
        self.first..self.first + (self.cells() + 1).pow(2)
    }

    /// Resolution of the chart that it is drawn at.
    fn resolution(self) -> u8 {
        self.node.level + self.grid
    }
}

/// The leaves by chart, quadrant by quadrant.
pub(crate) fn leaves_of(depth: &Depth) -> Vec<Leaf> {
    let mut leaves = Vec::with_capacity(depth.roots.len());
    let mut first = 0;
    for (chart, &resolution) in (0u32..).zip(&depth.roots) {
        let mut stack = vec![NodeId::root(ChartId(chart))];
        while let Some(node) = stack.pop() {
            if depth.nodes.contains(&node.child(Quadrant(0))) {
                stack.extend((0..4).rev().map(|q| node.child(Quadrant(q))));
                continue;
            }
            let grid = if node.level == 0 {
                resolution
            } else {
                PAGE_RESOLUTION
            };
            let leaf = Leaf { node, grid, first };
            first = leaf.range().end;
            leaves.push(leaf);
        }
    }
    leaves
}

/// The two points that a sample is the mean of; twice the same unless it hangs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Between(pub(crate) u32, pub(crate) u32);

impl Between {
    /// The value at the sample, given those at the points.
    pub(crate) fn of(self, values: &[DVec3]) -> DVec3 {
        let Self(a, b) = self;
        let one = values[a as usize];
        if a == b {
            one
        } else {
            0.5 * (one + values[b as usize])
        }
    }
}

/// Samples joined to points.
#[derive(Debug, Default)]
pub(crate) struct Points {
    /// By sample.
    pub(crate) of_sample: Vec<Between>,
    /// By point: whether it lies on an open border.
    pub(crate) open: Vec<bool>,
    /// By point: where its samples start in `samples`.
    starts: Vec<u32>,
    samples: Vec<u32>,
}

impl Points {
    /// Joins the samples of `leaves`.
    pub(crate) fn new(glue: &[[Option<Glue>; 4]], leaves: &[Leaf]) -> Self {
        let total = leaves.last().map_or(0, |leaf| leaf.range().end);
        let mut union = Union::new(total);
        let mut open = vec![false; total];
        let mut hanging: HashMap<u32, [u32; 2]> = HashMap::new();
        let by_node: HashMap<NodeId, Leaf> = leaves.iter().map(|&leaf| (leaf.node, leaf)).collect();
        for &leaf in leaves {
            for side in 0..4 {
                let across = Across::of(leaf, Side(side), glue, &by_node);
                for step in 0..=leaf.cells() {
                    let own = on_side(leaf, side, step);
                    match across {
                        Across::Open => open[own] = true,
                        Across::Finer => {}
                        Across::Beside(ref beside) => {
                            if let Some(other) = beside.sample(step) {
                                union.join(own, other);
                            } else {
                                let ends = [step - 1, step + 1].map(|k| on_side(leaf, side, k));
                                hanging.insert(index(own), ends.map(index));
                            }
                        }
                    }
                }
            }
        }
        let mut point = vec![u32::MAX; total];
        let mut count = 0;
        for sample in 0..total {
            let root = union.find(sample);
            if !hanging.contains_key(&index(sample)) && point[root] == u32::MAX {
                point[root] = count;
                count += 1;
            }
        }
        let mut point_of = |sample: u32| point[union.find(sample as usize)];
        let of_sample: Vec<Between> = (0..index(total))
            .map(|sample| match hanging.get(&sample) {
                Some(&[a, b]) => Between(point_of(a), point_of(b)),
                None => Between(point_of(sample), point_of(sample)),
            })
            .collect();
        let mut points = Self {
            open: vec![false; count as usize],
            of_sample,
            ..Self::default()
        };
        for (between, open) in points.of_sample.iter().zip(open) {
            if open {
                points.open[between.0 as usize] = true;
                points.open[between.1 as usize] = true;
            }
        }
        points.list_samples();
        points
    }

    fn list_samples(&mut self) {
        self.starts = vec![0; self.open.len() + 1];
        let entries = |between: &Between| {
            let second = (between.1 != between.0).then_some(between.1);
            [Some(between.0), second].into_iter().flatten()
        };
        for point in self.of_sample.iter().flat_map(entries) {
            self.starts[point as usize + 1] += 1;
        }
        for at in 1..self.starts.len() {
            self.starts[at] += self.starts[at - 1];
        }
        let mut next = self.starts.clone();
        self.samples = vec![0; self.starts.last().map_or(0, |&end| end as usize)];
        for (sample, between) in (0u32..).zip(&self.of_sample) {
            for point in entries(between) {
                self.samples[next[point as usize] as usize] = sample;
                next[point as usize] += 1;
            }
        }
    }

    /// The samples of a point, and what part of it each is: 1, or ½ for those that hang.
    pub(crate) fn samples(&self, point: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.starts[point] as usize..self.starts[point + 1] as usize;
        self.samples[range].iter().map(|&sample| {
            let Between(a, b) = self.of_sample[sample as usize];
            (sample as usize, if a == b { 1.0 } else { 0.5 })
        })
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.open.len()
    }
}

/// What a leaf meets at a side.
enum Across {
    Open,
    /// Leaves of a higher resolution, which see to it themselves.
    Finer,
    Beside(Beside),
}

/// A leaf of the same resolution or a lower one across a side.
struct Beside {
    leaf: Leaf,
    side: u8,
    reversed: bool,
    /// Steps of the own side from the start of the other leaf's.
    offset: u32,
    /// log2 of own steps a step of the other's.
    coarser: u8,
    /// Cells of the own side.
    cells: u32,
}

impl Across {
    fn of(
        leaf: Leaf,
        side: Side,
        glue: &[[Option<Glue>; 4]],
        by_node: &HashMap<NodeId, Leaf>,
    ) -> Self {
        let sides = &glue[leaf.node.chart.0 as usize];
        let Some((node, back, reversed)) = leaf.node.neighbour(side, sides) else {
            return Self::Open;
        };
        let mut over = node;
        let other = loop {
            if let Some(&other) = by_node.get(&over) {
                break other;
            }
            match over.parent() {
                Some((parent, _)) => over = parent,
                None => return Self::Finer,
            }
        };
        let Some(coarser) = leaf.resolution().checked_sub(other.resolution()) else {
            return Self::Finer;
        };
        // Where our counterpart lies along the covering leaf's side, in widths of our node.
        let down = node.level - other.node.level;
        let inside = |x: u32| x & ((1 << down) - 1);
        let (x, y) = (inside(node.x), inside(node.y));
        let last = (1u32 << down) - 1;
        let along = match back.0 {
            0 => x,
            1 => y,
            2 => last - x,
            _ => last - y,
        };
        let cells = 1u32 << leaf.grid;
        Self::Beside(Beside {
            leaf: other,
            side: back.0,
            reversed,
            offset: along * cells,
            coarser,
            cells,
        })
    }
}

impl Beside {
    /// The other leaf's sample at our `step`, if it has one there.
    fn sample(&self, step: usize) -> Option<usize> {
        let step = u32::try_from(step).unwrap_or(u32::MAX);
        let step = if self.reversed {
            self.cells - step
        } else {
            step
        };
        let along = self.offset + step;
        if along & ((1 << self.coarser) - 1) != 0 {
            return None;
        }
        Some(on_side(
            self.leaf,
            self.side,
            (along >> self.coarser) as usize,
        ))
    }
}

/// The sample `step` along a side, which runs counter-clockwise.
fn on_side(leaf: Leaf, side: u8, step: usize) -> usize {
    let cells = leaf.cells();
    let (i, j) = match side {
        0 => (step, 0),
        1 => (cells, step),
        2 => (cells - step, cells),
        _ => (0, cells - step),
    };
    leaf.first + j * (cells + 1) + i
}

fn index(sample: usize) -> u32 {
    u32::try_from(sample).unwrap_or(u32::MAX)
}

/// Disjoint sets; the lowest sample stands for its set.
struct Union(Vec<u32>);

impl Union {
    fn new(count: usize) -> Self {
        Self((0..index(count)).collect())
    }

    fn find(&mut self, mut sample: usize) -> usize {
        while self.0[sample] as usize != sample {
            let above = self.0[self.0[sample] as usize];
            self.0[sample] = above;
            sample = above as usize;
        }
        sample
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = index(a.min(b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[expect(clippy::unnecessary_wraps, reason = "sides may have none")]
    fn glued(chart: u32, side: u8) -> Option<Glue> {
        Some(Glue {
            chart: ChartId(chart),
            side: Side(side),
            reversed: true,
        })
    }

    /// Charts around a common corner 0: side 0 of each meets side 3 of the one before.
    fn fan(charts: u32) -> Vec<[Option<Glue>; 4]> {
        (0..charts)
            .map(|c| {
                [
                    glued((c + charts - 1) % charts, 3),
                    None,
                    None,
                    glued((c + 1) % charts, 0),
                ]
            })
            .collect()
    }

    fn points(glue: &[[Option<Glue>; 4]], depth: &Depth) -> (Vec<Leaf>, Points) {
        let leaves = leaves_of(depth);
        let points = Points::new(glue, &leaves);
        (leaves, points)
    }

    #[test]
    fn a_corner_of_five_charts_is_one_point() {
        let glue = fan(5);
        let depth = Depth {
            roots: vec![2, 3, 2, 2, 1],
            ..Depth::default()
        };
        let (leaves, points) = points(&glue, &depth);
        let corner = points.of_sample[leaves[0].first];
        assert_eq!(corner.0, corner.1);
        assert!(
            leaves
                .iter()
                .all(|leaf| points.of_sample[leaf.first] == corner)
        );
        // Samples that hang on it count by half, besides.
        let whole = points.samples(corner.0 as usize);
        assert_eq!(whole.filter(|&(_, part)| part > 0.9).count(), 5);
        assert!(!points.open[corner.0 as usize]);
        // The far end of each spoke is on the open border.
        assert!(points.open[points.of_sample[leaves[1].first + 8].0 as usize]);
    }

    #[test]
    fn a_chart_glued_to_itself_shares_its_own_side() {
        let glue = fan(1);
        let depth = Depth {
            roots: vec![3],
            ..Depth::default()
        };
        let (_, points) = points(&glue, &depth);
        for k in 0..9 {
            assert_eq!(points.of_sample[k], points.of_sample[9 * k]);
        }
        assert_eq!(points.len(), 81 - 8);
    }

    #[test]
    fn samples_beside_a_coarser_leaf_hang_between_its_own() {
        // Places on a strip of two charts tell whether what is joined lies together.
        let glue = [
            [None, glued(1, 3), None, None],
            [None, None, None, glued(0, 1)],
        ];
        let mut depth = Depth {
            roots: vec![5, 5],
            ..Depth::default()
        };
        let root = NodeId::root(ChartId(0));
        for q in (0..4).map(Quadrant) {
            depth.nodes.insert(root.child(q));
            depth.nodes.insert(root.child(Quadrant(2)).child(q));
        }
        depth.balance(&glue);
        let (leaves, points) = points(&glue, &depth);
        let mut places = vec![None; points.len()];
        let mut hanging = 0;
        for pass in 0..2 {
            for leaf in &leaves {
                let scale = 1.0 / f64::from(1u32 << leaf.node.level);
                for (k, sample) in leaf.range().enumerate() {
                    let side = leaf.cells() + 1;
                    let inside = [k % side, k / side].map(|k| k as f64 / leaf.cells() as f64);
                    let place = DVec3::new(
                        f64::from(leaf.node.chart.0) + (f64::from(leaf.node.x) + inside[0]) * scale,
                        (f64::from(leaf.node.y) + inside[1]) * scale,
                        0.0,
                    );
                    let between = points.of_sample[sample];
                    if between.0 == between.1 {
                        let known = places[between.0 as usize].get_or_insert(place);
                        assert_eq!(*known, place);
                    } else if pass == 1 {
                        let ends = [between.0, between.1].map(|p| places[p as usize].unwrap());
                        assert_eq!(0.5 * (ends[0] + ends[1]), place);
                        hanging += 1;
                    }
                }
            }
        }
        assert!(hanging > 0 && hanging % 16 == 0, "{hanging}");
        let mut distinct: Vec<[u64; 2]> = places
            .iter()
            .map(|p| p.unwrap().truncate().to_array().map(f64::to_bits))
            .collect();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), points.len());
    }
}
