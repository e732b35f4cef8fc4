//! Made-up atlases for tests: small, exact, and with every kind of glue that matters.
//!
//! A sample's position is a function of its point on a fixed surface alone, evaluated at dyadic parameters, so samples that
//! are the same point are the same bits in every chart and at every resolution.

mod clusters;
mod crown;
mod wall;

pub use clusters::{clustered, clustered_with};
pub use crown::Crown;
pub use wall::Wall;

use crate::lod::animate::Drawn;
use crate::lod::balance;
use crate::lod::cut::{Cut, Leaf, QUADRANTS};
use glam::DVec3;
use marquetry_format::quadtree::PAGE_RESOLUTION;
use marquetry_format::writer::{
    ChartInput, ChartTiles, ColourInput, Content, NodeInput, TileInput, write,
};
use marquetry_format::{
    Chart, ChartId, ContentKind, Document, Error, Glue, Lattice, LatticePoint, Limits, Metadata,
    NodeId, NormalCone, PageSamples, Quadrant, Side, TexelSize, octahedral,
};

/// Geometric error, lattice units, that a made-up atlas claims at resolution 0; a quarter of it at each further one.
/// Far too much, so that ordinary views want nodes well below the root.
const COARSEST_ERROR: f32 = 16_000_000.0;

/// Numbers that look random and are the same in every run (xorshift64*).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// A sequence of its own for every `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// The next number.
    pub fn next_u64(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// A number in `0..limit`; 0 for a limit of 0.
    pub fn below(&mut self, limit: u32) -> u32 {
        u32::try_from((self.next_u64() >> 32) % u64::from(limit.max(1))).unwrap_or(0)
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f64 {
        f64::from(self.below(1 << 24)) / f64::from(1 << 24)
    }
}

/// A picture of 12 × 12 texels: a tile of 8 × 8 with its gutter.
const TILE_FRAME: &[u8] = include_bytes!("../../../format/tests/data/tile_12x12.vp8");

fn tile(node: NodeId, has_child: &mut dyn FnMut(NodeId) -> bool) -> TileInput {
    let mut children = [const { None }; 4];
    for (slot, quadrant) in children.iter_mut().zip((0..4).map(Quadrant)) {
        let child = node.child(quadrant);
        if has_child(child) {
            *slot = Some(Box::new(tile(child, has_child)));
        }
    }
    TileInput {
        bytes: TILE_FRAME.to_vec(),
        children,
    }
}

/// Metadata of a model between (−1, −1, −1) and (1, 1, 1).
pub fn metadata() -> Metadata {
    Metadata {
        kind: ContentKind::Scan,
        lattice: Lattice {
            origin: [-1.0; 3],
            step: 2.0 / f64::from((1 << 21) - 1),
            shift: 2,
        },
        bounds_min: [-1.0; 3],
        bounds_max: [1.0; 3],
        up_axis: 1,
        has_colours: true,
        target_error_rel: 1e-4,
        max_error_rel: 1e-4,
        rms_error_rel: 1e-5,
        source_triangles: 1000,
        source_vertices: 502,
        source_name: "made-up".to_owned(),
        generator: "tests".to_owned(),
    }
}

/// A surface that charts are laid on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A bumpy sphere of six charts, closed; sides are glued in several ways.
    Cube,
    /// A torus of one chart, glued to itself twice.
    Torus,
    /// Two charts side by side that open to the other sides.
    Strip,
    /// As many charts around a corner as one likes, closed.
    Crown(Crown),
}

impl Shape {
    fn chart_count(self) -> u32 {
        match self {
            Self::Cube => 6,
            Self::Torus => 1,
            Self::Strip => 2,
            Self::Crown(crown) => crown.chart_count(),
        }
    }

    /// The surface at (u, v) of `chart`: position within the unit ball, and outward normal.
    fn at(self, chart: u32, u: f64, v: f64) -> (DVec3, DVec3) {
        match self {
            Self::Crown(crown) => crown.at(chart, u, v),
            Self::Cube => {
                let [origin, along_u, along_v] = cube_face(chart);
                let direction =
                    (origin + 2.0 * u * along_u + 2.0 * v * along_v).normalize_or_zero();
                let bump = (5.0 * direction.x).sin()
                    * (4.0 * direction.y + 1.0).sin()
                    * (6.0 * direction.z).cos();
                (direction * (0.8 + 0.12 * bump), direction)
            }
            Self::Torus => {
                let turn = |t: f64| (t.fract() * std::f64::consts::TAU).sin_cos();
                let ((sin_u, cos_u), (sin_v, cos_v)) = (turn(u), turn(v));
                let normal = DVec3::new(cos_u * cos_v, sin_u * cos_v, sin_v);
                (DVec3::new(cos_u, sin_u, 0.0) * 0.6 + normal * 0.3, normal)
            }
            Self::Strip => {
                let x = f64::from(chart) + u - 1.0;
                (
                    DVec3::new(
                        0.9 * x,
                        1.6 * v - 0.8,
                        0.2 * (7.0 * x).sin() * (5.0 * v).cos(),
                    ),
                    DVec3::Z,
                )
            }
        }
    }

