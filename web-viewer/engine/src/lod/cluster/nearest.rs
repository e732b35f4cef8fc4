//! The nearest point of a few hundred triangles.
//!
//! A binary tree of boxes, halved at the median across the longest extent of the centres; the nearest box is entered first. The nearest
//! point of a triangle is after Ericson, "Real-Time Collision Detection", 2005, 5.1.5. Equal questions have equal answers, bit for bit.
//! The tree of `evaluation` is for millions of triangles, in doubles; the engine knows only the format, and is what browsers load.

use glam::Vec3;

/// Triangles of a leaf, at most.
const LEAF: usize = 4;
/// More than halvings of the triangles of a group.
const DEPTH: usize = 64;
/// Part by which a box may be farther than what was found and still be entered, for what rounding does to both.
const SLACK: f32 = 1e-5;

/// Triangles to find nearest points of.
#[derive(Debug, Default)]
pub(super) struct Nearest {
    /// In the order of the leaves.
    triangles: Vec<[Vec3; 3]>,
    /// By place in that order: the number that the triangle came with.
    numbers: Vec<u32>,
    /// As in a heap: the halves of box n are 2n + 1 and 2n + 2.
    boxes: Vec<[Vec3; 2]>,
}

/// A point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OnTriangle {
    /// Number of the triangle.
    pub(super) triangle: u32,
    /// What each corner counts for; at least 0, together 1.
    pub(super) weights: [f32; 3],
    /// Where the triangle is among the leaves.
    pub(super) place: usize,
    /// Squared distance.
    distance: f32,
}

impl Nearest {
    /// Prepares triangles, whose corners are finite.
    pub(super) fn new(corners: &[[Vec3; 3]]) -> Self {
        let mut order: Vec<(u32, [Vec3; 3])> = (0..).zip(corners.iter().copied()).collect();
        let mut boxes = Vec::new();
        fill(&mut boxes, 0, &mut order);
        Self {
            triangles: order.iter().map(|&(_, corners)| corners).collect(),
            numbers: order.iter().map(|&(number, _)| number).collect(),
            boxes,
        }
    }

    /// The point that is nearest to `point`; `None` where there is no triangle. Sooner found where `hint`, which an earlier answer has
    /// as its place, is near, but the same.
    pub(super) fn to(&self, point: Vec3, hint: usize) -> Option<OnTriangle> {
        let mut best = self.on(hint.min(self.triangles.len().checked_sub(1)?), point);
        let mut stack = [(0.0, 0, 0, 0); DEPTH];
        stack[0].3 = self.triangles.len();
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (distance, node, start, end) = stack[height];
            if distance > best.distance * (1.0 + SLACK) {
                continue;
            }
            if end - start <= LEAF {
                for place in start..end {
                    let other = self.on(place, point);
                    let is_less = other.distance < best.distance;
                    if is_less || (other.distance <= best.distance && place < best.place) {
                        best = other;
                    }
                }
                continue;
            }
            let middle = usize::midpoint(start, end);
            let halves = [(2 * node + 1, start, middle), (2 * node + 2, middle, end)];
            let [first, second] =
                halves.map(|(node, start, end)| (self.distance(node, point), node, start, end));
            let near_last = if first.0 <= second.0 {
                [second, first]
            } else {
                [first, second]
            };
            stack[height..height + 2].copy_from_slice(&near_last);
            height += 2;
        }
        Some(best)
    }

    /// The nearest point of the triangle at a place.
    fn on(&self, place: usize, point: Vec3) -> OnTriangle {
        let corners = self.triangles[place];
        let weights = closest(corners, point);
        OnTriangle {
            place,
            triangle: self.numbers[place],
            weights,
            distance: blend(corners, weights).distance_squared(point),
        }
    }

    /// Squared distance of a box.
    fn distance(&self, node: usize, point: Vec3) -> f32 {
        let [min, max] = self.boxes[node];
        point.clamp(min, max).distance_squared(point)
    }
}

