//! Border curves between regions, and the triangles of every region cut along them.

use super::QuadrangulateError;
use crate::atlas::patch::{Attributes, Border};
use crate::mesh::{ManifoldMesh, NONE};
use crate::segment::Segmentation;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Surface points: the mesh's vertices first, then those that cutting adds.
#[derive(Debug, Default)]
pub(super) struct Points {
    pub(super) positions: Vec<DVec3>,
    pub(super) attributes: Vec<Attributes>,
}

impl Points {
    fn new(mesh: &ManifoldMesh) -> Self {
        let mut attributes: Vec<Attributes> = (0..mesh.positions.len())
            .map(|v| Attributes {
                normal: mesh.normals.get(v).map_or(Vec3::ZERO, |n| n.as_vec3()),
                colour: mesh
                    .colours
                    .get(v)
                    .map_or(Vec3::ZERO, |&c| crate::atlas::colour::linear_from_srgb(c)),
                cap: 0.0,
            })
            .collect();
        for &apex in &mesh.cap_apexes {
            attributes[apex as usize].cap = 1.0;
        }
        Self {
            positions: mesh.positions.clone(),
            attributes,
        }
    }

    fn push(&mut self, position: DVec3, attributes: Attributes) -> u32 {
        let id = u32::try_from(self.positions.len()).unwrap_or(NONE);
        self.positions.push(position);
        self.attributes.push(attributes);
        id
    }

    /// Adds the point at `f` (0..=1) from `a` to `b`.
    pub(super) fn mix(&mut self, a: u32, b: u32, f: f64) -> u32 {
        let (a, b) = (a as usize, b as usize);
        let position = self.positions[a].lerp(self.positions[b], f);
        let attributes = mix(&self.attributes[a], &self.attributes[b], f);
        self.push(position, attributes)
    }

    /// Adds the mean of `ids`.
    pub(super) fn mean(&mut self, ids: &[u32]) -> u32 {
        let n = ids.len() as f64;
        let position = ids
            .iter()
            .map(|&i| self.positions[i as usize])
            .sum::<DVec3>()
            / n;
        let attributes = mean(ids.iter().map(|&i| &self.attributes[i as usize]));
        self.push(position, attributes)
    }

    /// The border curve through `ids`, parametrized by arc length.
    pub(super) fn border(&self, ids: &[u32]) -> Border {
        border(
            ids.iter().map(|&i| self.positions[i as usize]).collect(),
            ids.iter().map(|&i| self.attributes[i as usize]).collect(),
        )
    }
}

/// Attributes at `f` from `a` to `b`.
pub(super) fn mix(a: &Attributes, b: &Attributes, f: f64) -> Attributes {
    #[expect(clippy::cast_possible_truncation, reason = "a weight in 0..=1")]
    let f = f as f32;
    Attributes {
        normal: a.normal.lerp(b.normal, f).normalize_or_zero(),
        colour: a.colour.lerp(b.colour, f),
        cap: a.cap + (b.cap - a.cap) * f,
    }
}

/// Mean of some attributes.
pub(super) fn mean<'a>(of: impl Iterator<Item = &'a Attributes>) -> Attributes {
    let (mut normal, mut colour, mut cap, mut n) = (Vec3::ZERO, Vec3::ZERO, 0.0f32, 0.0f32);
    for a in of {
        normal += a.normal;
        colour += a.colour;
        cap += a.cap;
        n += 1.0;
    }
    Attributes {
        normal: normal.normalize_or_zero(),
        colour: colour / n.max(1.0),
        cap: cap / n.max(1.0),
    }
}

/// A border through `points`, parametrized by arc length, strictly increasing even where points coincide.
pub(super) fn border(points: Vec<DVec3>, attributes: Vec<Attributes>) -> Border {
    let segments: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
    let total: f64 = segments.iter().sum();
    // Coincident points still need different parameters.
    let floor = if total > 0.0 {
        1e-6 * total / segments.len() as f64
    } else {
        1.0
    };
    let total: f64 = segments.iter().map(|s| s.max(floor)).sum();
    let mut params = Vec::with_capacity(points.len());
    let mut at = 0.0;
    params.push(0.0);
    for s in &segments {
        at += s.max(floor);
        params.push(at / total);
    }
    if let Some(last) = params.last_mut() {
        *last = 1.0;
    }
    Border {
        points,
        attributes,
        params,
    }
}

