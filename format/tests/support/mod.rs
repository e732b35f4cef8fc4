//! Small atlases made from formulas.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unnecessary_wraps,
    clippy::manual_midpoint,
    reason = "every test binary uses a part of this"
)]

pub mod assemble;

use marquetry_format::writer::{ChartInput, ClusterInput, Content, NodeInput, write, write_atlas};
use marquetry_format::*;

/// Position in the unit cube, normal, colour.
pub type Surface = ([f64; 3], [f32; 3], [u8; 3]);

/// Largest coordinate of the lattice.
pub const LAST: f64 = ((1 << 21) - 1) as f64;

/// An atlas to be made.
pub struct Model<'a> {
    pub glue: Vec<[Option<Glue>; 4]>,
    /// By chart, u, v in 0..=1.
    pub surface: &'a dyn Fn(usize, f64, f64) -> Surface,
    /// Finest resolution of a chart's root.
    pub resolution: &'a dyn Fn(usize) -> u8,
    /// Whether a node has children.
    pub split: &'a dyn Fn(NodeId) -> bool,
    pub shift: u8,
    pub has_colours: bool,
}

/// A model of clusters alone.
pub fn without_charts(shift: u8, has_colours: bool) -> Model<'static> {
    Model {
        glue: Vec::new(),
        surface: &strip,
        resolution: &|_| 2,
        split: &never,
        shift,
        has_colours,
    }
}

impl Model<'_> {
    pub fn lattice(&self) -> Lattice {
        Lattice {
            origin: [-1.0, -1.0, -1.0],
            step: 2.0 / LAST,
            shift: self.shift,
        }
    }

    pub fn metadata(&self) -> Metadata {
        Metadata {
            kind: ContentKind::Scan,
            lattice: self.lattice(),
            bounds_min: [-1.0; 3],
            bounds_max: [1.0; 3],
            up_axis: 1,
            has_colours: self.has_colours,
            target_error_rel: 1e-4,
            max_error_rel: 2e-4,
            rms_error_rel: 5e-5,
            source_triangles: 12,
            source_vertices: 8,
            source_name: "formula".to_owned(),
            generator: "marquetry-format tests".to_owned(),
        }
    }

    pub fn charts(&self) -> Vec<ChartInput> {
        let chart = |(chart, glue): (usize, &[Option<Glue>; 4])| {
            let root = self.node(NodeId::root(ChartId(chart as u32)));
            ChartInput { glue: *glue, root }
        };
        self.glue.iter().enumerate().map(chart).collect()
    }

    fn node(&self, id: NodeId) -> NodeInput {
        let chart = id.chart.0 as usize;
        let resolution = if id.level == 0 {
            (self.resolution)(chart)
        } else {
            5
        };
        let mut samples = PageSamples {
            resolution,
            ..PageSamples::default()
        };
        let cells = f64::from(1u32 << resolution);
        let nodes = f64::from(1u32 << id.level);
        for j in 0..samples.side() {
            for i in 0..samples.side() {
                let u = (f64::from(id.x) + i as f64 / cells) / nodes;
                let v = (f64::from(id.y) + j as f64 / cells) / nodes;
                let (point, normal, colour) = (self.surface)(chart, u, v);
                samples.positions.push(point.map(|c| {
                    let unit = f64::from(1u32 << self.shift);
                    (((c * LAST / unit).round() * unit) as u32)
                        .min(((1 << 21) - 1) >> self.shift << self.shift)
                }));
                samples.normals.push(octahedral::encode(normal));
                if self.has_colours {
                    samples.colours.push(colour);
                }
            }
        }
        let error = |r: u8| 5e5 / 4f32.powi(i32::from(id.level + r));
        let errors = if id.level == 0 {
            (0..=resolution).map(error).collect()
        } else {
            vec![error(5)]
        };
        let (_, axis, _) = (self.surface)(
            chart,
            (f64::from(id.x) + 0.5) / nodes,
            (f64::from(id.y) + 0.5) / nodes,
        );
        let children = (self.split)(id).then(|| {
            Box::new([0, 1, 2, 3].map(|quadrant| self.node(id.child(Quadrant(quadrant)))))
        });
        NodeInput {
            samples,
            errors,
            cone: NormalCone { axis, cos: 0.9 },
            children,
        }
    }

    pub fn write_with(&self, clusters: &[ClusterInput]) -> Result<Vec<u8>, Error> {
        let mut out = Vec::new();
        let charts = self.charts();
        let content = Content {
            charts: &charts,
            clusters,
            ..Content::default()
        };
        let parts = write(&self.metadata(), &self.lattice(), &content, &mut out)?;
        assert_eq!(parts.total, out.len() as u64);
        assert_eq!(parts, open(&out).bytes_by_part());
        Ok(out)
    }

    pub fn write(&self) -> Result<Vec<u8>, Error> {
        let mut out = Vec::new();
        let parts = write_atlas(&self.metadata(), &self.lattice(), &self.charts(), &mut out)?;
        assert_eq!(parts.total, out.len() as u64);
        assert_eq!(
            parts.total,
            parts.header + parts.index + parts.geometry + parts.normals + parts.colour
        );
        Ok(out)
    }
}

