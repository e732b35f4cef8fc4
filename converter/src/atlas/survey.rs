//! What every chart would cost and show at every depth, and the choice among depths.
//!
//! One depth for all charts wastes samples, and so does asking every chart to meet the target by itself: a flat chart pays
//! nothing for being better than asked. So depth is bought where a sample takes most off the sum of squared errors: for a
//! price λ of a sample every tree is pruned to its least cost (Breiman et al., "Classification and Regression Trees", 1984;
//! Chou, Lookabaugh, Gray, "Optimal pruning", 1989), and λ is the highest at which the whole surface meets its goal,
//! 2:1 balance included. Trees are grown only where a deeper node could pay at the present λ.
//!
//! The largest error is brought down after that, worst place first, within a budget of two thirds as many samples again: at creases that
//! no chart's side follows it halves only when a row of nodes is refined, which no other measure of error pays for.
//!
//! Limit: errors are estimates at points of the source, of samples that lie on it.

use super::build::Surface;
use super::depth::Depth;
use super::leaves::Leaf;
use crate::resample::{Sampler, Window};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::{ChartId, NodeId, Quadrant};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Deepest level that sampling goes to. At level 6 a chart has 2048² cells.
const DEEPEST_LEVEL: u8 = 6;
/// A node is refined until its largest distance is at most this many targets, while the budget for that lasts.
pub(crate) const MAX_OVER_TARGET: f64 = 10.0;
/// First, and with this part of that budget, where it is more than so many targets: all else would leave nothing for the places that
/// need many levels.
const FAR_OVER_TARGET: f64 = 25.0;
const FAR_PART: [u64; 2] = [3, 10];
/// So many samples may be spent on the largest error for so many that the mean one needs, and [`WORST_BUDGET`] in any case.
const WORST_PART: [u64; 2] = [2, 3];
const WORST_BUDGET: u64 = 16 * 1024;
/// Times that depth is chosen anew for what mending the largest error did to the mean one.
const PASSES: usize = 5;
/// Part of the goal, squared errors, above which choosing again gains little.
const ENOUGH: f64 = 0.85;
/// Factor that the goal of the mean error alone is raised by at most from one time to the next.
const MOST_RAISE: f64 = 2.0;
/// A node whose children leave more than this part of its squared error is not refined further: sampling does not catch
/// what is there.
const HOPELESS: f64 = 0.9;
/// A place whose RMS error is at most so many targets is good, also where the whole surface cannot be.
const GOOD: f64 = 0.3;
/// Triangles of a chart for each triangle of its image, on average, at the resolution that is tried first.
const FIRST_LOAD: usize = 4;
/// Rounds of growing trees at most; each goes one level deeper.
const ROUNDS: usize = 24;
/// Halvings of the interval of log λ.
const HALVINGS: u32 = 20;
/// No sample is bought for less than what one brings of which so many, for every triangle of the source and in any case,
/// would be needed.
const SAMPLES_A_TRIANGLE: usize = 32;
const SAMPLES_AT_LEAST: usize = 1 << 18;

/// Cells of a full page a side.
const CELLS: u32 = 1 << PAGE_RESOLUTION;

/// One depth of one place.
#[derive(Debug, Clone, Copy)]
struct Trial {
    /// Integral of the squared error, over area.
    squares: f64,
    /// Area of the source.
    area: f64,
    /// Largest error, the cutting of open borders' corners included.
    worst: f64,
    /// Whether more depth may show more.
    deeper: bool,
}

impl Trial {
    /// Whether more depth could take at least `price` off, and there is anything to be seen of it.
    fn pays(&self, price: f64, target: f64) -> bool {
        self.deeper && self.squares > price.max((GOOD * target).powi(2) * self.area)
    }
}

/// What is known of one chart.
#[derive(Debug, Default)]
struct Trials {
    /// Of the root, by resolution from 0.
    roots: Vec<Trial>,
    /// Below the root; siblings come together.
    nodes: BTreeMap<NodeId, Trial>,
}

/// Trials of all charts.
#[derive(Debug)]
pub(super) struct Survey<'a> {
    surface: &'a Surface<'a>,
    samplers: &'a [Sampler<'a>],
    trials: Vec<Trials>,
    /// Area of the source.
    pub(super) area: f64,
}

