//! From parametrized patches to the charts that the writer takes: how deep each goes, its samples, its errors.
//!
//! Depth is chosen for the error that is expected of the fit, and chosen anew when the fit turns out otherwise. Samples of
//! inner nodes are those of their leaves. Errors are taken of the decoded samples.

use super::caps;
use super::depth::Depth;
use super::leaves::{self, Leaf, Points};
use super::normals;
use super::patch::{Border, Patch};
use super::quantize;
use super::summary;
use super::survey::{Survey, window, window_of};
use crate::fit::{self, Fitted};
use crate::parameterize::Parametrization;
use crate::resample::{Sampler, Window};
use glam::DVec3;
use marquetry_evaluation::distance;
use marquetry_format::writer::{ChartInput, NodeInput};
use marquetry_format::{ChartId, Glue, Lattice, NodeId, PageSamples, Quadrant};
use rayon::prelude::*;
use std::collections::HashMap;

/// Part of the target that estimates aim at: what is measured afterwards is a little more.
const AIM: f64 = 0.94;
/// The same for a measured error: above [`AIM`] by what fewer samples may miss.
const MEASURED_AIM: f64 = 0.96;
/// Part of the squared error that a fit is first expected to leave.
const EXPECTED_LEFT: f64 = 0.4;
/// How much closer than the goal a next try aims.
const CLOSER: f64 = 1.03;
/// Least factor between what two tries ask for.
const LEAST_STEP: f64 = 1.1;
/// Powers of the survey's error that the fit's is taken for.
const POWERS: [f64; 2] = [0.7, 2.0];
/// Depths tried at most.
const ATTEMPTS: usize = 6;
/// A fit that had to be undone at more than this part of the points is measured before it is believed: where tangent planes
/// say little, as at the creases and slivers of CAD models, distances to them do not either.
const DOUBTFUL: f64 = 0.1;
/// Samples of that measurement.
const MEASURED_SAMPLES: u64 = 100_000;
/// A result below this part of the goal, squared errors, has more samples than it needs.
const WASTEFUL: f64 = 0.7;

/// Everything that sampling needs of one model.
#[derive(Debug)]
pub struct Surface<'a> {
    /// Patches in chart order.
    pub patches: &'a [Patch],
    /// How each patch lies on its square.
    pub parametrizations: &'a [Parametrization],
    /// Shared border curves.
    pub borders: &'a [Border],
    /// Glue by chart and side.
    pub glue: &'a [[Option<Glue>; 4]],
    /// The lattice.
    pub lattice: Lattice,
    /// Whether samples carry colours.
    pub colours: bool,
    /// Target RMS error, a length.
    pub target: f64,
    /// Bound of the distance from the patches to the source, a length.
    pub distance: f64,
    /// Bound of the distance from the caps of cut handles and fingers to the patches, a length.
    pub cap_distance: f64,
    /// About the integral of the squared distance between caps and the source; >= 0.
    pub cap_squares: f64,
}

/// The charts, and their error at the finest resolution.
#[derive(Debug, Default)]
pub struct Atlas {
    /// One input a chart.
    pub charts: Vec<ChartInput>,
    /// Guaranteed bound over all charts, a length.
    pub max_error: f64,
    /// Samples stored, shared ones counted in each page.
    pub samples: u64,
    /// Points of the finest surface that a fit could have moved.
    pub points: u64,
    /// Those of them that the fit would have made worse and left where they were sampled.
    pub kept: u64,
}

