//! A wall of clusters in groups of several members, whose borders are simplified level by level.
//!
//! The wall is cut into columns, each a fan of triangles from its middle to the vertices of its two long borders. Of four
//! neighbouring columns the next level makes two, with half the vertices on the border between these; the borders to other groups are
//! held. On every other level the first group has three columns, so a border that was held lies within the next group, and the two
//! columns of a group are children of different groups.

use super::Random;
use super::clusters::{root_first, written};
use crate::lod::animate::Drawn;
use crate::lod::cluster;
use crate::lod::cut::Cut;
use crate::lod::mesh::MeshBuilder;
use glam::DVec3;
use marquetry_format::cluster::ClusterTexture;
use marquetry_format::writer::ClusterInput;
use marquetry_format::{ClusterMesh, Document, Error, LatticePoint, octahedral};
use std::collections::BTreeSet;
use std::ops::Range;

/// Cells of a long border, a power of two.
const ROWS: u32 = 32;
/// Half the width of a column, and the height of a row, lattice units.
const UNIT: u32 = 4096;
/// Columns of a group, and of the first one of every other level.
const GROUP: usize = 4;
const FIRST: usize = 3;

/// A torus with a wall beside it.
#[derive(Debug)]
pub struct Wall {
    /// What is in the file.
    pub document: Document,
    /// The file.
    pub file: Vec<u8>,
    columns: u32,
}

/// A node that is a piece of the wall.
struct Column {
    /// The borders that it lies between.
    lines: Range<u32>,
    /// Its place in the list of nodes.
    node: usize,
}

/// The nodes so far, children first, and what the borders are like.
struct Builder<'a> {
    random: Random,
    frame: Option<&'a [u8]>,
    nodes: Vec<ClusterInput>,
    /// Rows from a vertex to the next, by border.
    steps: Vec<u32>,
}

impl Wall {
    /// A wall of 1 to 250 columns, with this frame of at least 16 × 16 texels on every cluster.
    ///
    /// # Errors
    /// When the file cannot be written or read: a fault of this crate or of the format's.
    pub fn new(columns: u32, frame: Option<&[u8]>) -> Result<Self, Error> {
        let columns = columns.clamp(1, 250);
        let mut builder = Builder {
            random: Random::new(u64::from(columns)),
            frame,
            nodes: Vec::new(),
            steps: vec![1; columns as usize + 1],
        };
        let mut level: Vec<Column> = (0..columns)
            .map(|column| builder.column(column..column + 1, 2.0, 1000.0))
            .collect();
        let mut is_shifted = false;
        while level.len() > 1 {
            let groups = group_sizes(level.len(), is_shifted);
            is_shifted = !is_shifted;
            let mut rest = level.as_slice();
            let mut next = Vec::new();
            for size in groups {
                let (group, others) = rest.split_at(size);
                rest = others;
                next.extend(builder.replace(group));
            }
            level = next;
        }
        let (document, file) = written(&root_first(builder.nodes))?;
        Ok(Self {
            document,
            file,
            columns,
        })
    }

    /// Whether an edge lies on the outline, nearly: what is rough moves a little aside.
    pub fn is_outline(&self, ends: [[f32; 3]; 2]) -> bool {
        let [width, height] = [2 * self.columns, ROWS].map(|units| f64::from(UNIT * units));
        let at = |axis: usize, place: f64| {
            let is_there = |end: &[f32; 3]| (f64::from(end[axis]) - place).abs() < 500.0;
            ends.iter().all(is_there)
        };
        at(0, 0.0) || at(0, width) || at(1, 0.0) || at(1, height)
    }

    /// Every part of the wall is drawn by `cut` exactly once, without a crack.
    ///
    /// # Panics
    /// Where this is not so.
    pub fn assert_whole(&self, cut: &Cut) {
        let mut builder = MeshBuilder::new(false);
        let drawn = Drawn::of(cut.clone());
        let appended = cluster::append(&self.document, &self.file, &drawn, &mut builder);
        assert!(appended.is_ok(), "{appended:?}");
        let mesh = builder.finish();
        let (width, height) = (f64::from(2 * UNIT * self.columns), f64::from(UNIT * ROWS));
        let mut area = 0.0;
        let mut edges = BTreeSet::new();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let doubled = (b - a).cross(c - a).z;
            assert!(doubled > 0.0, "a triangle that is turned over");
            area += 0.5 * doubled;
            let [a, b, c] = *triangle;
            for edge in [(a, b), (b, c), (c, a)] {
                assert!(edges.insert(edge), "an edge of three triangles");
            }
        }
        for (a, b) in &edges {
            if edges.contains(&(*b, *a)) {
                continue;
            }
            let ends = [a, b].map(|end| mesh.positions[*end as usize]);
            let at = |axis: usize, place: f64| {
                let is_there = |end: &DVec3| (end[axis] - place).abs() < 0.5;
                ends.iter().all(is_there)
            };
            let is_outline = at(0, 0.0) || at(0, width) || at(1, 0.0) || at(1, height);
            assert!(is_outline, "a crack at {ends:?}");
        }
        // Sums of integers: exact.
        assert!((area - width * height).abs() < 0.5, "{area}");
    }
}