    fn glue(self, chart: u32, side: u8) -> Option<Glue> {
        let to = |chart, side| {
            Some(Glue {
                chart: ChartId(chart),
                side: Side(side),
                reversed: true,
            })
        };
        match self {
            Self::Crown(crown) => crown.glue(chart, side),
            Self::Torus => to(0, (side + 2) % 4),
            Self::Strip => match (chart, side) {
                (0, 1) => to(1, 3),
                (1, 3) => to(0, 1),
                _ => None,
            },
            Self::Cube => {
                let own = cube_side(chart, side);
                for other in 0..6 {
                    for other_side in 0..4 {
                        let ends = cube_side(other, other_side);
                        if (other, other_side) == (chart, side) {
                            continue;
                        }
                        if ends == own || [ends[1], ends[0]] == own {
                            return Some(Glue {
                                chart: ChartId(other),
                                side: Side(other_side),
                                reversed: ends != own,
                            });
                        }
                    }
                }
                None
            }
        }
    }

    /// The charts, each with a root of `resolution`.
    pub fn charts(self, resolution: u8) -> Vec<Chart> {
        let chart = |id| Chart {
            glue: [0, 1, 2, 3].map(|side| self.glue(id, side)),
            resolution,
            base_errors: (0..=resolution).map(error_at).collect(),
        };
        (0..self.chart_count()).map(chart).collect()
    }

    /// A file whose finest cut is `finest`, which must be balanced.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(self, finest: &Cut) -> Result<Vec<u8>, Error> {
        self.write_with(finest, None)
    }

    /// The same with colour tiles of 8 × 8 texels, all of one picture. A tile has the child that `has_child` says.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_textured(
        self,
        finest: &Cut,
        has_child: &mut dyn FnMut(NodeId) -> bool,
    ) -> Result<Vec<u8>, Error> {
        let size = TexelSize {
            width: 8,
            height: 8,
        };
        let charts = (0..self.chart_count()).map(|id| {
            let root = NodeId::root(ChartId(id));
            Some(ChartTiles {
                size,
                root: tile(root, has_child),
            })
        });
        self.write_with(finest, Some(&charts.collect()))
    }

    fn write_with(self, finest: &Cut, colour: Option<&ColourInput>) -> Result<Vec<u8>, Error> {
        let metadata = metadata();
        let mut bytes = Vec::new();
        let content = Content {
            charts: &self.inputs(finest),
            colour,
            ..Content::default()
        };
        write(&metadata, &metadata.lattice, &content, &mut bytes)?;
        Ok(bytes)
    }

    fn inputs(self, finest: &Cut) -> Vec<ChartInput> {
        (0..self.chart_count())
            .map(|id| ChartInput {
                glue: [0, 1, 2, 3].map(|side| self.glue(id, side)),
                root: self.node(finest, NodeId::root(ChartId(id))),
            })
            .collect()
    }

    /// The same, opened, with its whole index.
    ///
    /// # Errors
    /// Those of the writer and the reader.
    pub fn open(self, finest: &Cut) -> Result<(Document, Vec<u8>), Error> {
        let source = self.write(finest)?;
        let mut document = Document::open(&source, Limits::default())?;
        document.load_index(&source)?;
        Ok((document, source))
    }

    fn node(self, finest: &Cut, node: NodeId) -> NodeInput {
        let split = finest.is_split(node);
        let resolution = match finest.leaf_over(node) {
            Some(leaf) if node.level == 0 => leaf.resolution,
            _ => PAGE_RESOLUTION,
        };
        let errors = match node.level {
            0 => (0..=resolution).map(error_at).collect(),
            level => vec![error_at(PAGE_RESOLUTION + level)],
        };
        NodeInput {
            samples: self.samples(node, resolution),
            errors,
            cone: NormalCone {
                axis: [0.0, 0.0, 1.0],
                cos: -1.0,
            },
            children: split.then(|| {
                Box::new(QUADRANTS.map(|quadrant| self.node(finest, node.child(quadrant))))
            }),
        }
    }

    fn samples(self, node: NodeId, resolution: u8) -> PageSamples {
        let lattice = metadata().lattice;
        let side = (1u32 << resolution) + 1;
        let step = 0.5f64.powi(i32::from(resolution) + i32::from(node.level));
        let mut samples = PageSamples {
            resolution,
            ..PageSamples::default()
        };
        for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
            let along = |n: u32, k: u32| f64::from((n << resolution) + k) * step;
            let (position, normal) = self.at(node.chart.0, along(node.x, i), along(node.y, j));
            samples.positions.push(quantize(&lattice, position));
            samples
                .normals
                .push(octahedral::encode(normal.as_vec3().to_array()));
            samples
                .colours
                .push((127.5 + 120.0 * position).to_array().map(byte));
        }
        samples
    }
}