/// The window of a node at full resolution.
pub(super) fn window(node: NodeId) -> Window {
    Window {
        resolution: PAGE_RESOLUTION + node.level,
        x: node.x * CELLS,
        y: node.y * CELLS,
        cells: CELLS,
    }
}

/// The window of a leaf.
pub(crate) fn window_of(leaf: Leaf) -> Window {
    if leaf.node.level == 0 {
        Window::whole(leaf.grid)
    } else {
        window(leaf.node)
    }
}

fn root_of(chart: usize) -> NodeId {
    NodeId::root(ChartId(u32::try_from(chart).unwrap_or(u32::MAX)))
}

/// Samples of a grid, those it shares with neighbours counted once.
fn cost(resolution: u8) -> f64 {
    f64::from(1u32 << (2 * resolution))
}

impl<'a> Survey<'a> {
    /// Tries every chart's root as far as its triangles are dense.
    pub(super) fn new(
        surface: &'a Surface<'a>,
        samplers: &'a [Sampler<'a>],
        progress: &(dyn Fn() + Sync),
    ) -> Self {
        let tried: Vec<(Trials, f64)> = (0..samplers.len())
            .into_par_iter()
            .map(|chart| {
                let triangles = surface.patches[chart].triangles.len();
                let resolution = (3..PAGE_RESOLUTION)
                    .find(|&r| (2usize << (2 * r)) >= triangles / FIRST_LOAD)
                    .unwrap_or(PAGE_RESOLUTION);
                let mut trials = Trials::default();
                let area = try_root(surface, &samplers[chart], chart, resolution, &mut trials);
                progress();
                (trials, area)
            })
            .collect();
        let area = tried.iter().map(|(_, area)| area).sum();
        Self {
            surface,
            samplers,
            trials: tried.into_iter().map(|(trials, _)| trials).collect(),
            area,
        }
    }

    /// The cheapest balanced trees whose mean squared error is at most `goal`, as far as depth can bring it there, and what
    /// their mean squared error is.
    ///
    /// `None` where they have more than `most` samples.
    pub(super) fn choose(&mut self, goal: f64, most: u64) -> Option<(Depth, f64)> {
        let goal = goal * self.area;
        // Mending the largest error lowers the mean one too, which then needs less by itself.
        let mut mean_goal = goal;
        let (mut met, mut missed) = (goal, f64::INFINITY);
        let mut best = None;
        for _ in 0..PASSES {
            let mut depth = Depth::default();
            for _ in 0..ROUNDS {
                let price;
                (depth, price) = self.cheapest(mean_goal);
                // What is tried later may make others needless, but not many.
                if count(&depth) > most.saturating_mul(2) {
                    return None;
                }
                if !self.grow(&depth, price) {
                    break;
                }
            }
            let budget = count(&depth) * WORST_PART[0] / WORST_PART[1] + WORST_BUDGET;
            let far = budget * FAR_PART[0] / FAR_PART[1];
            let left = self.mend_worst(&mut depth, FAR_OVER_TARGET, far);
            self.mend_worst(&mut depth, MAX_OVER_TARGET, budget - far + left);
            let squares = self.squares(&depth);
            if best.is_some() && squares > goal {
                missed = mean_goal;
            } else {
                met = mean_goal;
                best = Some((depth, squares));
                if squares > ENOUGH * goal {
                    break;
                }
                mean_goal *= (goal / squares).min(MOST_RAISE);
            }
            if mean_goal >= missed {
                mean_goal = (met * missed).sqrt();
            }
        }
        let (depth, squares) = best.unwrap_or_default();
        (count(&depth) <= most).then(|| (depth, squares / self.area.max(f64::MIN_POSITIVE)))
    }

    /// The highest price of a sample at which the goal is met, and what is chosen at it; the lowest price if none does.
    fn cheapest(&self, goal: f64) -> (Depth, f64) {
        let squares: f64 = self
            .trials
            .iter()
            .filter_map(|trials| trials.roots.first())
            .map(|trial| trial.squares)
            .sum();
        // At the highest price no sample pays. Below the lowest the goal is out of reach: what is left is nothing that
        // depth mends.
        let triangles: usize = self
            .surface
            .patches
            .iter()
            .map(|patch| patch.triangles.len())
            .sum();
        let most = (SAMPLES_A_TRIANGLE * triangles + SAMPLES_AT_LEAST) as f64;
        let mut high = squares.max(f64::MIN_POSITIVE).log2();
        let mut low = (goal / most).max(f64::MIN_POSITIVE).log2().min(high);
        let mut best = self.pruned(low.exp2());
        if self.squares(&best) > goal {
            return (best, low.exp2());
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let depth = self.pruned(middle.exp2());
            if self.squares(&depth) > goal {
                high = middle;
            } else {
                low = middle;
                best = depth;
            }
        }
        (best, low.exp2())
    }

    /// The trees that cost least at a price, balanced.
    fn pruned(&self, price: f64) -> Depth {
        let chosen: Vec<(u8, Vec<NodeId>)> = self
            .trials
            .par_iter()
            .enumerate()
            .map(|(chart, trials)| trials.prune(root_of(chart), price))
            .collect();
        let mut depth = Depth {
            roots: chosen.iter().map(|&(resolution, _)| resolution).collect(),
            nodes: chosen.into_iter().flat_map(|(_, nodes)| nodes).collect(),
        };
        depth.balance(self.surface.glue);
        depth
    }

    /// Integral of the squared error of a choice; of depth that nobody tried, what is known above it.
    fn squares(&self, depth: &Depth) -> f64 {
        let mut sum = 0.0;
        for (chart, trials) in self.trials.iter().enumerate() {
            let resolution = usize::from(depth.roots[chart]).min(trials.roots.len() - 1);
            sum += trials.squares(root_of(chart), &trials.roots[resolution], &depth.nodes);
        }
        sum
    }

    /// Tries what is next below the leaves of `depth` wherever that could pay at `price`; whether anything was.
    fn grow(&mut self, depth: &Depth, price: f64) -> bool {
        let (surface, samplers) = (self.surface, self.samplers);
        let grown: Vec<bool> = self
            .trials
            .par_iter_mut()
            .enumerate()
            .map(|(chart, trials)| {
                let resolution = depth.roots[chart];
                let known = trials.roots.len() - 1;
                if known < usize::from(PAGE_RESOLUTION) {
                    // A root that balance took beyond what was tried is tried too.
                    let last = trials.roots[known];
                    let added = 3.0 * cost(u8::try_from(known).unwrap_or(u8::MAX));
                    let pays = last.pays(price * added, surface.target);
                    if usize::from(resolution) > known || (usize::from(resolution) == known && pays)
                    {
                        let next = u8::try_from(known + 1).unwrap_or(u8::MAX).max(resolution);
                        try_root(surface, &samplers[chart], chart, next, trials);
                        return true;
                    }
                    return false;
                }
                if resolution < PAGE_RESOLUTION {
                    return false;
                }
                let added = 3.0 * cost(PAGE_RESOLUTION);
                let pending: Vec<NodeId> = trials
                    .frontier(root_of(chart))
                    .filter(|&(node, trial)| {
                        node.parent().is_none_or(|_| depth.nodes.contains(&node))
                            && trial.pays(price * added, surface.target)
                    })
                    .map(|(node, _)| node)
                    .collect();
                for &node in &pending {
                    try_children(surface, &samplers[chart], node, trials);
                }
                !pending.is_empty()
            })
            .collect();
        grown.into_iter().any(|grown| grown)
    }

    /// Refines where the largest error is above so many targets, worst first, for at most `budget` samples. Returns what is left of it.
    fn mend_worst(&mut self, depth: &mut Depth, over_target: f64, mut budget: u64) -> u64 {
        let limit = over_target * self.surface.target;
        for _ in 0..ROUNDS {
            let mut bad: Vec<(f64, NodeId)> = Vec::new();
            for (chart, trials) in self.trials.iter().enumerate() {
                trials.leaves(root_of(chart), depth, &mut |node, trial| {
                    if trial.worst > limit && trial.deeper {
                        bad.push((trial.worst, node));
                    }
                });
            }
            bad.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let before = count(depth);
            let mut wanted = Vec::new();
            let mut spent = 0u64;
            for (_, node) in bad {
                let root = depth.roots[node.chart.0 as usize];
                spent += if node.level == 0 && root < PAGE_RESOLUTION {
                    3 << (2 * root)
                } else {
                    3 << (2 * PAGE_RESOLUTION)
                };
                // Balance may well double what is spent.
                if 2 * spent > budget {
                    break;
                }
                wanted.push(node);
            }
            if wanted.is_empty() {
                break;
            }
            for &node in &wanted {
                depth.refine(node);
            }
            depth.balance(self.surface.glue);
            budget = budget.saturating_sub(count(depth) - before);
            self.know(depth);
        }
        budget
    }

    /// Tries what `depth` holds and nobody has tried.
    fn know(&mut self, depth: &Depth) {
        let (surface, samplers) = (self.surface, self.samplers);
        self.trials
            .par_iter_mut()
            .enumerate()
            .for_each(|(chart, trials)| {
                let resolution = depth.roots[chart];
                if trials.roots.len() <= usize::from(resolution) {
                    try_root(surface, &samplers[chart], chart, resolution, trials);
                }
                let root = root_of(chart);
                let mut stack = vec![root];
                while let Some(node) = stack.pop() {
                    if !depth.nodes.contains(&node.child(Quadrant(0))) {
                        continue;
                    }
                    if !trials.nodes.contains_key(&node.child(Quadrant(0))) {
                        try_children(surface, &samplers[chart], node, trials);
                    }
                    stack.extend((0..4).map(|q| node.child(Quadrant(q))));
                }
            });
    }
}

