//! Thin fingers, cut off along short loops of edges and capped.
//!
//! Range scans are full of what merging left behind: tubes and bubbles of a few dozen triangles on a neck of a few edges. No
//! flattening shows one (it shrinks by exp(2π) for every girth of length), and to give it regions of its own takes ten. Cut off
//! it is a small component, which becomes a cluster of its own triangles; the surface is closed by a fan, and every imported triangle
//! is still there.
//!
//! Method: whatever sticks out holds a vertex that is farthest from the root of a breadth-first search, compared with its neighbours.
//! Around each such tip a ball grows (Dijkstra, "A note on two problems in connexion with graphs", 1959). Where its edge is one loop,
//! and short for the area inside (a small isoperimetric quotient), that is a finger's neck.
//!
//! Limits: loops are paths of edges on the rim of a ball, longer than they could be; what has a wider girth than the
//! bound on caps allows stays, and so does what touches open borders.

use super::adjacency::{end, id, next, start};
use super::caps::{self, Caps, Loop};
use super::fans::{Fans, breadth_first};
use super::{ManifoldMesh, NONE};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Squared length of the rim over the area inside: 4π for a flat disk, 2π for a half sphere, girth over length for
/// a long tube. A tube of half its girth's length, which a flattening shrinks 20 times, has 2.
const QUOTIENT: f64 = 2.0;

/// Balls grow until their rim is so many times longer than a cap allows: bubbles are wider than their necks.
const WIDER: f64 = 3.0;

/// Vertices that a ball grows to at most.
const MOST_VERTICES: usize = 4096;

/// Vertices of the first ball that is tried, and how much more the next one has: a rim that touches itself is no loop, but one of
/// the next may be.
const FIRST: usize = 8;
const GROWTH: f64 = 1.03;

/// Edges that leave a ball are together so many times as long as its rim, for two leave from every edge of a rim that zigzags.
const LEAVING: f64 = 2.7;

/// How much the quotient of a ball may be above [`QUOTIENT`] by that estimate for its rim to be looked at.
const ESTIMATE: f64 = 2.0;

/// What cutting fingers did to a mesh.
#[derive(Debug, Clone, Default)]
pub struct Fingers {
    /// The cuts.
    pub caps: Caps,
    /// For every triangle of the mesh the finger that it is in, or [`NONE`].
    pub of: Vec<u32>,
}

/// Cuts off and caps fingers that a cap nowhere farther than `distance` (a length) from its neck can close.
///
/// The integral of their squared distance to the imported surface stays below about `budget`.
pub fn cut(mesh: &mut ManifoldMesh, distance: f64, mut budget: f64) -> Fingers {
    let mut found = find(mesh, distance);
    found.sort_by(|a, b| b.area.total_cmp(&a.area).then_with(|| a.rim.cmp(&b.rim)));
    let mut is_taken = vec![false; mesh.positions.len()];
    let mut caps = Caps::default();
    let mut loops = Vec::new();
    let mut insides = Vec::new();
    for finger in found {
        let corners = || {
            finger
                .inside
                .iter()
                .flat_map(|&t| mesh.triangles[t as usize])
        };
        let cost = caps::squares(finger.reach);
        if cost > budget || corners().any(|v| is_taken[v as usize]) {
            continue;
        }
        budget -= cost;
        corners().for_each(|v| is_taken[v as usize] = true);
        loops.push(finger.rim);
        insides.push(finger.inside);
    }
    let before = mesh.triangles.len();
    let rims: Vec<usize> = loops.iter().map(Vec::len).collect();
    caps::cut(mesh, &loops, &mut caps);
    let mut of = vec![NONE; mesh.triangles.len()];
    let mut cap = before;
    for ((finger, inside), rim) in (0u32..).zip(insides).zip(rims) {
        for t in inside {
            of[t as usize] = finger;
        }
        // The half-edges of the rim belong to the finger, and its cap comes first.
        of[cap..cap + rim].fill(finger);
        cap += 2 * rim;
    }
    Fingers { caps, of }
}

/// A finger that may be cut off.
struct Finger {
    area: f64,
    /// Bound of the distance of a cap.
    reach: f64,
    /// Half-edges of the inside.
    rim: Loop,
    /// Triangles.
    inside: Vec<u32>,
}