/// The whole border curve between two regions, from corner to corner.
#[derive(Debug)]
pub(super) struct Arc {
    pub(super) points: Vec<u32>,
    /// Index into `points` of the middle; neither end.
    pub(super) middle: usize,
    left: u32,
    /// [`NONE`] along an open border.
    right: u32,
}

/// One region: its triangles, and its sides counter-clockwise.
#[derive(Debug, Default)]
pub(super) struct Outline {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Arc, and whether it runs counter-clockwise around this region.
    pub(super) sides: Vec<(u32, bool)>,
}

/// The mesh, cut along the region borders.
#[derive(Debug)]
pub(super) struct Cut {
    pub(super) points: Points,
    pub(super) arcs: Vec<Arc>,
    pub(super) regions: Vec<Outline>,
}

fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

struct Tracer<'a> {
    mesh: &'a ManifoldMesh,
    labels: &'a [u32],
    /// Point where a half-edge is cut, [`NONE`] where its ends have one label.
    cuts: Vec<u32>,
    /// Point in the middle of a triangle of three labels.
    centres: Vec<u32>,
}

impl Tracer<'_> {
    fn start(&self, h: u32) -> u32 {
        self.mesh.triangles[h as usize / 3][h as usize % 3]
    }

    fn twin(&self, h: u32) -> u32 {
        self.mesh.twins[h as usize]
    }

    fn label(&self, vertex: u32) -> u32 {
        self.labels[vertex as usize]
    }

    /// Follows the border that leaves a triangle through half-edge `h`, to its end.
    fn trace(&self, mut h: u32, points: &mut Vec<u32>, visited: &mut [bool]) {
        loop {
            visited[h as usize] = true;
            points.push(self.cuts[h as usize]);
            let twin = self.twin(h);
            if twin == NONE {
                return;
            }
            visited[twin as usize] = true;
            let centre = self.centres[twin as usize / 3];
            if centre != NONE {
                points.push(centre);
                return;
            }
            let (a, b) = (next(twin), next(next(twin)));
            h = if self.cuts[a as usize] == NONE { b } else { a };
            if visited[h as usize] {
                return;
            }
        }
    }

    fn interior_arcs(&self) -> Vec<Arc> {
        let mut visited = vec![false; self.cuts.len()];
        let mut arcs = Vec::new();
        let half_edges = u32::try_from(self.cuts.len()).unwrap_or(NONE);
        // From open borders inwards first: an arc with an open end is then found from that end.
        for h in 0..half_edges {
            if self.cuts[h as usize] == NONE || self.twin(h) != NONE || visited[h as usize] {
                continue;
            }
            visited[h as usize] = true;
            let mut points = vec![self.cuts[h as usize]];
            let centre = self.centres[h as usize / 3];
            if centre == NONE {
                let (a, b) = (next(h), next(next(h)));
                let out = if self.cuts[a as usize] == NONE { b } else { a };
                self.trace(out, &mut points, &mut visited);
            } else {
                points.push(centre);
            }
            let (left, right) = (self.label(self.start(h)), self.label(self.start(next(h))));
            arcs.push(Arc {
                points,
                middle: 0,
                left,
                right,
            });
        }
        for h in 0..half_edges {
            let centre = self.centres[h as usize / 3];
            if centre == NONE || visited[h as usize] {
                continue;
            }
            let mut points = vec![centre];
            self.trace(h, &mut points, &mut visited);
            let (left, right) = (self.label(self.start(next(h))), self.label(self.start(h)));
            arcs.push(Arc {
                points,
                middle: 0,
                left,
                right,
            });
        }
        arcs
    }

    /// The open half-edge that starts where the open half-edge `h` ends.
    fn next_open(&self, h: u32) -> u32 {
        let mut n = next(h);
        while self.twin(n) != NONE {
            n = next(self.twin(n));
        }
        n
    }

    fn open_arcs(&self, arcs: &mut Vec<Arc>) {
        let half_edges = u32::try_from(self.cuts.len()).unwrap_or(NONE);
        for h in 0..half_edges {
            if self.twin(h) != NONE || self.cuts[h as usize] == NONE {
                continue;
            }
            let left = self.label(self.start(next(h)));
            let mut points = vec![self.cuts[h as usize]];
            let mut at = h;
            loop {
                points.push(self.start(next(at)));
                at = self.next_open(at);
                if self.cuts[at as usize] != NONE {
                    points.push(self.cuts[at as usize]);
                    break;
                }
            }
            arcs.push(Arc {
                points,
                middle: 0,
                left,
                right: NONE,
            });
        }
    }
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Cosine of the turn from which a point of an open border is a corner of the surface.
const CORNER: f64 = 0.85;