/// Samples of a choice, those shared with neighbours counted once.
fn count(depth: &Depth) -> u64 {
    let roots: u64 = depth.roots.iter().map(|&r| 1u64 << (2 * r)).sum();
    roots + (depth.nodes.len() as u64) * u64::from(CELLS * CELLS) * 3 / 4
}

impl Trials {
    /// The cheapest resolution of the root, and nodes below it.
    fn prune(&self, root: NodeId, price: f64) -> (u8, Vec<NodeId>) {
        let mut best = (f64::INFINITY, 1);
        for (resolution, trial) in (0u8..).zip(&self.roots).skip(1) {
            let total = trial.squares + price * cost(resolution);
            if total < best.0 {
                best = (total, resolution);
            }
        }
        let mut nodes = Vec::new();
        if self.roots.len() > usize::from(PAGE_RESOLUTION) && !self.nodes.is_empty() {
            let below = self.prune_below(root, price, &mut nodes);
            if below < best.0 {
                return (PAGE_RESOLUTION, nodes);
            }
            nodes.clear();
        }
        (best.1, nodes)
    }

    /// The least cost of the children of `node`, and of what is below them, which is added to `nodes`.
    fn prune_below(&self, node: NodeId, price: f64, nodes: &mut Vec<NodeId>) -> f64 {
        let mut total = 0.0;
        for child in (0..4).map(|q| node.child(Quadrant(q))) {
            nodes.push(child);
            let mut least = self
                .nodes
                .get(&child)
                .map_or(0.0, |trial| trial.squares + price * cost(PAGE_RESOLUTION));
            if self.nodes.contains_key(&child.child(Quadrant(0))) {
                let kept = nodes.len();
                let below = self.prune_below(child, price, nodes);
                if below < least {
                    least = below;
                } else {
                    nodes.truncate(kept);
                }
            }
            total += least;
        }
        total
    }