fn find(mesh: &ManifoldMesh, distance: f64) -> Vec<Finger> {
    let fans = Fans::of(mesh);
    let (depth, _) = breadth_first(mesh);
    let is_tip = |v: u32| {
        let mut is_farthest = depth[v as usize] > 0;
        fans.each(mesh, v, |_, w| {
            let (own, other) = (depth[v as usize], depth[w as usize]);
            is_farthest &= other < own || (other == own && v < w);
        });
        is_farthest && !fans.is_open(mesh, v)
    };
    let tips: Vec<u32> = (0..id(mesh.positions.len()))
        .filter(|&v| is_tip(v))
        .collect();
    tips.into_par_iter()
        .map_init(
            || Ball::new(mesh, &fans),
            |ball, tip| ball.finger(tip, distance),
        )
        .flatten()
        .collect()
}

/// A ball around a vertex; its memory is used again for the next.
struct Ball<'a> {
    mesh: &'a ManifoldMesh,
    fans: &'a Fans,
    distance: Vec<f64>,
    is_inside: Vec<bool>,
    /// Vertices with a distance.
    reached: Vec<u32>,
}

impl<'a> Ball<'a> {
    fn new(mesh: &'a ManifoldMesh, fans: &'a Fans) -> Self {
        Self {
            mesh,
            fans,
            distance: vec![f64::INFINITY; mesh.positions.len()],
            is_inside: vec![false; mesh.positions.len()],
            reached: Vec::new(),
        }
    }

    /// The best finger around `tip`.
    fn finger(&mut self, tip: u32, distance: f64) -> Option<Finger> {
        let best = self.grow(tip, distance);
        for v in self.reached.drain(..) {
            self.distance[v as usize] = f64::INFINITY;
            self.is_inside[v as usize] = false;
        }
        best
    }

