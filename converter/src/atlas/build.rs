//! From parametrized patches to the charts that the writer takes: how deep each goes, its samples, its errors.

use super::depth::Depth;
use super::patch::{Border, Patch};
use super::quantize::{self, world_positions};
use super::summary;
use crate::parameterize::Parametrization;
use crate::resample::{GridError, Sampler, Window};
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::writer::{ChartInput, NodeInput};
use marquetry_format::{ChartId, Glue, Lattice, NodeId, PageSamples, Quadrant};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Deepest level that sampling goes to. At level 6 a chart has 2048² cells.
const DEEPEST_LEVEL: u8 = 6;
/// A node is refined until its largest distance is at most this many targets, while that is worth a page.
const MAX_OVER_TARGET: f64 = 10.0;

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
}

/// The charts, and their error at the finest resolution.
#[derive(Debug)]
pub struct Atlas {
    /// One input a chart.
    pub charts: Vec<ChartInput>,
    /// Guaranteed bound over all charts, a length.
    pub max_error: f64,
    /// Samples stored, shared ones counted in each page.
    pub samples: u64,
}

/// Samples every chart as deep as its error asks.
pub fn build(surface: &Surface<'_>, progress: &(dyn Fn(f64) + Sync)) -> Atlas {
    let count = surface.patches.len();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let tick = || {
        let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        progress(done as f64 / (2 * count) as f64);
    };
    let tries: Vec<Tried> = (0..count)
        .into_par_iter()
        .map(|chart| {
            let tried = ChartSampler::new(surface, chart).try_depths();
            tick();
            tried
        })
        .collect();
    let mut depth = Depth {
        roots: tries.iter().map(|t| t.wanted).collect(),
        nodes: BTreeSet::new(),
    };
    depth
        .nodes
        .extend(tries.iter().flat_map(|t| t.nodes.keys()));
    depth.balance(surface.glue);
    let charts: Vec<ChartInput> = tries
        .into_par_iter()
        .enumerate()
        .map(|(chart, tried)| {
            let root = ChartSampler::new(surface, chart).build(&depth, tried);
            tick();
            ChartInput {
                glue: surface.glue[chart],
                root,
            }
        })
        .collect();
    let roots = charts.iter().map(|chart| &chart.root);
    let max_error = roots.clone().map(finest_error).fold(0.0, f32::max);
    Atlas {
        max_error: f64::from(max_error) * surface.lattice.step,
        samples: roots.map(count_samples).sum(),
        charts,
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

/// What finding a chart's depth took: most of it is used again.
#[derive(Default)]
struct Tried {
    wanted: u8,
    samples: PageSamples,
    errors: Vec<GridError>,
    nodes: BTreeMap<NodeId, (PageSamples, GridError)>,
}

/// Cells of a full page a side.
const CELLS: u32 = 1 << PAGE_RESOLUTION;

/// One chart being sampled.
struct ChartSampler<'a> {
    surface: &'a Surface<'a>,
    sampler: Sampler<'a>,
    root: NodeId,
}

fn window(node: NodeId) -> Window {
    Window {
        resolution: PAGE_RESOLUTION + node.level,
        x: node.x * CELLS,
        y: node.y * CELLS,
        cells: CELLS,
    }
}

impl<'a> ChartSampler<'a> {
    fn new(surface: &'a Surface<'a>, chart: usize) -> Self {
        let sampler = Sampler::new(&surface.patches[chart], &surface.parametrizations[chart]);
        Self {
            surface,
            sampler,
            root: NodeId::root(ChartId(u32::try_from(chart).unwrap_or(u32::MAX))),
        }
    }

    fn good(&self, error: &GridError, samples: &PageSamples) -> bool {
        let target = self.surface.target;
        error.mean_square.sqrt() <= target && error.max_plane <= MAX_OVER_TARGET * target
            || self.is_fine(samples)
    }

    /// Whether cells are no larger than the target: finer ones show nothing more.
    fn is_fine(&self, samples: &PageSamples) -> bool {
        let (mut min, mut max) = ([u32::MAX; 3], [0; 3]);
        for p in &samples.positions {
            for k in 0..3 {
                min[k] = min[k].min(p[k]);
                max[k] = max[k].max(p[k]);
            }
        }
        let extent = (0..3)
            .map(|k| f64::from(max[k] - min[k]))
            .fold(0.0, f64::max);
        extent * self.surface.lattice.step
            <= self.surface.target * f64::from(1u32 << samples.resolution)
    }

    /// Largest distance of the node's part of the chart's open borders from the polyline that a resolution draws.
    /// Distances to tangent planes do not see a corner that is cut off.
    fn open_border_error(&self, node: NodeId, resolution: u8) -> f64 {
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
            let (Some(along), None) = (along, self.surface.glue[chart][side]) else {
                continue;
            };
            let (border, forward) = self.surface.patches[chart].borders[side];
            let along = if forward { along } else { last - along };
            let nodes = f64::from(last + 1);
            let part = f64::from(along) / nodes..=f64::from(along + 1) / nodes;
            let error = self.surface.borders[border as usize].chord_error(resolution, part);
            worst = worst.max(error);
        }
        worst
    }

    fn border_is_good(&self, node: NodeId, resolution: u8) -> bool {
        self.open_border_error(node, resolution) <= MAX_OVER_TARGET * self.surface.target
    }

    fn samples(&self, window: Window) -> PageSamples {
        let grid = self.sampler.grid(self.surface.borders, window);
        quantize::samples(
            &grid,
            window.cells,
            &self.surface.lattice,
            self.surface.colours,
        )
    }

    /// Errors of `samples` at every resolution of the window.
    fn errors(&self, window: Window, samples: &PageSamples) -> Vec<GridError> {
        self.sampler
            .errors(window, &world_positions(samples, &self.surface.lattice))
    }

    /// Finds the root resolution and the deeper nodes that the chart's own error asks for, and keeps what that took.
    fn try_depths(&self) -> Tried {
        let mut tried = Tried::default();
        // One sampling tells the error of every coarser resolution as well, and few charts need the finest.
        for resolution in [PAGE_RESOLUTION - 1, PAGE_RESOLUTION] {
            let whole = Window::whole(resolution);
            tried.samples = self.samples(whole);
            tried.errors = self.errors(whole, &tried.samples);
            if let Some(wanted) = (1..=resolution).find(|&r| {
                self.border_is_good(self.root, r)
                    && self.good(&tried.errors[usize::from(r)], &tried.samples)
            }) {
                tried.wanted = wanted;
                return tried;
            }
        }
        tried.wanted = PAGE_RESOLUTION;
        let error = tried.errors[usize::from(PAGE_RESOLUTION)];
        self.refine(self.root, &error, &mut tried.nodes);
        tried
    }

    /// Adds the children of `node`, and theirs where they are not good yet.
    fn refine(
        &self,
        node: NodeId,
        error: &GridError,
        nodes: &mut BTreeMap<NodeId, (PageSamples, GridError)>,
    ) {
        if node.level >= DEEPEST_LEVEL {
            return;
        }
        for child in (0..4).map(|q| node.child(Quadrant(q))) {
            let (samples, own) = self.node(child);
            // A spike that sampling does not catch is not worth ever more pages.
            let gains = own.max_plane < 0.9 * error.max_plane
                || own.mean_square > self.surface.target.powi(2);
            let border = self.border_is_good(child, PAGE_RESOLUTION + child.level);
            let deeper = gains && !self.good(&own, &samples) || !border && !self.is_fine(&samples);
            nodes.insert(child, (samples, own));
            if deeper {
                self.refine(child, &own, nodes);
            }
        }
    }

    fn node(&self, node: NodeId) -> (PageSamples, GridError) {
        let samples = self.samples(window(node));
        let positions = world_positions(&samples, &self.surface.lattice);
        let error = self.sampler.error(window(node), &positions);
        (samples, error)
    }

    fn build(&self, depth: &Depth, mut tried: Tried) -> NodeInput {
        let resolution = depth.roots[self.root.chart.0 as usize];
        if tried.samples.resolution < resolution {
            let whole = Window::whole(resolution);
            tried.samples = self.samples(whole);
            tried.errors = self.errors(whole, &tried.samples);
        }
        let samples = quantize::coarsen(tried.samples, resolution);
        let errors = &tried.errors[..=usize::from(resolution)];
        let children = self.children(self.root, depth, &mut tried.nodes);
        let cone = summary::of(&samples, children.as_deref());
        // Errors never grow on the way down.
        let mut bounds: Vec<f32> = errors
            .iter()
            .map(|e| self.in_lattice_units(e.max))
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

    /// The children of `node`, if the file holds them.
    fn children(
        &self,
        node: NodeId,
        depth: &Depth,
        tried: &mut BTreeMap<NodeId, (PageSamples, GridError)>,
    ) -> Option<Box<[NodeInput; 4]>> {
        if !depth.nodes.contains(&node.child(Quadrant(0))) {
            return None;
        }
        let children = [0, 1, 2, 3].map(|q| {
            let child = node.child(Quadrant(q));
            // Balance adds nodes that nobody tried.
            let (samples, error) = tried.remove(&child).unwrap_or_else(|| self.node(child));
            let children = self.children(child, depth, tried);
            let bound = self
                .in_lattice_units(error.max)
                .max(deepest_error(children.as_deref()));
            let cone = summary::of(&samples, children.as_deref());
            NodeInput {
                samples,
                errors: vec![bound],
                cone,
                children,
            }
        });
        Some(Box::new(children))
    }

    /// Length in lattice units, rounded up.
    fn in_lattice_units(&self, length: f64) -> f32 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounded up by the next line"
        )]
        let units = (length / self.surface.lattice.step) as f32;
        units.next_up()
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