    /// Squared error of `node`, whose own trial is `own`, as `chosen` draws it.
    fn squares(&self, node: NodeId, own: &Trial, chosen: &BTreeSet<NodeId>) -> f64 {
        let children = [0, 1, 2, 3].map(|q| node.child(Quadrant(q)));
        if !chosen.contains(&children[0]) || !self.nodes.contains_key(&children[0]) {
            return own.squares;
        }
        children
            .iter()
            .filter_map(|&child| Some(self.squares(child, self.nodes.get(&child)?, chosen)))
            .sum()
    }

    /// Nodes that were tried and whose children were not, and their trials.
    fn frontier(&self, root: NodeId) -> impl Iterator<Item = (NodeId, Trial)> {
        let last = self.roots.last().map(|&trial| (root, trial));
        last.into_iter()
            .chain(self.nodes.iter().map(|(&node, &trial)| (node, trial)))
            .filter(|(node, _)| !self.nodes.contains_key(&node.child(Quadrant(0))))
    }

    /// Calls `visit` with the leaves of `depth` that were tried.
    fn leaves(&self, root: NodeId, depth: &Depth, visit: &mut impl FnMut(NodeId, &Trial)) {
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            if depth.nodes.contains(&node.child(Quadrant(0))) {
                stack.extend((0..4).map(|q| node.child(Quadrant(q))));
            } else if node.level > 0 {
                if let Some(trial) = self.nodes.get(&node) {
                    visit(node, trial);
                }
            } else {
                let resolution = usize::from(depth.roots[root.chart.0 as usize]);
                if let Some(trial) = self.roots.get(resolution) {
                    visit(node, trial);
                }
            }
        }
    }
}

