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
use std::collections::BTreeSet;

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
    /// RMS distance to the source's tangent planes over all charts, a length.
    pub rms_error: f64,
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
    let wanted: Vec<(u8, Vec<NodeId>)> = (0..count)
        .into_par_iter()
        .map(|chart| {
            let wanted = ChartSampler::new(surface, chart).wanted();
            tick();
            wanted
        })
        .collect();
    let mut depth = Depth { roots: wanted.iter().map(|w| w.0).collect(), nodes: BTreeSet::new() };
    depth.nodes.extend(wanted.into_iter().flat_map(|w| w.1));
    depth.balance(surface.glue);
    let built: Vec<Built> = (0..count)
        .into_par_iter()
        .map(|chart| {
            let built = ChartSampler::new(surface, chart).build(&depth);
            tick();
            built
        })
        .collect();
    let mut atlas = Atlas { charts: Vec::with_capacity(count), max_error: 0.0, rms_error: 0.0, samples: 0 };
    let (mut square, mut area) = (0.0, 0.0);
    for (built, &glue) in built.into_iter().zip(surface.glue) {
        atlas.max_error = atlas.max_error.max(built.finest.max);
        square += built.finest.mean_square * built.finest.area;
        area += built.finest.area;
        atlas.samples += built.samples;
        atlas.charts.push(ChartInput { glue, root: built.root });
    }
    atlas.rms_error = if area > 0.0 { (square / area).sqrt() } else { 0.0 };
    atlas
}

struct Built {
    root: NodeInput,
    finest: GridError,
    samples: u64,
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
    Window { resolution: PAGE_RESOLUTION + node.level, x: node.x * CELLS, y: node.y * CELLS, cells: CELLS }
}

impl<'a> ChartSampler<'a> {
    fn new(surface: &'a Surface<'a>, chart: usize) -> Self {
        let sampler = Sampler::new(&surface.patches[chart], &surface.parametrizations[chart]);
        Self { surface, sampler, root: NodeId::root(ChartId(u32::try_from(chart).unwrap_or(u32::MAX))) }
    }

    fn good(&self, error: &GridError) -> bool {
        let target = self.surface.target;
        error.mean_square.sqrt() <= target && error.max_plane <= MAX_OVER_TARGET * target
    }

    fn samples(&self, window: Window) -> PageSamples {
        let grid = self.sampler.grid(self.surface.borders, window);
        quantize::samples(&grid, window.cells, &self.surface.lattice, self.surface.colours)
    }

    /// Errors of `samples` at every resolution of the window.
    fn errors(&self, window: Window, samples: &PageSamples) -> Vec<GridError> {
        self.sampler.errors(window, &world_positions(samples, &self.surface.lattice))
    }

    fn error(&self, node: NodeId, samples: &PageSamples) -> GridError {
        self.errors(window(node), samples).last().copied().unwrap_or_default()
    }

    /// Root resolution and deeper nodes that the chart's own error asks for.
    fn wanted(&self) -> (u8, Vec<NodeId>) {
        // Most charts of a dense scan are good at a coarse resolution: try upwards.
        let mut error = GridError::default();
        for r in 1..=PAGE_RESOLUTION {
            let whole = Window::whole(r);
            error = self.errors(whole, &self.samples(whole)).last().copied().unwrap_or_default();
            if self.good(&error) {
                return (r, Vec::new());
            }
        }
        let mut nodes = Vec::new();
        self.refine(self.root, &error, &mut nodes);
        (PAGE_RESOLUTION, nodes)
    }

    /// Adds the children of `node`, and theirs where they are not good yet.
    fn refine(&self, node: NodeId, error: &GridError, nodes: &mut Vec<NodeId>) {
        if node.level >= DEEPEST_LEVEL || self.good(error) {
            return;
        }
        for child in (0..4).map(|q| node.child(Quadrant(q))) {
            nodes.push(child);
            let own = self.error(child, &self.samples(window(child)));
            // A spike that sampling does not catch is not worth ever more pages.
            if own.max_plane < 0.9 * error.max_plane || own.mean_square > self.surface.target.powi(2) {
                self.refine(child, &own, nodes);
            }
        }
    }

    fn build(&self, depth: &Depth) -> Built {
        let resolution = depth.roots[self.root.chart.0 as usize];
        let whole = Window::whole(resolution);
        let samples = self.samples(whole);
        let errors = self.errors(whole, &samples);
        let mut finest = errors.last().copied().unwrap_or_default();
        let mut count = samples.positions.len() as u64;
        let children = self.children(self.root, &samples, depth, &mut finest, &mut count);
        let cone = summary::of(&samples, children.as_deref());
        // Errors never grow on the way down.
        let mut bounds: Vec<f32> = errors.iter().map(|e| self.in_lattice_units(e.max)).collect();
        let mut floor = deepest_error(children.as_deref());
        for bound in bounds.iter_mut().rev() {
            floor = floor.max(*bound);
            *bound = floor;
        }
        let root = NodeInput { samples, errors: bounds, cone, children };
        Built { root, finest, samples: count }
    }

    /// The children of `node`, if the file holds them. Replaces `finest` by the error of what lies below.
    fn children(
        &self,
        node: NodeId,
        samples: &PageSamples,
        depth: &Depth,
        finest: &mut GridError,
        count: &mut u64,
    ) -> Option<Box<[NodeInput; 4]>> {
        if !depth.nodes.contains(&node.child(Quadrant(0))) {
            return None;
        }
        let mut below = GridError::default();
        let mut square = 0.0;
        let children = [0, 1, 2, 3].map(|q| {
            let child = node.child(Quadrant(q));
            let mut own = self.samples(window(child));
            copy_even_positions(samples, Quadrant(q), &mut own);
            *count += own.positions.len() as u64;
            let error = self.error(child, &own);
            let mut leaf = error;
            let children = self.children(child, &own, depth, &mut leaf, count);
            below.max = below.max.max(leaf.max);
            below.max_plane = below.max_plane.max(leaf.max_plane);
            below.area += leaf.area;
            square += leaf.mean_square * leaf.area;
            let bound = self.in_lattice_units(error.max).max(deepest_error(children.as_deref()));
            let cone = summary::of(&own, children.as_deref());
            NodeInput { samples: own, errors: vec![bound], cone, children }
        });
        below.mean_square = if below.area > 0.0 { square / below.area } else { 0.0 };
        *finest = below;
        Some(Box::new(children))
    }

    /// Length in lattice units, rounded up.
    fn in_lattice_units(&self, length: f64) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "rounded up by the next line")]
        let units = (length / self.surface.lattice.step) as f32;
        units.next_up()
    }
}

fn deepest_error(children: Option<&[NodeInput; 4]>) -> f32 {
    children.into_iter().flatten().flat_map(|c| &c.errors).copied().fold(0.0, f32::max)
}

/// Makes the even positions of a child those of its parent's quadrant, bit for bit.
fn copy_even_positions(parent: &PageSamples, quadrant: Quadrant, child: &mut PageSamples) {
    let (side, half) = (child.side(), 1usize << (PAGE_RESOLUTION - 1));
    let (x, y) = (usize::from(quadrant.0 & 1) * half, usize::from(quadrant.0 >> 1) * half);
    for j in 0..=half {
        for i in 0..=half {
            let (from, to) = ((y + j) * parent.side() + x + i, 2 * j * side + 2 * i);
            child.positions[to] = parent.positions[from];
        }
    }
}