impl Surface<'_> {
    /// Largest distance of the node's part of the chart's open borders from the polyline that a resolution draws.
    /// Distances to tangent planes do not see a corner that is cut off.
    pub(super) fn open_border_error(&self, node: NodeId, resolution: u8) -> f64 {
        let chart = node.chart.0 as usize;
        let last = (1u32 << node.level) - 1;
        // Place along each side, counter-clockwise, for a node that touches it.
        let along = [
            (node.y == 0).then_some(node.x),
            (node.x == last).then_some(node.y),
            (node.y == last).then(|| last - node.x),
            (node.x == 0).then(|| last - node.y),
        ];
        let mut worst: f64 = 0.0;
        for (side, along) in along.into_iter().enumerate() {
            let (Some(along), None) = (along, self.glue[chart][side]) else {
                continue;
            };
            let (border, forward) = self.patches[chart].borders[side];
            let along = if forward { along } else { last - along };
            let nodes = f64::from(last + 1);
            let part = f64::from(along) / nodes..=f64::from(along + 1) / nodes;
            let error = self.borders[border as usize].chord_error(resolution, part);
            worst = worst.max(error);
        }
        worst
    }

    /// Length in lattice units, rounded up.
    fn in_lattice_units(&self, length: f64) -> f32 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounded up by the next line"
        )]
        let units = (length / self.lattice.step) as f32;
        units.next_up()
    }
}

/// Samples every chart as deep as the error of the whole asks; `None` where that takes more than `most_samples`.
pub fn build(
    surface: &Surface<'_>,
    most_samples: u64,
    progress: &(dyn Fn(f64) + Sync),
) -> Option<Atlas> {
    let count = surface.patches.len();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let tick = || {
        let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        progress((done as f64 / (2 * count) as f64).min(1.0));
    };
    let samplers: Vec<Sampler> = surface
        .patches
        .par_iter()
        .zip(surface.parametrizations)
        .map(|(patch, parametrization)| Sampler::new(patch, parametrization))
        .collect();
    let mut survey = Survey::new(surface, &samplers, &tick);
    let area = survey.area.max(f64::MIN_POSITIVE);
    // Caps are sampled as if they were source.
    let goal = (AIM * surface.target).powi(2) - surface.cap_squares / area;
    let mut tries: Vec<Try> = Vec::new();
    let mut finest: Option<Finest> = None;
    for attempt in 0..ATTEMPTS {
        let (depth, unfitted) = survey.choose(asked(&tries, goal), most_samples)?;
        if finest.as_ref().is_some_and(|last| last.depth == depth) {
            break;
        }
        let found = Finest::new(surface, &samplers, depth);
        let estimated = found.squares / area;
        // Distances to tangent planes say little where the surface is rough: what looks good is measured.
        let reached =
            if estimated <= goal || found.kept as f64 > DOUBTFUL * found.joined.len() as f64 {
                found
                    .measured_rms(surface)
                    .map_or(estimated, |rms| estimated.max((rms * MEASURED_AIM).powi(2)))
            } else {
                estimated
            };
        tracing::debug!(
            attempt,
            points = found.joined.len(),
            kept = found.kept,
            of_target = reached.sqrt() / surface.target,
            "fitted"
        );
        finest = Some(found);
        if reached <= goal && (reached >= WASTEFUL * goal || attempt > 0) {
            break;
        }
        // A plane has no error.
        tries.push(Try {
            unfitted: unfitted.max(f64::MIN_POSITIVE),
            reached: reached.max(f64::MIN_POSITIVE),
        });
    }
    let Some(mut finest) = finest else {
        return Some(Atlas::default());
    };
    finest.filter_normals(&samplers);
    let charts: Vec<ChartInput> = (0..count)
        .into_par_iter()
        .map(|chart| {
            let builder = ChartBuilder {
                surface,
                sampler: &samplers[chart],
                finest: &finest,
                caps: caps::squares(&surface.patches[chart], &surface.parametrizations[chart]),
            };
            let root = NodeId::root(ChartId(u32::try_from(chart).unwrap_or(u32::MAX)));
            let root = builder.node(root);
            tick();
            ChartInput {
                glue: surface.glue[chart],
                root,
            }
        })
        .collect();
    let roots = charts.iter().map(|chart| &chart.root);
    let max_error = roots.clone().map(finest_error).fold(0.0, f32::max);
    Some(Atlas {
        max_error: f64::from(max_error) * surface.lattice.step,
        samples: roots.map(count_samples).sum(),
        charts,
        points: finest.joined.len() as u64,
        kept: finest.kept,
    })
}

/// A depth that was tried: mean squared errors of the samples as the survey knows them, and of the fitted surface.
#[derive(Debug, Clone, Copy)]
struct Try {
    unfitted: f64,
    reached: f64,
}

