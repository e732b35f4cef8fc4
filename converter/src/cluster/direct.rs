//! What can be guaranteed of the finest surface, measured against the source itself.
//!
//! Bounds that are sums of what decimation, rounding and trimming may each have done are far above the truth, as no place has the worst of all. Here a distance is tried for
//! each triangle: it holds where all corners are that near to one and the same triangle of the other surface, as the distance from a
//! triangle is a convex function. Where it does not, what lies above the triangle nearest to the middle is cut off, and each part is asked the same, until it holds for all of them
//! or the middle of one is farther; then a longer distance is tried. Small pieces are mostly done with sooner: one holds whose middle is nearer by its radius, so triangles that are not large beside the
//! distance are first halved until that holds of all parts. Every triangle has a bound of its own. Other than [`super::bound`], which looks for the least bound of small meshes, this asks for one distance at a time.
//!
//! Limit: where too many pieces are asked about, a longer distance is tried though the shorter one may hold.

use super::bound::turned;
use glam::DVec3;
use marquetry_evaluation::distance::{Indexed, Mesh, closest_point};
use rayon::prelude::*;
use std::ops::Range;

/// A leaf of the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    /// Its triangles, which follow those of the leaves before.
    pub(super) triangles: usize,
    /// What is known of its distance, a length.
    pub(super) bound: f64,
}

/// The first distance tried for a triangle, over the largest one seen of it: less may hold, and takes long to show.
const START: f64 = 2.0;
/// One triangle in so many is asked how far it is at once.
const SAMPLED: usize = 16;
/// One in so many may be farther than the first distance tried, where that is below the one that is rarely exceeded. Where more are, less than that takes longer, and views are
/// hardly coarser.
const FARTHER: usize = 10;
/// The first distance tried, over the one that is rarely exceeded, at least: up to that it takes 31 steps.
const LEAST: f64 = 1.0 / 1024.0;
/// How much longer each next one is.
const GROWTH: f64 = 1.25;
/// Pieces of a triangle that are looked at for one distance, at most.
const PIECES: u32 = 1 << 16;
/// How far beyond its edges a triangle is asked about pieces, over the distance tried.
const REACH: f64 = 0.5;
/// Triangles of the source worked on in one go.
const CHUNK: usize = 4096;
/// Radius of pieces that are halved before they are cut, over the distance tried; what is larger may be as large as triangles of the surface are.
const SMALL: f64 = 4.0;
/// The same of triangles that are halved before anything is cut, and how often: their middles are quickly asked about.
const HALVED: f64 = 3.0;
const HALVINGS: u32 = 8;
/// What rounding may hide.
const HAIR: f64 = 1.0 + 1e-9;

/// By triangle of `surface`, an upper bound of its distance from `source`, such that every point of `source` is as near to one of them as its bound says. `found` is a distance that is rarely exceeded.
///
/// The same for any number of threads.
pub(super) fn bounds(
    surface: &Indexed<'_>,
    source: &Indexed<'_>,
    leaves: &[Leaf],
    found: f64,
) -> Vec<f64> {
    if found <= 0.0 {
        let known = leaves.iter().map(|leaf| vec![leaf.bound; leaf.triangles]);
        return known.collect::<Vec<_>>().concat();
    }
    let at_once = at_once(surface.mesh, source).max(at_once(source.mesh, surface));
    let start = at_once.clamp(LEAST * found, found);
    let mut end = 0;
    let ranges: Vec<Range<usize>> = leaves
        .iter()
        .map(|leaf| {
            let first = end;
            end += leaf.triangles;
            first..end
        })
        .collect();
    // Triangles are as good as they are: one bad place is no reason to draw all the others where they are not needed. A bound that is known of a leaf holds for its own.
    let parts: Vec<Vec<f64>> = ranges
        .into_par_iter()
        .zip(leaves)
        .map(|(range, leaf)| {
            let mut near = Near::new(source);
            let bound = |t: usize| {
                let corners = surface.mesh.corners(t);
                let first = START * near.seen(corners, start / START);
                near.bound(corners, first.min(leaf.bound), leaf.bound)
            };
            range.map(bound).collect()
        })
        .collect();
    let mut bounds = parts.concat();
    // Of the source's only the largest does.
    let most = leaves.iter().map(|leaf| leaf.bound).fold(0.0, f64::max);
    let least = (bounds.iter().copied().fold(most, f64::min)).max(start.min(most));
    for (t, bound) in above(source.mesh, surface, least, most) {
        let corners = source.mesh.corners(t);
        // One that all of it is near to, or whatever it may be near to.
        if let Some((near, _)) = nearest(surface, &corners).filter(|&(_, from)| from <= bound) {
            bounds[near] = bounds[near].max(bound);
            continue;
        }
        let reach = bound + radius(&corners);
        for near in surface.tree.within(middle(&corners), reach * reach) {
            if let Some(own) = bounds.get_mut(near.triangle as usize) {
                *own = own.max(bound);
            }
        }
    }
    for bound in &mut bounds {
        *bound = bound.max(least) * HAIR;
    }
    bounds
}

