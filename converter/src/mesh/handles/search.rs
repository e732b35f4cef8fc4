//! The shortest loops that do not separate, near given places.

use crate::mesh::adjacency::{UnionFind, end, id, previous, start};
use crate::mesh::caps::{self, Loop};
use crate::mesh::fans::Fans;
use crate::mesh::{ManifoldMesh, NONE};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Radius of the balls that are searched, in cap distances. A circle's length is 2π of its radii, and a ball around one of its points
/// holds it from half of that on; the rest is for places beside the handle.
const BALL_RADII: f64 = 6.0;

/// Disjoint loops that together do not separate, and that caps nowhere farther than `distance` can close, found near
/// `places` (half-edges). Also the first edges of those that are left, for they meet others or separate with them.
pub(super) fn loops(mesh: &ManifoldMesh, places: &[u32], distance: f64) -> (Vec<Loop>, Vec<u32>) {
    let mut search = Search::of(mesh, BALL_RADII * distance);
    let mut found: Vec<(f64, Loop)> = Vec::new();
    for &place in places {
        let root = start(&mesh.triangles, place);
        let Some(mut best) = search.through(root) else {
            continue;
        };
        // The shortest loop is found from its own vertices.
        loop {
            let quarter = best.1.len().div_ceil(4).max(1);
            let roots: Vec<u32> = best.1.iter().copied().step_by(quarter).collect();
            let better = roots
                .into_iter()
                .filter_map(|h| search.through(start(&mesh.triangles, h)))
                .min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
            match better {
                Some(better) if better.0 < best.0 * (1.0 - 1e-9) => best = better,
                _ => break,
            }
        }
        if caps::distance(mesh, &best.1, distance) <= distance {
            found.push(best);
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    let mut accepted = Vec::new();
    let mut left = Vec::new();
    for (_, path) in found {
        if search.is_free(&path) && !search.separates(&path) {
            search.accept(&path);
            accepted.push(path);
        } else {
            left.push(path[0]);
        }
    }
    (accepted, left)
}

struct Search<'a> {
    mesh: &'a ManifoldMesh,
    fans: Fans,
    radius: f64,
    /// Vertices that no loop may use: those of open borders, and of loops accepted.
    blocked: Vec<bool>,
    /// Half-edges on accepted loops, and their twins.
    barrier: Vec<bool>,
    distance: Vec<f64>,
    /// Half-edge from the vertex before, for what the last ball holds.
    parent: Vec<u32>,
    /// Triangles of the last ball, by local number.
    local: Vec<u32>,
    /// Number of the last flood that reached a triangle.
    reached: Vec<u32>,
    floods: u32,
}

impl<'a> Search<'a> {
    fn of(mesh: &'a ManifoldMesh, radius: f64) -> Self {
        let fans = Fans::of(mesh);
        let vertices = mesh.positions.len();
        Self {
            blocked: (0..id(vertices)).map(|v| fans.is_open(mesh, v)).collect(),
            fans,
            mesh,
            radius,
            barrier: vec![false; mesh.twins.len()],
            distance: vec![f64::INFINITY; vertices],
            parent: vec![NONE; vertices],
            local: vec![NONE; mesh.triangles.len()],
            reached: vec![0; mesh.triangles.len()],
            floods: 0,
        }
    }

    fn start(&self, h: u32) -> u32 {
        start(&self.mesh.triangles, h)
    }

    fn end(&self, h: u32) -> u32 {
        end(&self.mesh.triangles, h)
    }

    fn length(&self, h: u32) -> f64 {
        let at = |v: u32| self.mesh.positions[v as usize];
        at(self.start(h)).distance(at(self.end(h)))
    }

    /// The shortest loop within the ball around `root` that does not separate, of those that two shortest paths from the
    /// root and one edge make.
    fn through(&mut self, root: u32) -> Option<(f64, Loop)> {
        if self.blocked[root as usize] {
            return None;
        }
        let ball = self.shortest_paths(root);
        let mut candidates: Vec<(f64, Loop)> = self
            .leftover(&ball)
            .into_iter()
            .map(|h| self.closed_by(h))
            .collect();
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        for &v in &ball {
            self.distance[v as usize] = f64::INFINITY;
            self.parent[v as usize] = NONE;
        }
        candidates
            .into_iter()
            .find(|(_, path)| !self.separates(path))
    }

    /// Dijkstra's algorithm up to the radius; returns the vertices reached.
    fn shortest_paths(&mut self, root: u32) -> Vec<u32> {
        let mut ball = Vec::new();
        let mut front = BinaryHeap::new();
        self.distance[root as usize] = 0.0;
        ball.push(root);
        front.push(Reverse((0, root)));
        let mesh = self.mesh;
        while let Some(Reverse((bits, v))) = front.pop() {
            let so_far = f64::from_bits(bits);
            if so_far > self.distance[v as usize] {
                continue;
            }
            let Self {
                fans,
                blocked,
                distance,
                parent,
                radius,
                ..
            } = &mut *self;
            fans.each(mesh, v, |h, w| {
                let length = mesh.positions[v as usize].distance(mesh.positions[w as usize]);
                let through = so_far + length;
                let known = &mut distance[w as usize];
                if through < *known && through <= *radius && !blocked[w as usize] {
                    if *known == f64::INFINITY {
                        ball.push(w);
                    }
                    *known = through;
                    parent[w as usize] = h;
                    front.push(Reverse((through.to_bits(), w)));
                }
            });
        }
        ball
    }

    /// Half-edges of the ball that neither the paths nor a spanning tree of its faces hold, all outside being one face.
    fn leftover(&mut self, ball: &[u32]) -> Vec<u32> {
        let mesh = self.mesh;
        let mut triangles = Vec::new();
        for &v in ball {
            let first = self.fans.0[v as usize];
            let mut h = first;
            loop {
                let t = h / 3;
                let inside = mesh.triangles[t as usize]
                    .iter()
                    .all(|&w| self.distance[w as usize] < f64::INFINITY);
                if inside && self.local[t as usize] == NONE {
                    self.local[t as usize] = id(triangles.len());
                    triangles.push(t);
                }
                h = mesh.twins[previous(h) as usize];
                if h == first || h == NONE {
                    break;
                }
            }
        }
        let mut faces = UnionFind::new(triangles.len() + 1);
        let outside = id(triangles.len());
        let mut edges = Vec::new();
        for (own, &t) in (0_u32..).zip(&triangles) {
            for h in [3 * t, 3 * t + 1, 3 * t + 2] {
                let twin = mesh.twins[h as usize];
                let (a, b) = (self.start(h), self.end(h));
                if self.parent[b as usize] == h || self.parent[a as usize] == twin {
                    continue;
                }
                let beyond = if twin == NONE {
                    NONE
                } else {
                    self.local[twin as usize / 3]
                };
                if beyond == NONE {
                    faces.union(own, outside);
                } else if h < twin {
                    let length =
                        self.distance[a as usize] + self.distance[b as usize] + self.length(h);
                    edges.push((Reverse(length.to_bits()), h, own, beyond));
                }
            }
        }
        edges.sort_unstable();
        let mut left = Vec::new();
        for (_, h, a, b) in edges {
            let (a, b) = (faces.find(a), faces.find(b));
            if a == b {
                left.push(h);
            } else {
                faces.union(a, b);
            }
        }
        for t in triangles {
            self.local[t as usize] = NONE;
        }
        left
    }

    /// The loop that `h` closes with the paths to its ends, without what these have in common.
    fn closed_by(&self, h: u32) -> (f64, Loop) {
        let way = |mut v: u32| {
            let mut way = Vec::new();
            while self.parent[v as usize] != NONE {
                way.push(self.parent[v as usize]);
                v = self.start(self.parent[v as usize]);
            }
            way
        };
        let (mut to, mut from) = (way(self.start(h)), way(self.end(h)));
        while to.last().is_some() && to.last() == from.last() {
            to.pop();
            from.pop();
        }
        to.reverse();
        to.push(h);
        to.extend(from.iter().map(|&h| self.mesh.twins[h as usize]));
        let length = to.iter().map(|&h| self.length(h)).sum();
        (length, to)
    }

    fn is_free(&self, path: &[u32]) -> bool {
        path.iter().all(|&h| !self.blocked[self.start(h) as usize])
    }

    fn accept(&mut self, path: &[u32]) {
        for &h in path {
            let v = self.start(h);
            self.blocked[v as usize] = true;
            self.set_barrier(h, true);
        }
    }

    fn set_barrier(&mut self, h: u32, to: bool) {
        self.barrier[h as usize] = to;
        self.barrier[self.mesh.twins[h as usize] as usize] = to;
    }

    /// Whether a loop, with those accepted, cuts the surface in two: floods from both sides until they meet or one ends.
    fn separates(&mut self, path: &[u32]) -> bool {
        for &h in path {
            self.set_barrier(h, true);
        }
        self.floods += 2;
        let sides = [self.floods, self.floods + 1];
        let mut queues = [path[0], self.mesh.twins[path[0] as usize]].map(|h| vec![h / 3]);
        let mut at = [0, 0];
        for (side, queue) in sides.iter().zip(&queues) {
            self.reached[queue[0] as usize] = *side;
        }
        let separates = 'flood: loop {
            for side in 0..2 {
                let Some(&t) = queues[side].get(at[side]) else {
                    break 'flood true;
                };
                at[side] += 1;
                for h in [3 * t, 3 * t + 1, 3 * t + 2] {
                    let twin = self.mesh.twins[h as usize];
                    if twin == NONE || self.barrier[h as usize] {
                        continue;
                    }
                    let beyond = twin / 3;
                    let reached = &mut self.reached[beyond as usize];
                    if *reached == sides[1 - side] {
                        break 'flood false;
                    }
                    if *reached != sides[side] {
                        *reached = sides[side];
                        queues[side].push(beyond);
                    }
                }
            }
        };
        for &h in path {
            self.set_barrier(h, false);
        }
        separates
    }
}