/// What the survey is asked for, so that the fit reaches `goal`: squared errors.
///
/// The error that is reached is taken for a power of the other, through the last two tries.
fn asked(tries: &[Try], goal: f64) -> f64 {
    let Some(last) = tries.last() else {
        return goal / EXPECTED_LEFT;
    };
    let before = tries.len().checked_sub(2).map(|at| tries[at]);
    let power = before.map_or(1.0, |before| {
        let power = (last.reached / before.reached).ln() / (last.unfitted / before.unfitted).ln();
        if power.is_nan() {
            1.0
        } else {
            power.clamp(POWERS[0], POWERS[1])
        }
    });
    // A little more, or it may come near the goal for ever.
    let wanted = goal / (CLOSER * last.reached);
    let next = last.unfitted * wanted.powf(1.0 / power);
    if wanted < 1.0 {
        next.min(last.unfitted / LEAST_STEP)
    } else {
        next
    }
}

/// Largest error of the leaves, lattice units.
fn finest_error(node: &NodeInput) -> f32 {
    match &node.children {
        Some(children) => children.iter().map(finest_error).fold(0.0, f32::max),
        None => node.errors.last().copied().unwrap_or(0.0),
    }
}

fn count_samples(node: &NodeInput) -> u64 {
    let below: u64 = node
        .children
        .iter()
        .flat_map(|c| c.iter())
        .map(count_samples)
        .sum();
    node.samples.positions.len() as u64 + below
}

/// The finest surface: all leaves, fitted and on the lattice.
struct Finest {
    depth: Depth,
    leaves: HashMap<NodeId, PageSamples>,
    /// The leaves in order, and which of their samples are one.
    order: Vec<Leaf>,
    joined: Points,
    /// Integral of the squared error over the source's area.
    squares: f64,
    kept: u64,
}

impl Finest {
    fn new(surface: &Surface<'_>, samplers: &[Sampler<'_>], depth: Depth) -> Self {
        let leaves = leaves::leaves_of(&depth);
        let points = Points::new(surface.glue, &leaves);
        let (sampled, mut samples) = sample(surface, samplers, &leaves, &points);
        let lattice = &surface.lattice;
        let stored =
            |position| lattice.world_from_lattice(quantize::lattice_from_world(lattice, position));
        let problem = fit::Problem {
            samplers,
            leaves: &leaves,
            points: &points,
            sampled: &sampled,
            target: surface.target,
            stored: &stored,
        };
        let Fitted {
            positions,
            squares,
            kept,
        } = fit::fit(&problem);
        samples
            .par_iter_mut()
            .zip(&leaves)
            .for_each(|(samples, &leaf)| {
                samples.positions = problem
                    .image(leaf, &positions)
                    .iter()
                    .map(|&p| quantize::lattice_from_world(lattice, p))
                    .collect();
            });
        Self {
            depth,
            leaves: leaves.iter().map(|leaf| leaf.node).zip(samples).collect(),
            squares,
            kept,
            order: leaves,
            joined: points,
        }
    }

    /// Gives the samples normals that stand for the cells around them.
    fn filter_normals(&mut self, samplers: &[Sampler<'_>]) {
        let sampled: Vec<&[[u8; 2]]> = self
            .order
            .iter()
            .map(|leaf| {
                let samples = self.leaves.get(&leaf.node);
                samples.map_or(&[][..], |samples| samples.normals.as_slice())
            })
            .collect();
        let filtered = normals::filtered(samplers, &self.order, &self.joined, &sampled);
        for (leaf, normals) in self.order.iter().zip(filtered) {
            if let Some(samples) = self.leaves.get_mut(&leaf.node) {
                samples.normals = normals;
            }
        }
    }
}