/// The triangle of `to` that is nearest to the middle of another one, and how far from it that one's corners are at most.
fn nearest(to: &Indexed<'_>, corners: &[DVec3; 3]) -> Option<(usize, f64)> {
    let nearest = to.tree.closest(middle(corners), f64::INFINITY)?;
    let nearest = nearest.triangle as usize;
    let other = to.mesh.corners(nearest);
    let from = |&p: &DVec3| closest_point(other, p).distance(p);
    Some((nearest, corners.iter().map(from).fold(0.0, f64::max)))
}

/// The distance within which most triangles of `mesh` are of the one that is nearest to their middle.
fn at_once(mesh: Mesh<'_>, to: &Indexed<'_>) -> f64 {
    let sampled = (0..mesh.triangles.len())
        .into_par_iter()
        .step_by(SAMPLED)
        .map(|t| {
            let nearest = nearest(to, &mesh.corners(t));
            nearest.map_or(f64::INFINITY, |(_, from)| from)
        });
    let mut sampled: Vec<f64> = sampled.collect();
    sampled.sort_unstable_by(f64::total_cmp);
    let rest = sampled.len() / FARTHER;
    sampled.iter().rev().nth(rest).copied().unwrap_or(0.0)
}

/// Triangles of `mesh` that are not known to be within `least` of a surface, and a bound of their distance, at most `most`, which is known to hold.
fn above(mesh: Mesh<'_>, to: &Indexed<'_>, least: f64, most: f64) -> Vec<(usize, f64)> {
    let chunks = mesh.triangles.par_chunks(CHUNK).enumerate();
    let parts: Vec<Vec<(usize, f64)>> = chunks
        .map(|(number, chunk)| {
            let mut near = Near::new(to);
            let bounds = (number * CHUNK..).take(chunk.len()).map(|t| {
                let bound = near.bound(mesh.corners(t), least, most);
                (t, bound)
            });
            bounds.filter(|&(_, bound)| bound > least).collect()
        })
        .collect();
    parts.into_iter().flatten().collect()
}

/// Asks a surface about triangles that are near each other.
struct Near<'a> {
    to: &'a Indexed<'a>,
    /// The triangle that was nearest last.
    last: u32,
    hint: u32,
}

impl<'a> Near<'a> {
    fn new(to: &'a Indexed<'a>) -> Self {
        Self {
            to,
            last: 0,
            hint: 0,
        }
    }

    /// The largest distance of corners and middle of a triangle, or `least`, where none is farther.
    fn seen(&mut self, triangle: [DVec3; 3], least: f64) -> f64 {
        let mut most2 = least * least;
        for point in triangle.into_iter().chain([middle(&triangle)]) {
            if !self.to.tree.is_within(point, most2, &mut self.hint) {
                let closest = self.to.tree.closest(point, f64::INFINITY);
                most2 = closest.map_or(most2, |closest| closest.distance2);
            }
        }
        most2.sqrt()
    }

    /// The first distance of those tried from `least` on that holds for a triangle, or `most`, which is known to.
    fn bound(&mut self, triangle: [DVec3; 3], least: f64, most: f64) -> f64 {
        let mut bound = least;
        while bound < most && !self.holds(triangle, bound) {
            bound *= GROWTH;
        }
        bound.min(most)
    }

    /// Whether every point of a triangle is known to be within `distance`.
    fn holds(&mut self, triangle: [DVec3; 3], distance: f64) -> bool {
        let distance2 = distance * distance;
        if self.is_near_last(&triangle, distance2) {
            return true;
        }
        if radius(&triangle) < distance && self.is_near_middle(&triangle, distance) {
            return true;
        }
        // Small triangles are mostly near the one that their middle is near to.
        let Some(nearest) = self.to.tree.closest(middle(&triangle), distance2) else {
            return false;
        };
        self.last = nearest.triangle;
        if self.is_near_last(&triangle, distance2) {
            return true;
        }
        if self.is_near_in_halves(triangle, distance, HALVINGS) {
            return true;
        }
        for corner in triangle {
            if !self.to.tree.is_within(corner, distance2, &mut self.hint) {
                return false;
            }
        }
        let mut left = vec![triangle.to_vec()];
        for _ in 0..PIECES {
            let Some(piece) = left.pop() else {
                return true;
            };
            if !self.divide(piece, distance, &mut left) {
                return false;
            }
        }
        false
    }

    /// Whether all corners of a polygon are near the triangle that was nearest last.
    fn is_near_last(&self, piece: &[DVec3], distance2: f64) -> bool {
        let corners = self.to.mesh.corners(self.last as usize);
        let from = |&p: &DVec3| closest_point(corners, p).distance_squared(p);
        piece.iter().all(|p| from(p) <= distance2)
    }