/// Tetrahedra along a line: 4 leaves of 5 below 2 nodes below a root, coarser ones with fewer; level by level.
pub fn clusters(shift: u8, has_colours: bool) -> Vec<ClusterInput> {
    let node = |tetrahedra: &[u32], error: f32, children: &[u32]| ClusterInput {
        mesh: tetrahedra_of(tetrahedra, shift, has_colours),
        error,
        texel: None,
        children: children.to_vec(),
    };
    let inner =
        |n: u32, children: &[u32]| node(&[0, 2, 5, 8].map(|k| 10 * n + k), 30_000.0, children);
    let leaf = |n: u32| node(&[0, 1, 2, 3, 4].map(|k| 5 * n + k), 0.5, &[]);
    vec![
        node(&[0, 6, 13, 19], 90_000.0, &[1, 2]),
        inner(0, &[3, 4]),
        inner(1, &[5, 6]),
        leaf(0),
        leaf(1),
        leaf(2),
        leaf(3),
    ]
}

/// Tetrahedra along a line in groups of several members, level by level: {1, 4} with the children 7 and 8, {2, 3} with 5 and 6, and
/// {6, 7}, a child of each, with 11 and 12; 5 alone with 9 and 10. 8 is a leaf.
pub fn grouped_clusters(shift: u8, has_colours: bool) -> Vec<ClusterInput> {
    let node = |tetrahedra: &[u32], error: f32, children: &[u32]| ClusterInput {
        mesh: tetrahedra_of(tetrahedra, shift, has_colours),
        error,
        texel: None,
        children: children.to_vec(),
    };
    let leaf = |first: u32| node(&[0, 1, 2, 3, 4].map(|k| first + k), 0.5, &[]);
    vec![
        node(&[0, 10, 16, 22], 90_000.0, &[1, 2, 3, 4]),
        node(&[16], 40_000.0, &[7, 8]),
        node(&[0, 5], 30_000.0, &[5, 6]),
        node(&[10], 30_000.0, &[5, 6]),
        node(&[22], 40_000.0, &[7, 8]),
        node(&[0, 2, 5, 8], 10_000.0, &[9, 10]),
        node(&[10, 13], 12_000.0, &[11, 12]),
        node(&[16, 19], 12_000.0, &[11, 12]),
        leaf(20),
        leaf(0),
        leaf(5),
        leaf(10),
        leaf(15),
    ]
}

/// `nodes` with ranks that depend on the place, but for the root.
pub fn ranked(mut nodes: Vec<ClusterInput>) -> Vec<ClusterInput> {
    for node in &mut nodes[1..] {
        let rank = |[x, y, z]: &[u32; 3]| [0, 1, 0, 3, 255][(((x ^ y ^ z) >> 10) % 5) as usize];
        node.mesh.ranks = node.mesh.positions.iter().map(rank).collect();
    }
    nodes
}