/// Sorts `triangles` into leaves and notes the boxes of `node` and below.
fn fill(boxes: &mut Vec<[Vec3; 2]>, node: usize, triangles: &mut [(u32, [Vec3; 3])]) {
    let centre = |corners: &[Vec3; 3]| corners.iter().sum::<Vec3>();
    let around = |points: &mut dyn Iterator<Item = Vec3>| {
        points.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[min, max], p| {
            [min.min(p), max.max(p)]
        })
    };
    if boxes.len() <= node {
        boxes.resize(node + 1, [Vec3::INFINITY, Vec3::NEG_INFINITY]);
    }
    boxes[node] = around(&mut triangles.iter().flat_map(|(_, corners)| *corners));
    if triangles.len() <= LEAF {
        return;
    }
    let [min, max] = around(&mut triangles.iter().map(|(_, corners)| centre(corners)));
    let axis = (max - min).max_position();
    let middle = triangles.len() / 2;
    triangles.select_nth_unstable_by(middle, |(a, p), (b, q)| {
        let (p, q) = (centre(p)[axis], centre(q)[axis]);
        p.total_cmp(&q).then(a.cmp(b))
    });
    let (low, high) = triangles.split_at_mut(middle);
    fill(boxes, 2 * node + 1, low);
    fill(boxes, 2 * node + 2, high);
}

fn blend(corners: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    corners
        .into_iter()
        .zip(weights)
        .map(|(corner, weight)| weight * corner)
        .sum()
}

/// The weights of the corners in the point of a triangle that is nearest to `p`.
fn closest([a, b, c]: [Vec3; 3], p: Vec3) -> [f32; 3] {
    let part = |of: f32, whole: f32| {
        if whole > 0.0 {
            (of / whole).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = part(d1, d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = part(d2, d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = part(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    let (v, w) = (part(vb, sum), part(vc, sum));
    [(1.0 - v - w).max(0.0), v, w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn point(random: &mut Random, extent: u32) -> Vec3 {
        Vec3::from_array([0; 3].map(|_: u32| random.below(extent) as f32))
    }

    #[test]
    fn nearest_points_are_those_of_trying_all_and_of_a_fine_grid() {
        let mut random = Random::new(71);
        for count in [1, 3, 5, 40, 700] {
            let triangles: Vec<[Vec3; 3]> = (0..count)
                .map(|_| {
                    let middle = point(&mut random, 4000);
                    [0; 3].map(|_: u32| middle + point(&mut random, 300))
                })
                .collect();
            let nearest = Nearest::new(&triangles);
            for _ in 0..100 {
                let p = point(&mut random, 4500);
                let place = nearest.to(p, 0).unwrap();
                let found = blend(triangles[place.triangle as usize], place.weights).distance(p);
                assert!(
                    place
                        .weights
                        .iter()
                        .all(|&weight| (0.0..=1.0).contains(&weight))
                );
                let all = triangles
                    .iter()
                    .map(|&t| blend(t, closest(t, p)).distance(p));
                let least = all.fold(f32::INFINITY, f32::min);
                assert!(found <= least, "{found} {least}");
                // No point of any triangle is nearer.
                for &t in &triangles {
                    for (i, j) in (0u8..=8).flat_map(|i| (0..=8 - i).map(move |j| (i, j))) {
                        let [v, w] = [i, j].map(|k| f32::from(k) / 8.0);
                        let on = blend(t, [1.0 - v - w, v, w]);
                        assert!(on.distance(p) >= found - 0.01);
                    }
                }
                for hint in [3, 17, place.place, 4000] {
                    assert_eq!(nearest.to(p, hint), Some(place));
                }
            }
        }
    }

    #[test]
    fn triangles_without_extent_are_points_and_lines() {
        let [a, b] = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(8.0, 0.0, 0.0)];
        for triangle in [
            [a, a, a],
            [a, b, b],
            [a, a, b],
            [a, b, a],
            [a, b, (a + b) / 2.0],
        ] {
            let nearest = Nearest::new(&[triangle]);
            let p = Vec3::new(-3.0, 4.0, 0.0);
            let place = nearest.to(p, 0).unwrap();
            assert!((blend(triangle, place.weights).distance(p) - 5.0).abs() < 1e-3);
        }
        assert_eq!(Nearest::new(&[]).to(a, 0), None);
    }
}