/// [`Shape::Cube`]'s charts.
pub fn cube_charts(resolution: u8) -> Vec<Chart> {
    Shape::Cube.charts(resolution)
}

/// [`Shape::Torus`]'s chart.
pub fn self_glued_charts(resolution: u8) -> Vec<Chart> {
    Shape::Torus.charts(resolution)
}

/// Any cut of `charts` with nodes of at most `deepest` levels below the root; not balanced.
pub fn random_cut(random: &mut Random, charts: &[Chart], deepest: u8) -> Cut {
    let mut cut = Cut::coarsest(charts.len());
    for (chart, index) in charts.iter().zip(0u32..) {
        let id = ChartId(index);
        cut.set_root(
            id,
            u8::try_from(random.below(u32::from(chart.resolution) + 1)).unwrap_or(0),
        );
        if chart.resolution < PAGE_RESOLUTION || random.below(2) == 0 {
            continue;
        }
        let mut stack = vec![NodeId::root(id)];
        while let Some(node) = stack.pop() {
            if node.level < deepest && random.below(2) == 0 {
                cut.split(node);
                stack.extend(QUADRANTS.map(|quadrant| node.child(quadrant)));
            }
        }
    }
    cut
}

/// A balanced `cut` with half of the leaves on their way that may be.
pub fn random_rest(random: &mut Random, charts: &[Chart], cut: Cut) -> Drawn {
    let mut drawn = Drawn::of(cut);
    for leaf in drawn.cut.leaves() {
        if !drawn.cut.is_beside_finer(charts, leaf) && random.below(2) == 0 {
            let morph = [0.125, 0.375, 0.8, 1.0][random.below(4) as usize];
            drawn.morphs.insert(leaf.node, morph);
        }
    }
    drawn
}

/// A balanced cut in which every leaf is at least `coarsest` and some are finer.
pub fn random_finest(random: &mut Random, charts: &[Chart], deepest: u8, coarsest: u8) -> Cut {
    let mut cut = random_cut(random, charts, deepest);
    for leaf in cut.leaves() {
        if leaf.node.level == 0 && leaf.resolution < coarsest {
            cut.set_root(leaf.node.chart, coarsest);
        }
    }
    balance::refine(&mut cut, charts, |_: Leaf| true);
    cut
}

fn error_at(resolution: u8) -> f32 {
    COARSEST_ERROR * 0.25f32.powi(i32::from(resolution))
}

/// Corner 0 of a face of the cube (−1..1)³, and its two edges by half: u × v points out.
fn cube_face(face: u32) -> [DVec3; 3] {
    // Turned differently, so that sides of all numbers meet.
    match face {
        0 => [DVec3::new(-1.0, -1.0, 1.0), DVec3::X, DVec3::Y],
        1 => [DVec3::new(1.0, -1.0, -1.0), DVec3::Y, DVec3::Z],
        2 => [DVec3::new(1.0, 1.0, -1.0), DVec3::NEG_Y, DVec3::NEG_X],
        3 => [DVec3::new(-1.0, -1.0, -1.0), DVec3::Z, DVec3::Y],
        4 => [DVec3::new(1.0, 1.0, 1.0), DVec3::NEG_Z, DVec3::NEG_X],
        _ => [DVec3::new(-1.0, -1.0, -1.0), DVec3::X, DVec3::Z],
    }
}

fn cube_side(face: u32, side: u8) -> [[i32; 3]; 2] {
    let [origin, u, v] = cube_face(face);
    let corner = |n: u8| match n % 4 {
        0 => origin,
        1 => origin + 2.0 * u,
        2 => origin + 2.0 * (u + v),
        _ => origin + 2.0 * v,
    };
    #[expect(clippy::cast_possible_truncation, reason = "corners are ±1")]
    let whole = |corner: DVec3| corner.to_array().map(|c| c as i32);
    [whole(corner(side)), whole(corner(side + 1))]
}

fn quantize(lattice: &Lattice, position: DVec3) -> LatticePoint {
    let grid = f64::from(1u32 << lattice.shift);
    let scaled = (position - DVec3::from_array(lattice.origin)) / (lattice.step * grid);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the shapes lie inside the lattice"
    )]
    scaled
        .to_array()
        .map(|c| (c.round().max(0.0) * grid) as u32)
}

fn byte(value: f64) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a byte"
    )]
    let byte = value.round().clamp(0.0, 255.0) as u8;
    byte
}