/// The sharpest corner of an open border that does not leave one half too short; samples then meet it exactly.
fn open_corner(arc: &Arc, points: &Points) -> Option<usize> {
    let at = |i: usize| points.positions[arc.points[i] as usize];
    let mut lengths = vec![0.0];
    for i in 1..arc.points.len() {
        lengths.push(lengths[i - 1] + at(i - 1).distance(at(i)));
    }
    let total = lengths.last().copied().unwrap_or(0.0);
    let turn = |i: usize| {
        let (before, after) = (
            (at(i) - at(i - 1)).normalize_or_zero(),
            (at(i + 1) - at(i)).normalize_or_zero(),
        );
        before.dot(after)
    };
    (1..arc.points.len().saturating_sub(1))
        .filter(|&i| (0.1 * total..0.9 * total).contains(&lengths[i]))
        .map(|i| (turn(i), i))
        .filter(|&(turn, _)| turn < CORNER)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, i)| i)
}

/// Finds or makes the middle of `arc`.
fn set_middle(arc: &mut Arc, points: &mut Points, middles: &mut HashMap<(u32, u32), u32>) {
    if let Some(corner) = (arc.right == NONE)
        .then(|| open_corner(arc, points))
        .flatten()
    {
        arc.middle = corner;
        return;
    }
    let at = |i: u32| points.positions[i as usize];
    let lengths: Vec<f64> = arc
        .points
        .windows(2)
        .map(|w| at(w[0]).distance(at(w[1])))
        .collect();
    let half = 0.5 * lengths.iter().sum::<f64>();
    let mut before = 0.0;
    let mut segment = lengths.len() / 2;
    let mut f = 0.5;
    for (i, &l) in lengths.iter().enumerate() {
        if before + l >= half && l > 0.0 {
            segment = i;
            f = (half - before) / l;
            break;
        }
        before += l;
    }
    // A middle close to a point of the curve is that point: no slivers.
    if f < 0.2 && segment > 0 {
        arc.middle = segment;
        return;
    }
    if f > 0.8 && segment + 2 < arc.points.len() {
        arc.middle = segment + 1;
        return;
    }
    let (a, b) = (arc.points[segment], arc.points[segment + 1]);
    let middle = points.mix(a, b, f.clamp(0.2, 0.8));
    middles.insert(key(a, b), middle);
    arc.points.insert(segment + 1, middle);
    arc.middle = segment + 1;
}

/// Cuts `mesh` along the borders of its regions.
pub(super) fn cut(
    mesh: &ManifoldMesh,
    segmentation: &Segmentation,
) -> Result<Cut, QuadrangulateError> {
    let labels = &segmentation.labels;
    let mut points = Points::new(mesh);
    let mut cuts = vec![NONE; 3 * mesh.triangles.len()];
    let mut centres = vec![NONE; mesh.triangles.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| labels[v as usize]);
        if a == b && b == c {
            continue;
        }
        for k in 0..3 {
            let (v, w) = (triangle[k], triangle[(k + 1) % 3]);
            let h = 3 * t + k;
            let twin = mesh.twins[h];
            if labels[v as usize] == labels[w as usize] || cuts[h] != NONE {
                continue;
            }
            let f = f64::from(segmentation.crossings.get(h).copied().unwrap_or(0.5));
            cuts[h] = points.mix(v, w, f);
            if twin != NONE {
                cuts[twin as usize] = cuts[h];
            }
        }
        if a != b && b != c && c != a {
            centres[t] = points.mean(&[cuts[3 * t], cuts[3 * t + 1], cuts[3 * t + 2]]);
        }
    }
    let tracer = Tracer {
        mesh,
        labels,
        cuts,
        centres,
    };
    let mut arcs = tracer.interior_arcs();
    tracer.open_arcs(&mut arcs);
    let mut middles = HashMap::new();
    for arc in &mut arcs {
        set_middle(arc, &mut points, &mut middles);
    }
    let mut regions: Vec<Outline> = (0..segmentation.regions)
        .map(|_| Outline::default())
        .collect();
    push_triangles(&tracer, &mut points, &middles, &mut regions);
    order_sides(&arcs, &mut regions)?;
    Ok(Cut {
        points,
        arcs,
        regions,
    })
}