/// Tries the root at all resolutions up to one that have not been tried; the area of the chart.
fn try_root(
    surface: &Surface<'_>,
    sampler: &Sampler<'_>,
    chart: usize,
    resolution: u8,
    trials: &mut Trials,
) -> f64 {
    let window = Window::whole(resolution);
    let positions = sampler.positions(surface.borders, window);
    let fine = surface.target * f64::from(1u32 << resolution) >= extent(&positions);
    for known in &mut trials.roots {
        known.deeper = !fine;
    }
    let first = trials.roots.len();
    let count = (usize::from(resolution) + 1).saturating_sub(first);
    let estimates = sampler.estimates(window, &positions, count);
    trials
        .roots
        .extend((0u8..).skip(first).zip(&estimates).map(|(r, estimate)| {
            let border = surface.open_border_error(root_of(chart), r);
            Trial {
                squares: estimate.squares,
                area: estimate.area,
                worst: estimate.worst.max(border),
                deeper: !fine,
            }
        }));
    estimates.last().map_or(0.0, |estimate| estimate.area)
}

/// Tries the four children of `node`.
fn try_children(surface: &Surface<'_>, sampler: &Sampler<'_>, node: NodeId, trials: &mut Trials) {
    let Some(own) = trials.nodes.get(&node).or(trials.roots.last()).copied() else {
        return;
    };
    let children = [0, 1, 2, 3].map(|q| node.child(Quadrant(q)));
    let mut found = children.map(|child| {
        let positions = sampler.positions(surface.borders, window(child));
        let estimate = sampler
            .estimates(window(child), &positions, 1)
            .pop()
            .unwrap_or_default();
        let border = surface.open_border_error(child, PAGE_RESOLUTION + child.level);
        let fine = surface.target * f64::from(CELLS) >= extent(&positions);
        Trial {
            squares: estimate.squares,
            area: estimate.area,
            worst: estimate.worst.max(border),
            deeper: child.level < DEEPEST_LEVEL && !fine,
        }
    });
    let left: f64 = found.iter().map(|trial| trial.squares).sum();
    let worst = found.iter().map(|trial| trial.worst).fold(0.0, f64::max);
    if left > HOPELESS * own.squares && worst > HOPELESS * own.worst {
        for trial in &mut found {
            trial.deeper = false;
        }
    }
    trials.nodes.extend(children.into_iter().zip(found));
}