/// Sizes of neighbouring groups, at least two each.
fn group_sizes(count: usize, is_shifted: bool) -> Vec<usize> {
    let mut sizes = Vec::new();
    let mut left = count;
    while left > 0 {
        let size = if is_shifted && sizes.is_empty() {
            FIRST
        } else {
            GROUP
        };
        let size = if left <= size + 1 { left } else { size };
        sizes.push(size);
        left -= size;
    }
    sizes
}

impl Builder<'_> {
    /// The columns, half as many, in place of `group`.
    fn replace(&mut self, group: &[Column]) -> Vec<Column> {
        let children: Vec<u32> = group
            .iter()
            .filter_map(|column| u32::try_from(column.node).ok())
            .collect();
        let below = group.iter().map(|column| &self.nodes[column.node]);
        let error = below.clone().fold(10_000.0, |most, n| n.error.max(most));
        let texel = below.filter_map(|node| node.texel).fold(0.0, f32::max);
        let growth = [1.5, 2.0, 3.0, 4.0][self.random.below(4) as usize];
        let count = group.len();
        let members = (count / 2).max(1);
        let ends = |member: usize| member * count / members..(member + 1) * count / members;
        for member in 1..members {
            let seam = group[ends(member).start].lines.start;
            let step = &mut self.steps[seam as usize];
            *step = (2 * *step).min(ROWS);
        }
        let lines = |member: usize| {
            let columns = &group[ends(member)];
            columns[0].lines.start..columns[columns.len() - 1].lines.end
        };
        (0..members)
            .map(|member| {
                let column = self.column(lines(member), growth * error, 4.0 * texel);
                self.nodes[column.node].children.clone_from(&children);
                column
            })
            .collect()
    }

    /// Adds a node between two borders, as these are now.
    fn column(&mut self, lines: Range<u32>, error: f32, texel: f32) -> Column {
        let border = |line: u32| {
            let step = self.steps[line as usize] as usize;
            (0..=ROWS).step_by(step).map(move |row| (2 * line, row))
        };
        let outline =
            border(lines.end).chain(border(lines.start).collect::<Vec<_>>().into_iter().rev());
        let places: Vec<(u32, u32)> = [(lines.start + lines.end, ROWS / 2)]
            .into_iter()
            .chain(outline)
            .collect();
        let mut mesh = ClusterMesh::default();
        for &(x, y) in &places {
            mesh.positions.push(point(x, y));
            mesh.normals.push(normal(x, y));
            mesh.colours.push([90, 140, 200]);
        }
        let last = u8::try_from(places.len() - 1).unwrap_or(u8::MAX);
        let next = |corner: u8| if corner == last { 1 } else { corner + 1 };
        mesh.triangles = (1..=last).map(|corner| [0, corner, next(corner)]).collect();
        mesh.texture = self.frame.map(|frame| ClusterTexture {
            places: (0u8..16)
                .cycle()
                .map(|k| [k, 15 - k])
                .take(places.len())
                .collect(),
            frame: frame.to_vec(),
        });
        self.nodes.push(ClusterInput {
            mesh,
            error,
            texel: self.frame.map(|_| texel),
            children: Vec::new(),
        });
        Column {
            lines,
            node: self.nodes.len() - 1,
        }
    }
}

/// The normal there: waves that coarser columns show less of.
fn normal(x: u32, y: u32) -> [u8; 2] {
    let wave = |at: u32, length: f32| (std::f32::consts::TAU * at as f32 / length).sin();
    octahedral::encode([0.6 * wave(x, 25.0), 0.4 * wave(y, 23.0), 1.0])
}

/// A point of the wall, which is a little rough.
fn point(x: u32, y: u32) -> LatticePoint {
    let rough = (x * 7919 + y * 104_729) % 257;
    [x * UNIT, y * UNIT, 100_000 + 4 * rough]
}
