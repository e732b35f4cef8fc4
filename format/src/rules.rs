//! The rules that hold between nodes: glue, borders, balance, errors. The writer enforces what `verify` checks.

use crate::{Glue, LatticePoint, NodeId, PageSamples, Side};

/// Most failures that a tally puts into words.
pub(crate) const MAX_FAILURES: usize = 20;

/// How often a rule was checked, and where it does not hold.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tally {
    pub(crate) count: u64,
    pub(crate) failures: Vec<String>,
}

impl Tally {
    /// Counts one check; `failure` is asked for only when it failed.
    pub(crate) fn check(&mut self, holds: bool, failure: impl FnOnce() -> String) {
        self.count = self.count.saturating_add(1);
        if !holds && self.failures.len() < MAX_FAILURES {
            self.failures.push(failure());
        }
    }

    /// Adds another tally of the same rule.
    pub(crate) fn merge(&mut self, other: Self) {
        self.count = self.count.saturating_add(other.count);
        let room = MAX_FAILURES.saturating_sub(self.failures.len());
        self.failures.extend(other.failures.into_iter().take(room));
    }
}

/// The quadtrees of all charts, by page id.
#[derive(Debug, Clone, Default)]
pub(crate) struct Topology {
    /// By chart.
    pub(crate) glue: Vec<[Option<Glue>; 4]>,
    pub(crate) nodes: Vec<NodeId>,
    pub(crate) first_children: Vec<Option<u32>>,
    pub(crate) resolutions: Vec<u8>,
}

/// A page found across a side.
struct Neighbour {
    page: u32,
    side: Side,
    reversed: bool,
    /// Whether it is a node of the same level, not a coarser one.
    same_level: bool,
}

fn at(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

impl Topology {
    fn find(&self, node: NodeId) -> Option<u32> {
        let mut page = node.chart.0;
        for level in (0..u32::from(node.level)).rev() {
            let quadrant = (node.x >> level & 1) | (node.y >> level & 1) << 1;
            page = (*self.first_children.get(at(page))?)?.checked_add(quadrant)?;
        }
        Some(page)
    }

    /// The page across `side` of `page`: of the same level, or the leaf that covers that place.
    fn neighbour(&self, page: u32, side: Side) -> Option<Neighbour> {
        let node = *self.nodes.get(at(page))?;
        let (mut node, side, reversed) = node.neighbour(side, self.glue.get(at(node.chart.0))?)?;
        let mut same_level = true;
        loop {
            if let Some(page) = self.find(node) {
                return Some(Neighbour {
                    page,
                    side,
                    reversed,
                    same_level,
                });
            }
            node = node.parent()?.0;
            same_level = false;
        }
    }

    fn node_name(&self, page: u32) -> String {
        self.nodes.get(at(page)).map_or_else(String::new, |node| {
            format!(
                "page {page} (chart {}, level {}, {}, {})",
                node.chart.0, node.level, node.x, node.y
            )
        })
    }

    fn pages(&self) -> impl Iterator<Item = (u32, Side)> {
        (0u32..)
            .zip(&self.nodes)
            .flat_map(|(page, _)| (0..4).map(move |side| (page, Side(side))))
    }

    fn resolution(&self, page: u32) -> u8 {
        self.resolutions.get(at(page)).copied().unwrap_or_default()
    }

    /// Finest drawable resolution of `page` as a resolution of its chart.
    fn finest(&self, page: u32) -> u8 {
        let level = self.nodes.get(at(page)).map_or(0, |node| node.level);
        level.saturating_add(self.resolution(page))
    }

    /// Every glued side is glued back.
    pub(crate) fn check_glue(&self) -> Tally {
        let mut tally = Tally::default();
        for (chart, glue) in (0u32..).zip(&self.glue) {
            for (side, glue) in (0u8..).zip(glue) {
                let Some(glue) = glue else { continue };
                let back = self
                    .glue
                    .get(at(glue.chart.0))
                    .and_then(|sides| sides.get(usize::from(glue.side.0)));
                let back = back.copied().flatten();
                let mutual = back.is_some_and(|back| {
                    back.chart.0 == chart && back.side.0 == side && back.reversed == glue.reversed
                });
                tally.check(mutual, || {
                    let (to, to_side) = (glue.chart.0, glue.side.0);
                    format!("side {side} of chart {chart} is glued to side {to_side} of chart {to}, which is not glued back")
                });
                let folded_onto_itself = glue.chart.0 == chart && glue.side.0 == side;
                tally.check(!folded_onto_itself || glue.reversed, || {
                    format!("side {side} of chart {chart} is glued to itself without turning")
                });
            }
        }
        tally
    }

    /// Along every shared border the finest drawable resolutions differ by at most one.
    pub(crate) fn check_balance(&self) -> Tally {
        let mut tally = Tally::default();
        for (page, side) in self.pages() {
            if self
                .first_children
                .get(at(page))
                .copied()
                .flatten()
                .is_some()
            {
                continue;
            }
            let Some(neighbour) = self.neighbour(page, side) else {
                continue;
            };
            // A neighbour with children is checked from its leaves.
            if self
                .first_children
                .get(at(neighbour.page))
                .copied()
                .flatten()
                .is_some()
            {
                continue;
            }
            let (own, other) = (self.finest(page), self.finest(neighbour.page));
            tally.check(own.abs_diff(other) <= 1, || {
                format!(
                    "{} reaches resolution {own}, {} across its side {} only {other}",
                    self.node_name(page),
                    self.node_name(neighbour.page),
                    side.0
                )
            });
        }
        tally
    }

    /// Both sides of every shared border hold equal samples, at the finest resolution both have.
    ///
    /// Coarser resolutions are subsets of the same samples, and coarser nodes are checked themselves.
    pub(crate) fn check_borders(&self, borders: &[Option<Border>]) -> Tally {
        let mut tally = Tally::default();
        let border = |page: u32| borders.get(at(page)).and_then(Option::as_ref);
        for (page, side) in self.pages() {
            let Some(other) = self.neighbour(page, side).filter(|other| other.same_level) else {
                continue;
            };
            if (other.page, other.side) < (page, side) {
                continue;
            }
            let (Some(own), Some(theirs)) = (border(page), border(other.page)) else {
                continue;
            };
            let resolution = self.resolution(page).min(self.resolution(other.page));
            let cells = 1usize << resolution;
            for t in 0..=cells {
                let a = own.sample(side, t, resolution);
                let b = theirs.sample(
                    other.side,
                    if other.reversed {
                        cells.saturating_sub(t)
                    } else {
                        t
                    },
                    resolution,
                );
                tally.check(a == b && a.is_some(), || {
                    format!(
                        "sample {t} of {cells} along side {} of {} differs from side {} of {}: {a:?} and {b:?}",
                        side.0,
                        self.node_name(page),
                        other.side.0,
                        self.node_name(other.page)
                    )
                });
            }
        }
        tally
    }

    /// Errors never grow from a resolution to the next or from a parent to its children.
    pub(crate) fn check_errors<'a>(&self, errors: impl Fn(u32) -> &'a [f32]) -> Tally {
        let mut tally = Tally::default();
        for (page, children) in (0u32..).zip(&self.first_children) {
            let own = errors(page);
            for (resolution, pair) in own.windows(2).enumerate() {
                tally.check(pair.is_sorted_by(|a, b| a >= b), || {
                    format!(
                        "the error of {} grows after resolution {resolution}: {pair:?}",
                        self.node_name(page)
                    )
                });
            }
            let (Some(first), Some(&last)) = (children, own.last()) else {
                continue;
            };
            for child in *first..first.saturating_add(4) {
                let fine = errors(child).first().copied();
                tally.check(fine.is_some_and(|fine| fine <= last), || {
                    format!(
                        "the error of {} is {fine:?}, above its parent's {last}",
                        self.node_name(child)
                    )
                });
            }
        }
        tally
    }
}