impl Finest {
    /// True RMS distance, the larger of both ways, where it can be measured.
    fn measured_rms(&self, surface: &Surface<'_>) -> Option<f64> {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        // In the order of nodes: sums must not depend on that of the map.
        let mut leaves: Vec<_> = self.leaves.iter().collect();
        leaves.sort_unstable_by_key(|&(&node, _)| node);
        for (_, samples) in leaves {
            quantize::append_mesh(samples, &surface.lattice, &mut positions, &mut triangles);
        }
        let (mut source, mut source_triangles) = (Vec::new(), Vec::new());
        for patch in surface.patches {
            let first = u32::try_from(source.len()).ok()?;
            source.extend_from_slice(&patch.positions);
            source_triangles.extend(patch.triangles.iter().map(|t| t.map(|v| first + v)));
        }
        distance::rms(
            distance::Mesh {
                positions: &positions,
                triangles: &triangles,
            },
            distance::Mesh {
                positions: &source,
                triangles: &source_triangles,
            },
            MEASURED_SAMPLES,
        )
        .ok()
    }
}

/// Where the points lie on the source, and what else the samples have.
fn sample(
    surface: &Surface<'_>,
    samplers: &[Sampler<'_>],
    leaves: &[Leaf],
    points: &Points,
) -> (Vec<DVec3>, Vec<PageSamples>) {
    let grids: Vec<(Vec<DVec3>, PageSamples)> = leaves
        .par_iter()
        .map(|&leaf| {
            let window = window_of(leaf);
            let grid = samplers[leaf.node.chart.0 as usize].grid(surface.borders, window);
            let mut samples =
                quantize::samples(&grid, window.cells, &surface.lattice, surface.colours);
            samples.positions = Vec::new();
            (grid.positions, samples)
        })
        .collect();
    let mut sampled = vec![DVec3::ZERO; points.len()];
    for (leaf, (positions, _)) in leaves.iter().zip(&grids) {
        for (between, &position) in points.of_sample[leaf.range()].iter().zip(positions) {
            if between.0 == between.1 {
                sampled[between.0 as usize] = position;
            }
        }
    }
    (
        sampled,
        grids.into_iter().map(|(_, samples)| samples).collect(),
    )
}

/// One chart's nodes, made from the leaves upwards.
struct ChartBuilder<'a> {
    surface: &'a Surface<'a>,
    sampler: &'a Sampler<'a>,
    finest: &'a Finest,
    caps: Vec<caps::Square>,
}

impl ChartBuilder<'_> {
    fn node(&self, node: NodeId) -> NodeInput {
        let children = self.children(node);
        let samples = match &children {
            Some(children) => quantize::from_children(children.as_ref()),
            None => self.finest.leaves.get(&node).cloned().unwrap_or_default(),
        };
        let positions = quantize::world_positions(&samples, &self.surface.lattice);
        let errors = if node.level == 0 {
            self.sampler
                .errors(Window::whole(samples.resolution), &positions)
        } else {
            vec![self.sampler.error(window(node), &positions)]
        };
        let cone = summary::of(&samples, children.as_deref());
        // Errors never grow on the way down.
        let mut bounds: Vec<f32> = errors
            .iter()
            .map(|e| self.surface.in_lattice_units(e.max + self.distance(node)))
            .collect();
        let mut floor = deepest_error(children.as_deref());
        for bound in bounds.iter_mut().rev() {
            floor = floor.max(*bound);
            *bound = floor;
        }
        NodeInput {
            samples,
            errors: bounds,
            cone,
            children,
        }
    }

    /// How far the patch itself may be from the source within a node.
    fn distance(&self, node: NodeId) -> f64 {
        let caps = if self.caps.iter().any(|cap| cap.touches(node)) {
            self.surface.cap_distance
        } else {
            0.0
        };
        self.surface.distance + caps
    }

    /// The children of `node`, if the file holds them.
    fn children(&self, node: NodeId) -> Option<Box<[NodeInput; 4]>> {
        let children = [0, 1, 2, 3].map(|q| node.child(Quadrant(q)));
        self.finest
            .depth
            .nodes
            .contains(&children[0])
            .then(|| Box::new(children.map(|child| self.node(child))))
    }
}

fn deepest_error(children: Option<&[NodeInput; 4]>) -> f32 {
    children
        .into_iter()
        .flatten()
        .flat_map(|c| &c.errors)
        .copied()
        .fold(0.0, f32::max)
}