    /// Whether the middle of a polygon is so near that all of it is: no point of a convex one is farther from its middle than a corner.
    fn is_near_middle(&mut self, piece: &[DVec3], distance: f64) -> bool {
        let left = distance - radius(piece) * HAIR;
        left > 0.0 && (self.to.tree).is_within(middle(piece), left * left, &mut self.hint)
    }

    /// Whether a triangle is known to be near by the middles of its parts, after so many halvings at most.
    fn is_near_in_halves(&mut self, corners: [DVec3; 3], distance: f64, halvings: u32) -> bool {
        let size = radius(&corners);
        if size < distance && self.is_near_middle(&corners, distance) {
            return true;
        }
        if halvings == 0 || size > HALVED * distance {
            return false;
        }
        let [a, b, c] = turned(corners, |point| point);
        let middle = a.midpoint(b);
        self.is_near_in_halves([a, middle, c], distance, halvings - 1)
            && self.is_near_in_halves([middle, b, c], distance, halvings - 1)
    }

    /// Takes off a convex polygon what is within `distance` of the triangle nearest to its middle, and adds the other pieces to `left`; whether the middle is near enough.
    fn divide(&mut self, piece: Vec<DVec3>, distance: f64, left: &mut Vec<Vec<DVec3>>) -> bool {
        if self.is_near_middle(&piece, distance) {
            return true;
        }
        if (distance..SMALL * distance).contains(&radius(&piece)) {
            left.extend(halves(&piece));
            return true;
        }
        let distance2 = distance * distance;
        let Some(nearest) = self.to.tree.closest(middle(&piece), distance2) else {
            return false;
        };
        self.last = nearest.triangle;
        if self.is_near_last(&piece, distance2) {
            return true;
        }
        let before = left.len();
        let [a, b, c] = self.to.mesh.corners(self.last as usize);
        let normal = (b - a).cross(c - a);
        let mut inside = piece;
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let Some(outwards) = (to - from).cross(normal).try_normalize() else {
                continue;
            };
            let at = from + REACH * distance * outwards;
            // What was cut here once is not cut again.
            let (within, beyond) = cut(&inside, at, outwards, 1e-6 * distance);
            left.extend(beyond);
            let Some(within) = within else {
                // Nothing is above the triangle.
                inside = Vec::new();
                break;
            };
            inside = within;
        }
        match left.len() - before {
            // All of it is above the triangle, or beyond one edge: nothing was cut.
            0 => left.extend(halves(&inside)),
            1 if inside.is_empty() => {
                if let Some(whole) = left.pop() {
                    left.extend(halves(&whole));
                }
            }
            _ if inside.is_empty() || self.is_near_last(&inside, distance2) => {}
            _ => left.push(inside),
        }
        true
    }
}

/// A point of a convex polygon, in its middle.
fn middle(piece: &[DVec3]) -> DVec3 {
    piece.iter().sum::<DVec3>() / piece.len() as f64
}

/// Distance from there to the farthest corner.
fn radius(piece: &[DVec3]) -> f64 {
    let middle = middle(piece);
    let radius2 = piece.iter().map(|p| p.distance_squared(middle));
    radius2.fold(0.0, f64::max).sqrt()
}

/// Both parts of a convex polygon, on the inner and on the outer side of a plane; all of it is on one side where no corner is more than `hair` beyond.
fn cut(
    piece: &[DVec3],
    at: DVec3,
    outwards: DVec3,
    hair: f64,
) -> (Option<Vec<DVec3>>, Option<Vec<DVec3>>) {
    let height = |p: DVec3| (p - at).dot(outwards);
    if piece.iter().all(|&p| height(p) <= hair) {
        return (Some(piece.to_vec()), None);
    }
    if piece.iter().all(|&p| height(p) >= -hair) {
        return (None, Some(piece.to_vec()));
    }
    let (mut inner, mut outer) = (Vec::new(), Vec::new());
    for (k, &p) in piece.iter().enumerate() {
        let q = piece[(k + 1) % piece.len()];
        let (own, next) = (height(p), height(q));
        if own <= 0.0 {
            inner.push(p);
        }
        if own >= 0.0 {
            outer.push(p);
        }
        if own * next < 0.0 {
            let crossing = p.lerp(q, own / (own - next));
            inner.push(crossing);
            outer.push(crossing);
        }
    }
    (Some(inner), Some(outer))
}

/// A convex polygon cut across the middle of its longest edge.
fn halves(piece: &[DVec3]) -> impl Iterator<Item = Vec<DVec3>> {
    let edge = |k: usize| (piece[k], piece[(k + 1) % piece.len()]);
    let edges = (0..piece.len()).map(edge);
    let longest =
        edges.max_by(|(a, b), (c, d)| a.distance_squared(*b).total_cmp(&c.distance_squared(*d)));
    let parts = longest.map(|(a, b)| cut(piece, a.midpoint(b), b - a, 0.0));
    let (one, other) = parts.unwrap_or_default();
    one.into_iter().chain(other)
}

#[cfg(test)]
pub(super) mod tests;