/// `nodes` whose triangles have vertices of their own, every third with another normal.
pub fn cut_apart(mut nodes: Vec<ClusterInput>) -> Vec<ClusterInput> {
    for ClusterInput { mesh, .. } in &mut nodes {
        let whole = std::mem::take(mesh);
        for (vertex, corner) in (0u8..).zip(whole.triangles.as_flattened()) {
            let old = usize::from(*corner);
            let [u, v] = whole.normals[old];
            mesh.positions.push(whole.positions[old]);
            mesh.normals.push([u, v ^ u8::from(vertex % 3 == 0)]);
            mesh.colours.extend(whole.colours.get(old));
            mesh.ranks.extend(whole.ranks.get(old));
            if vertex % 3 == 2 {
                mesh.triangles.push([vertex - 2, vertex - 1, vertex]);
            }
        }
    }
    nodes
}

/// These of the tetrahedra along a line.
fn tetrahedra_of(tetrahedra: &[u32], shift: u8, has_colours: bool) -> ClusterMesh {
    let mut mesh = ClusterMesh::default();
    for &n in tetrahedra {
        let first = mesh.positions.len() as u8;
        for [x, y, z] in [[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]] {
            let point = [9 * n + x, 2 * n + y, 500 - n + z];
            mesh.positions.push(point.map(|c| (c + 7) << shift));
            mesh.normals
                .push(octahedral::encode([1.0, y as f32, z as f32]));
            if has_colours {
                mesh.colours.push([(n * 9) as u8, 100, y as u8]);
            }
        }
        for [a, b, c] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            mesh.triangles.push([first + a, first + b, first + c]);
        }
    }
    mesh
}

pub fn glued(chart: u32, side: u8, reversed: bool) -> Option<Glue> {
    Some(Glue {
        chart: ChartId(chart),
        side: Side(side),
        reversed,
    })
}

pub fn never(_: NodeId) -> bool {
    false
}

fn normalized(p: [f64; 3]) -> [f64; 3] {
    let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    p.map(|c| c / length)
}

fn coloured(p: [f64; 3]) -> [u8; 3] {
    p.map(|c| (255.0 * (0.5 + 0.5 * (9.0 * c).sin())) as u8)
}