    fn grow(&mut self, tip: u32, distance: f64) -> Option<Finger> {
        let at = |v: u32| self.mesh.positions[v as usize];
        let longest = WIDER * std::f64::consts::TAU * distance;
        let mut front = BinaryHeap::from([Reverse((0, tip))]);
        self.distance[tip as usize] = 0.0;
        self.reached.push(tip);
        let mut inside = Vec::new();
        let mut wanted = FIRST;
        let mut best: Option<(f64, Finger)> = None;
        // Length of all edges that leave the ball, and three times its area.
        let (mut leaving, mut area) = (0.0, 0.0);
        while let Some(Reverse((bits, v))) = front.pop() {
            let so_far = f64::from_bits(bits);
            if so_far > self.distance[v as usize] || self.is_inside[v as usize] {
                continue;
            }
            if inside.len() == MOST_VERTICES || self.fans.is_open(self.mesh, v) {
                break;
            }
            self.is_inside[v as usize] = true;
            inside.push(v);
            let Self {
                mesh,
                fans,
                distance: known,
                is_inside,
                reached,
            } = &mut *self;
            fans.each(mesh, v, |h, w| {
                let third = end(&mesh.triangles, next(h));
                area += (at(w) - at(v)).cross(at(third) - at(v)).length() / 2.0;
                let length = at(v).distance(at(w));
                leaving += if is_inside[w as usize] {
                    -length
                } else {
                    length
                };
                let through = so_far + length;
                let known = &mut known[w as usize];
                if through < *known {
                    if *known == f64::INFINITY {
                        reached.push(w);
                    }
                    *known = through;
                    front.push(Reverse((through.to_bits(), w)));
                }
            });
            if inside.len() < wanted {
                continue;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a count of vertices, grown a little"
            )]
            let next = (wanted as f64 * GROWTH).ceil() as usize;
            wanted = next;
            let estimate = leaving / LEAVING;
            if estimate > longest {
                break;
            }
            if estimate.powi(2) > ESTIMATE * QUOTIENT * area / 3.0 {
                continue;
            }
            let Some((quotient, mut finger)) = self.rim(&inside) else {
                continue;
            };
            if quotient < best.as_ref().map_or(QUOTIENT, |b| b.0) {
                finger.reach = caps::distance(self.mesh, &finger.rim, distance);
                if finger.reach <= distance {
                    best = Some((quotient, finger));
                }
            }
        }
        best.map(|(_, finger)| finger)
    }

    /// The triangles inside, where their rim is one loop, and the rim's isoperimetric quotient.
    fn rim(&self, inside: &[u32]) -> Option<(f64, Finger)> {
        let mesh = self.mesh;
        let holds = |t: u32| {
            let corners = mesh.triangles[t as usize];
            corners.iter().all(|&v| self.is_inside[v as usize])
        };
        let mut triangles = Vec::new();
        let mut area = 0.0;
        let mut open = Vec::new();
        for &v in inside {
            self.fans.each(mesh, v, |h, _| {
                let t = h / 3;
                // Once, from its first corner.
                if mesh.triangles[t as usize][0] != v || !holds(t) {
                    return;
                }
                triangles.push(t);
                let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
                area += (b - a).cross(c - a).length() / 2.0;
                for h in 3 * t..3 * t + 3 {
                    let twin = mesh.twins[h as usize];
                    if twin == NONE || !holds(twin / 3) {
                        open.push(h);
                    }
                }
            });
        }
        let first = *open.first()?;
        let mut rim = Vec::new();
        let mut length = 0.0;
        let mut h = first;
        loop {
            let twin = mesh.twins[h as usize];
            if twin == NONE || rim.len() == open.len() {
                return None;
            }
            rim.push(h);
            let [a, b] = [start(&mesh.triangles, h), end(&mesh.triangles, h)]
                .map(|v| mesh.positions[v as usize]);
            length += a.distance(b);
            // Around its end to the next edge of the rim.
            h = next(h);
            while holds(mesh.twins[h as usize] / 3) {
                h = next(mesh.twins[h as usize]);
            }
            if h == first {
                break;
            }
        }
        let is_simple = {
            let mut starts: Vec<u32> = rim.iter().map(|&h| start(&mesh.triangles, h)).collect();
            starts.sort_unstable();
            starts.windows(2).all(|pair| pair[0] != pair[1])
        };
        let is_whole = rim.len() == open.len() && rim.len() >= 3;
        (is_simple && is_whole).then(|| {
            let finger = Finger {
                area,
                reach: f64::INFINITY,
                rim,
                inside: triangles,
            };
            (length * length / area, finger)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{ImportedMesh, prepare};
    use glam::DVec3;

    /// A flat sheet of `n` by `n` cells with a tube of girth 8 cells and so many rings on it.
    fn sheet_with_tube(n: u32, rings: u32) -> ManifoldMesh {
        let mut mesh = ImportedMesh::default();
        let id = |i: u32, j: u32| i * (n + 1) + j;
        for i in 0..=n {
            for j in 0..=n {
                mesh.positions
                    .push(DVec3::new(f64::from(i), f64::from(j), 0.0));
            }
        }
        let m = n / 2;
        for i in 0..n {
            for j in 0..n {
                if (m..m + 2).contains(&i) && (m..m + 2).contains(&j) {
                    continue;
                }
                let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let ring = [
            (0, 0),
            (1, 0),
            (2, 0),
            (2, 1),
            (2, 2),
            (1, 2),
            (0, 2),
            (0, 1),
        ];
        let mut below: Vec<u32> = ring.iter().map(|&(i, j)| id(m + i, m + j)).collect();
        for z in 1..=rings {
            let first = u32::try_from(mesh.positions.len()).unwrap();
            for &v in &below {
                let p = mesh.positions[v as usize];
                mesh.positions.push(DVec3::new(p.x, p.y, f64::from(z)));
            }
            let above: Vec<u32> = (first..first + 8).collect();
            for k in 0..8 {
                let l = (k + 1) % 8;
                mesh.triangles.extend([
                    [below[k], below[l], above[l]],
                    [below[k], above[l], above[k]],
                ]);
            }
            below = above;
        }
        let top = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.push(DVec3::new(
            f64::from(m) + 1.0,
            f64::from(m) + 1.0,
            f64::from(rings),
        ));
        for k in 0..8 {
            mesh.triangles.push([below[k], below[(k + 1) % 8], top]);
        }
        prepare(mesh).unwrap().0
    }

    #[test]
    fn a_finger_is_cut_off_whole() {
        let mut mesh = sheet_with_tube(40, 10);
        let before = mesh.triangles.len();
        let fingers = cut(&mut mesh, 1.5, 20.0);
        assert_eq!(fingers.caps.loops, 1);
        assert_eq!(mesh.check(), Ok(()));
        assert_eq!(mesh.triangles.len(), before + fingers.caps.triangles);
        let inside = fingers.of[..before].iter().filter(|&&of| of == 0).count();
        // 160 on its sides, 8 on top; the rim may run a ring above the sheet.
        assert!((136..=176).contains(&inside), "{inside}");
        // Nothing joins a finger to what is left.
        for (h, &twin) in mesh.twins.iter().enumerate() {
            assert!(twin == NONE || fingers.of[h / 3] == fingers.of[twin as usize / 3]);
        }
        assert!(fingers.caps.distance <= 1.5);
    }

    #[test]
    fn a_bump_and_a_wide_tube_stay() {
        let mut bump = sheet_with_tube(40, 2);
        assert_eq!(cut(&mut bump, 1.5, 20.0).caps, Caps::default());
        let mut tube = sheet_with_tube(40, 10);
        assert_eq!(cut(&mut tube, 0.5, 20.0).caps, Caps::default());
        assert_eq!(cut(&mut tube, 1.5, 0.1).caps, Caps::default());
    }
}