/// The longest side of the bounds.
fn extent(positions: &[glam::DVec3]) -> f64 {
    let (min, max) = positions.iter().fold(
        (glam::DVec3::INFINITY, glam::DVec3::NEG_INFINITY),
        |(min, max), &p| (min.min(p), max.max(p)),
    );
    (max - min).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atlas::patch::{Border, Patch};
    use crate::atlas::quantize;
    use crate::parameterize::test_patches::{bumpy, with_borders};
    use crate::parameterize::{Parametrization, parameterize};
    use glam::DVec3;
    use marquetry_format::Glue;

    struct Model {
        patches: Vec<Patch>,
        maps: Vec<Parametrization>,
        borders: Vec<Border>,
        glue: Vec<[Option<Glue>; 4]>,
    }

    impl Model {
        /// Separate charts, side by side.
        fn new(patches: Vec<Patch>) -> Self {
            let mut model = Self {
                patches: Vec::new(),
                maps: Vec::new(),
                borders: Vec::new(),
                glue: vec![[None; 4]; patches.len()],
            };
            for (k, mut patch) in patches.into_iter().enumerate() {
                for position in &mut patch.positions {
                    position.x += 2.0 * k as f64;
                }
                let (mut patch, own) = with_borders(patch, [true; 4]);
                for (border, _) in &mut patch.borders {
                    *border += u32::try_from(model.borders.len()).unwrap();
                }
                model.borders.extend(own);
                model.maps.push(parameterize(&mut patch, &model.borders));
                model.patches.push(patch);
            }
            model
        }

        fn surface(&self, target: f64) -> Surface<'_> {
            Surface {
                patches: &self.patches,
                parametrizations: &self.maps,
                borders: &self.borders,
                glue: &self.glue,
                lattice: quantize::lattice(DVec3::ZERO, DVec3::splat(8.0), target),
                colours: false,
                target,
                distance: 0.0,
                cap_distance: 0.0,
                cap_squares: 0.0,
            }
        }

        fn samplers(&self) -> Vec<Sampler<'_>> {
            let maps = self.patches.iter().zip(&self.maps);
            maps.map(|(patch, map)| Sampler::new(patch, map)).collect()
        }
    }

    fn hilly(x: f64, y: f64) -> f64 {
        0.1 * (7.0 * x).sin() * (6.0 * y).cos()
    }

    #[test]
    fn depth_goes_where_the_surface_bends() {
        let model = Model::new(vec![
            bumpy(24, 0.3, 1, |_, _| 0.0),
            bumpy(24, 0.3, 2, hilly),
        ]);
        let samplers = model.samplers();
        let surface = model.surface(2e-3);
        let mut survey = Survey::new(&surface, &samplers, &|| {});
        let goal = surface.target.powi(2);
        let (depth, reached) = survey.choose(goal, u64::MAX).unwrap();
        assert!(reached <= goal, "{reached} {goal}");
        assert_eq!(depth.roots[0], 1);
        assert!(depth.roots[1] >= 3);
        // A tighter goal takes more, a looser one less.
        let (finer, _) = survey.choose(0.01 * goal, u64::MAX).unwrap();
        let (coarser, _) = survey.choose(100.0 * goal, u64::MAX).unwrap();
        assert!(count(&finer) > count(&depth) && count(&depth) > count(&coarser));
    }

    #[test]
    fn a_goal_out_of_reach_does_not_take_every_sample() {
        // One vertex far away, which no sample meets: what depth cannot mend.
        let mut spiky = bumpy(24, 0.3, 3, hilly);
        let middle = spiky.positions.len() / 2;
        spiky.positions[middle].z += 50.0;
        let model = Model::new(vec![spiky, bumpy(24, 0.3, 4, hilly)]);
        let samplers = model.samplers();
        let surface = model.surface(1e-4);
        let mut survey = Survey::new(&surface, &samplers, &|| {});
        let (depth, _) = survey.choose(surface.target.powi(2), u64::MAX).unwrap();
        let most = SAMPLES_AT_LEAST as u64;
        // The price has a floor, which is no strict limit; without it this takes every sample there is.
        let all = 2 << (2 * (PAGE_RESOLUTION + DEEPEST_LEVEL));
        assert!(8 * most < all);
        assert!(count(&depth) < 8 * most, "{}", count(&depth));
    }

    #[test]
    fn the_largest_error_is_mended_within_its_budget() {
        // A ridge that no side follows.
        let ridge = |x: f64, y: f64| 0.2 * (x - 0.37 - 0.3 * y).abs();
        let model = Model::new(vec![bumpy(40, 0.2, 5, ridge)]);
        let samplers = model.samplers();
        let surface = model.surface(1e-3);
        let mut survey = Survey::new(&surface, &samplers, &|| {});
        let worst = |survey: &Survey<'_>, depth: &Depth| {
            let mut worst = 0.0f64;
            survey.trials[0].leaves(root_of(0), depth, &mut |_, trial| {
                worst = worst.max(trial.worst);
            });
            worst
        };
        let (depth, _) = survey
            .choose((4.0 * surface.target).powi(2), u64::MAX)
            .unwrap();
        assert!(worst(&survey, &depth) <= MAX_OVER_TARGET * surface.target);
    }
}