/// One sample of a border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BorderSample {
    position: LatticePoint,
    normal: [u8; 2],
    colour: Option<[u8; 3]>,
}

/// The samples along the four sides of a node, counter-clockwise.
#[derive(Debug, Clone, Default)]
pub(crate) struct Border {
    resolution: u8,
    sides: [Vec<BorderSample>; 4],
}

impl Border {
    /// The border of `samples`.
    pub(crate) fn new(samples: &PageSamples) -> Self {
        let last = samples.side().saturating_sub(1);
        let side = |at: &dyn Fn(usize) -> (usize, usize)| {
            let sample = |t| {
                let (i, j) = at(t);
                let index = j.checked_mul(samples.side())?.checked_add(i)?;
                Some(BorderSample {
                    position: *samples.positions.get(index)?,
                    normal: *samples.normals.get(index)?,
                    colour: samples.colours.get(index).copied(),
                })
            };
            (0..=last).filter_map(sample).collect()
        };
        let sides = [
            side(&|t| (t, 0)),
            side(&|t| (last, t)),
            side(&|t| (last.saturating_sub(t), last)),
            side(&|t| (0, last.saturating_sub(t))),
        ];
        Self {
            resolution: samples.resolution,
            sides,
        }
    }

    /// Sample `t` along `side` at `resolution`, which is not above the node's.
    fn sample(&self, side: Side, t: usize, resolution: u8) -> Option<BorderSample> {
        let steps = u32::from(self.resolution.checked_sub(resolution)?);
        self.sides
            .get(usize::from(side.0))?
            .get(t.checked_shl(steps)?)
            .copied()
    }
}

/// Smallest cosine between `axis` and the normals of all triangles of `samples`; `None` without any.
pub(crate) fn smallest_cosine(samples: &PageSamples, axis: [f32; 3]) -> Option<f64> {
    let side = samples.side();
    let axis = axis.map(f64::from);
    let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
    let mut smallest: Option<f64> = None;
    for (row, next) in samples
        .positions
        .chunks_exact(side)
        .zip(samples.positions.chunks_exact(side).skip(1))
    {
        for (low, high) in row.windows(2).zip(next.windows(2)) {
            let ([a, b], [d, c]) = (low, high) else {
                continue;
            };
            for triangle in [[a, b, c], [a, c, d]] {
                let Some(normal) = unit_normal(triangle) else {
                    continue;
                };
                let cosine = normal.iter().zip(axis).map(|(n, a)| n * a).sum::<f64>() / length;
                smallest = Some(smallest.map_or(cosine, |least| least.min(cosine)));
            }
        }
    }
    smallest
}

/// `None` for a triangle without area.
fn unit_normal([a, b, c]: [&LatticePoint; 3]) -> Option<[f64; 3]> {
    let [ax, ay, az] = a.map(f64::from);
    let edge = |[x, y, z]: [f64; 3]| [x - ax, y - ay, z - az];
    let ([ux, uy, uz], [vx, vy, vz]) = (edge(b.map(f64::from)), edge(c.map(f64::from)));
    // Exact: coordinates have 21 bits, products 42.
    let cross = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    let length = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length > 0.0).then(|| cross.map(|c| c / length))
}