/// Gives every region its pieces of the mesh's triangles.
fn push_triangles(
    tracer: &Tracer<'_>,
    points: &mut Points,
    middles: &HashMap<(u32, u32), u32>,
    regions: &mut [Outline],
) {
    let mut polygon: Vec<u32> = Vec::with_capacity(8);
    let mut push = |points: &mut Points, region: u32, corners: &[u32]| {
        let triangles = &mut regions[region as usize].triangles;
        polygon.clear();
        for (i, &p) in corners.iter().enumerate() {
            polygon.push(p);
            if let Some(&m) = middles.get(&key(p, corners[(i + 1) % corners.len()])) {
                polygon.push(m);
            }
        }
        let p = &polygon;
        if p.len() > corners.len() {
            // A middle is collinear with its neighbours: fan from inside.
            let centre = points.mean(corners);
            for i in 0..p.len() {
                triangles.push([centre, p[i], p[(i + 1) % p.len()]]);
            }
        } else if let [a, b, c, d] = p[..] {
            let at = |i: u32| points.positions[i as usize];
            if at(a).distance_squared(at(c)) <= at(b).distance_squared(at(d)) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        } else {
            triangles.push([p[0], p[1], p[2]]);
        }
    };
    for (t, &triangle) in tracer.mesh.triangles.iter().enumerate() {
        let label = triangle.map(|v| tracer.label(v));
        let cut = |k: usize| tracer.cuts[3 * t + k];
        if label[0] == label[1] && label[1] == label[2] {
            push(points, label[0], &triangle);
        } else if tracer.centres[t] != NONE {
            for k in 0..3 {
                push(
                    points,
                    label[k],
                    &[triangle[k], cut(k), tracer.centres[t], cut((k + 2) % 3)],
                );
            }
        } else {
            // The corner that is alone, then the two that are together.
            let k = (0..3)
                .find(|&k| label[(k + 1) % 3] == label[(k + 2) % 3])
                .unwrap_or(0);
            let (a, b, c) = (triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
            let (ab, ca) = (cut(k), cut((k + 2) % 3));
            push(points, label[k], &[a, ab, ca]);
            push(points, label[(k + 1) % 3], &[ab, b, c, ca]);
        }
    }
}

/// Orders every region's sides counter-clockwise.
fn order_sides(arcs: &[Arc], regions: &mut [Outline]) -> Result<(), QuadrangulateError> {
    for (i, arc) in arcs.iter().enumerate() {
        let i = u32::try_from(i).unwrap_or(NONE);
        regions[arc.left as usize].sides.push((i, true));
        if arc.right != NONE {
            regions[arc.right as usize].sides.push((i, false));
        }
    }
    for (id, region) in regions.iter_mut().enumerate() {
        let fault = |fault| QuadrangulateError::Structure {
            region: u32::try_from(id).unwrap_or(NONE),
            fault,
        };
        let ends = |&(arc, forward): &(u32, bool)| {
            let p = &arcs[arc as usize].points;
            let (first, last) = (p[0], p[p.len() - 1]);
            if forward {
                (first, last)
            } else {
                (last, first)
            }
        };
        if region.sides.len() < 3 {
            return Err(fault("fewer than three sides"));
        }
        let mut ordered = vec![region.sides[0]];
        while ordered.len() < region.sides.len() {
            let end = ends(&ordered[ordered.len() - 1]).1;
            let following = region
                .sides
                .iter()
                .find(|s| ends(s).0 == end && !ordered.contains(s));
            ordered.push(*following.ok_or_else(|| fault("its sides are not one loop"))?);
        }
        if ends(&ordered[ordered.len() - 1]).1 != ends(&ordered[0]).0 {
            return Err(fault("its sides do not close"));
        }
        region.sides = ordered;
    }
    Ok(())
}