/// Corners of chart `chart` of the cube, counter-clockwise from outside, turned by `chart` quarters.
fn cube_corners(chart: usize) -> [[f64; 3]; 4] {
    let faces = [
        [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
        [[1, -1, 1], [1, -1, -1], [1, 1, -1], [1, 1, 1]],
        [[1, -1, -1], [-1, -1, -1], [-1, 1, -1], [1, 1, -1]],
        [[-1, -1, -1], [-1, -1, 1], [-1, 1, 1], [-1, 1, -1]],
        [[-1, 1, 1], [1, 1, 1], [1, 1, -1], [-1, 1, -1]],
        [[-1, -1, -1], [1, -1, -1], [1, -1, 1], [-1, -1, 1]],
    ];
    [0, 1, 2, 3].map(|corner| faces[chart][(corner + chart) % 4].map(f64::from))
}

/// Glue of the cube's six charts, found from their corners.
pub fn cube_glue() -> Vec<[Option<Glue>; 4]> {
    (0..6)
        .map(|chart| {
            let own = cube_corners(chart);
            [0, 1, 2, 3].map(|side| {
                (0..6)
                    .flat_map(|other| (0..4).map(move |to| (other, to)))
                    .find_map(|(other, to)| {
                        let theirs = cube_corners(other);
                        let meets =
                            own[side] == theirs[(to + 1) % 4] && own[(side + 1) % 4] == theirs[to];
                        meets.then_some(Glue {
                            chart: ChartId(other as u32),
                            side: Side(to as u8),
                            reversed: true,
                        })
                    })
            })
        })
        .collect()
}

/// A bumpy sphere over the cube.
pub fn cube_sphere(chart: usize, u: f64, v: f64) -> Surface {
    let corners = cube_corners(chart);
    // Exact for dyadic u and v, so that both charts of a border start from equal numbers.
    let p = [0, 1, 2].map(|k| {
        let [a, b, c, d] = corners.map(|corner| corner[k]);
        (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v
    });
    let n = normalized(p);
    let bump = 1.0 + 0.05 * (7.0 * n[0]).sin() * (5.0 * n[1] + 3.0 * n[2]).cos();
    (
        n.map(|c| 0.5 + 0.45 * c * bump),
        n.map(|c| c as f32),
        coloured(n),
    )
}

/// One chart glued to itself on both pairs of sides.
pub fn torus_glue() -> Vec<[Option<Glue>; 4]> {
    vec![[
        glued(0, 2, true),
        glued(0, 3, true),
        glued(0, 0, true),
        glued(0, 1, true),
    ]]
}

pub fn torus(_: usize, u: f64, v: f64) -> Surface {
    let (a, b) = (
        std::f64::consts::TAU * (u % 1.0),
        std::f64::consts::TAU * (v % 1.0),
    );
    let r = 0.3 + 0.12 * b.cos();
    let n = [b.cos() * a.cos(), b.cos() * a.sin(), b.sin()];
    (
        [0.5 + r * a.cos(), 0.5 + r * a.sin(), 0.5 + 0.12 * b.sin()],
        n.map(|c| c as f32),
        coloured(n),
    )
}

/// One chart whose ends meet with a half twist: not reversed glue, two open sides.
pub fn moebius_glue() -> Vec<[Option<Glue>; 4]> {
    vec![[None, glued(0, 3, false), None, glued(0, 1, false)]]
}

pub fn moebius(_: usize, u: f64, v: f64) -> Surface {
    let (u, v) = if u == 1.0 { (0.0, 1.0 - v) } else { (u, v) };
    let a = std::f64::consts::TAU * u;
    let w = 0.3 * (v - 0.5);
    let r = 0.3 + w * (a / 2.0).cos();
    // Not a normal, but equal at both ends, as a one-sided surface's cannot be.
    (
        [
            0.5 + r * a.cos(),
            0.5 + r * a.sin(),
            0.5 + w * (a / 2.0).sin(),
        ],
        [0.0, 0.0, 1.0],
        [a as u8, 0, 99],
    )
}

/// Two squares side by side, glued along one pair of sides, open elsewhere.
pub fn strip_glue() -> Vec<[Option<Glue>; 4]> {
    vec![
        [None, glued(1, 3, true), None, None],
        [None, None, None, glued(0, 1, true)],
    ]
}

pub fn strip(chart: usize, u: f64, v: f64) -> Surface {
    let x = (chart as f64 + u) / 2.0;
    let p = [x, v, 0.25 + 0.1 * (6.0 * x).sin() * (4.0 * v).cos()];
    (p, [0.0, 0.0, 1.0], coloured(p))
}

/// Every page of `document`, decoded, by page id.
pub fn decode_all(document: &Document, source: &dyn ByteSource) -> Vec<PageSamples> {
    let mut pages: Vec<PageSamples> = Vec::new();
    for page in (0..document.page_count()).map(PageId) {
        let bytes = source.read(document.page_range(page).unwrap()).unwrap();
        pages.push(match document.parent(page) {
            None => document.decode_root(ChartId(page.0), &bytes).unwrap(),
            Some((parent, quadrant)) => document
                .decode_child(page, quadrant, &pages[parent.0 as usize], &bytes)
                .unwrap(),
        });
    }
    pages
}

/// The mesh of every cluster, by number.
pub fn decode_clusters(document: &Document, source: &dyn ByteSource) -> Vec<ClusterMesh> {
    let nodes = document.clusters.iter().flat_map(|tree| &tree.nodes);
    (0..)
        .map(ClusterId)
        .zip(nodes)
        .map(|(id, node)| {
            let bytes = source.read(node.range.clone()).unwrap();
            document.decode_cluster(id, &bytes).unwrap()
        })
        .collect()
}

/// A mesh's triangles as what `value` says of their corners; the order of triangles, and which corner comes first, are the writer's.
pub fn triangles_of<T: Ord + Copy>(mesh: &ClusterMesh, value: impl Fn(usize) -> T) -> Vec<[T; 3]> {
    let turned = |t: &[u8; 3]| {
        let [a, b, c] = t.map(|v| value(usize::from(v)));
        [b, c, a].min([a, b, c]).min([c, a, b])
    };
    let mut triangles: Vec<[T; 3]> = mesh.triangles.iter().map(turned).collect();
    triangles.sort_unstable();
    triangles
}

pub fn open(bytes: &[u8]) -> Document {
    let source = SliceSource(bytes);
    let mut document = Document::open(&source, Limits::default()).unwrap();
    document.load_index(&source).unwrap();
    document
}
