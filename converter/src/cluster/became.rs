//! What vertices become as a group's children give way to its members, by place.

use super::bound::Target;
use super::shape::{Shape, point};
use crate::mesh::adjacency::id;
use glam::DVec3;
use marquetry_format::LatticePoint;
use std::collections::HashMap;

/// Parts of the way at which triangles are looked at; those of its end that are flat by then are not drawn.
const PARTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// What vertices have become, by place.
#[derive(Debug, Default)]
pub(super) struct Became {
    /// `None`: every one itself.
    places: Option<HashMap<LatticePoint, LatticePoint>>,
}

impl Became {
    /// Nothing was collapsed.
    pub(super) fn itself() -> Self {
        Self { places: None }
    }

    /// Vertices that have become others.
    pub(super) fn others(places: HashMap<LatticePoint, LatticePoint>) -> Self {
        Self {
            places: Some(places),
        }
    }

    /// The place that a vertex at `place` has become; `None` where that is not known.
    pub(super) fn of(&self, place: LatticePoint) -> Option<LatticePoint> {
        match &self.places {
            Some(places) => places.get(&place).copied(),
            None => Some(place),
        }
    }

    /// What vertices have become was moved as well, after that was found.
    pub(super) fn and_moved(&mut self, moved: &HashMap<LatticePoint, LatticePoint>) {
        for place in self.places.iter_mut().flat_map(HashMap::values_mut) {
            *place = moved.get(place).copied().unwrap_or(*place);
        }
    }

    /// Forgets what has become of vertices of `fine`, which then go to the nearest point of `to`, where on their way something would be farther than `most` from both
    /// surfaces, or something of `from` that far from what is shown, on the way or at its end: they have been told a place on another sheet, or beyond a bend. Sampled at a few points of each triangle.
    pub(super) fn keep_within(
        &mut self,
        fine: &Shape,
        from: &Target<'_>,
        to: &Target<'_>,
        most: f64,
    ) {
        if let Some(became) = &mut self.places {
            Ways::new(fine, became, from, to, most).keep_within(became);
        }
    }
}

/// The ways of all vertices.
struct Ways<'a> {
    places: Vec<LatticePoint>,
    /// Corners by number of the place.
    triangles: Vec<[usize; 3]>,
    start: Vec<DVec3>,
    end: Vec<DVec3>,
    /// Whether what a vertex has become is not just the nearest point.
    is_told: Vec<bool>,
    from: &'a Target<'a>,
    to: &'a Target<'a>,
    most: f64,
    hints: [u32; 2],
}

impl<'a> Ways<'a> {
    fn new(
        fine: &Shape,
        became: &HashMap<LatticePoint, LatticePoint>,
        from: &'a Target<'a>,
        to: &'a Target<'a>,
        most: f64,
    ) -> Self {
        let (places, number_of) = fine.places();
        let start: Vec<DVec3> = places.iter().map(|&place| point(place)).collect();
        let end = places.iter().zip(&start).map(|(place, &start)| {
            let told = became.get(place).map(|&place| point(place));
            told.unwrap_or_else(|| to.closest(start))
        });
        let corners = |t: &[u32; 3]| t.map(|v| number_of[v as usize] as usize);
        Self {
            triangles: fine.triangles.iter().map(corners).collect(),
            end: end.collect(),
            is_told: places.iter().map(|p| became.contains_key(p)).collect(),
            start,
            places,
            from,
            to,
            most,
            hints: [0; 2],
        }
    }

    fn keep_within(&mut self, became: &mut HashMap<LatticePoint, LatticePoint>) {
        let astray: Vec<usize> = (0..self.places.len())
            .filter(|&v| self.is_astray(v))
            .collect();
        self.forget(became, astray);
        let mut changed = vec![true; self.places.len()];
        loop {
            let far: Vec<usize> = (0..self.triangles.len())
                .filter(|&t| self.triangles[t].iter().any(|&v| changed[v]) && self.is_far(t))
                .collect();
            let mut forgotten = self.forget_corners(became, far);
            if forgotten.is_empty() {
                let bare = self.bare();
                forgotten = self.forget_corners(became, bare);
            }
            if forgotten.is_empty() {
                return;
            }
            changed.fill(false);
            for v in forgotten {
                changed[v] = true;
            }
        }
    }

    /// Vertices among those that have been told something go to the nearest points instead; which these are.
    fn forget(
        &mut self,
        became: &mut HashMap<LatticePoint, LatticePoint>,
        vertices: impl IntoIterator<Item = usize>,
    ) -> Vec<usize> {
        let told = vertices.into_iter().filter(|&v| {
            let is_told = std::mem::take(&mut self.is_told[v]);
            if is_told {
                became.remove(&self.places[v]);
                self.end[v] = self.to.closest(self.start[v]);
            }
            is_told
        });
        told.collect()
    }

    fn forget_corners(
        &mut self,
        became: &mut HashMap<LatticePoint, LatticePoint>,
        triangles: Vec<usize>,
    ) -> Vec<usize> {
        let corners: Vec<[usize; 3]> = triangles.into_iter().map(|t| self.triangles[t]).collect();
        self.forget(became, corners.into_iter().flatten())
    }

    fn at(&self, v: usize, part: f64) -> DVec3 {
        self.start[v].lerp(self.end[v], part)
    }

    fn is_near(&mut self, point: DVec3) -> bool {
        let [first, second] = &mut self.hints;
        self.from.is_within(point, self.most, first) || self.to.is_within(point, self.most, second)
    }

    /// Whether a vertex is far from both surfaces on its way.
    fn is_astray(&mut self, v: usize) -> bool {
        PARTS.iter().any(|&part| !self.is_near(self.at(v, part)))
    }

    fn is_flat_at_end(&self, t: usize) -> bool {
        let [a, b, c] = self.triangles[t].map(|v| self.end[v]);
        a == b || b == c || c == a
    }

    /// Whether the middle of a triangle, while it is drawn, is far from both surfaces.
    fn is_far(&mut self, t: usize) -> bool {
        let is_told = self.triangles[t].iter().any(|&v| self.is_told[v]);
        is_told
            && PARTS.iter().any(|&part| {
                let is_gone = part.total_cmp(&1.0).is_eq() && self.is_flat_at_end(t);
                !is_gone && !self.is_near(middle(self.triangles[t].map(|v| self.at(v, part))))
            })
    }

    /// Triangles that nothing covers at some part of the way.
    fn bare(&self) -> Vec<usize> {
        let mut bare = vec![false; self.triangles.len()];
        for part in PARTS {
            let is_end = part.total_cmp(&1.0).is_eq();
            let shown: Vec<DVec3> = (0..self.places.len()).map(|v| self.at(v, part)).collect();
            let drawn: Vec<[u32; 3]> = (0..self.triangles.len())
                .filter(|&t| !is_end || !self.is_flat_at_end(t))
                .map(|t| self.triangles[t].map(id))
                .collect();
            let Some(target) = Target::new(&shown, &drawn) else {
                continue;
            };
            let mut hint = 0;
            for (t, is_bare) in bare.iter_mut().enumerate() {
                let corners = self.triangles[t];
                // A triangle is no farther from where it was than its corners are, while it is drawn.
                let is_safe = |&v: &usize| shown[v].distance(self.start[v]) <= self.most;
                if *is_bare || !is_end && corners.iter().all(is_safe) {
                    continue;
                }
                let [a, b, c] = corners.map(|v| self.start[v]);
                let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
                let quarters = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
                let mut points = quarters.map(middle).into_iter().chain([ab, bc, ca]);
                *is_bare = !points.all(|point| target.is_within(point, self.most, &mut hint));
            }
        }
        (0..self.triangles.len()).filter(|&t| bare[t]).collect()
    }
}

fn middle(corners: [DVec3; 3]) -> DVec3 {
    corners.into_iter().sum::<DVec3>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const SIDE: u32 = 8;
    const CELL: u32 = 100;
    const APART: u32 = 90;

    /// Two level squares of SIDE² cells above each other, one in `step`² cells wide.
    fn sheets(step: u32) -> Shape {
        let mut shape = Shape::default();
        for z in [0, APART] {
            for k in 0..(SIDE / step).pow(2) {
                let [x, y] = [k % (SIDE / step), k / (SIDE / step)].map(|c| c * step);
                let at = |dx, dy| ([CELL * (x + dx), CELL * (y + dy), z], [0; 2], [0; 3]);
                shape.triangle([at(0, 0), at(step, 0), at(step, step)]);
                shape.triangle([at(0, 0), at(step, step), at(0, step)]);
            }
        }
        shape
    }

    fn hashed(
        places: &BTreeMap<LatticePoint, LatticePoint>,
    ) -> HashMap<LatticePoint, LatticePoint> {
        places.iter().map(|(&from, &to)| (from, to)).collect()
    }

    #[test]
    fn what_would_leave_its_sheet_is_forgotten() {
        let (fine, coarse) = (sheets(1), sheets(2));
        let [own, whole] = [&coarse, &fine].map(Shape::positions);
        let to = Target::new(&own, &coarse.triangles).unwrap();
        let from = Target::new(&whole, &fine.triangles).unwrap();
        let even = |c: u32| c / (2 * CELL) * 2 * CELL;
        let told = |[x, y, z]: LatticePoint| [even(x), even(y), z];
        let all: BTreeMap<LatticePoint, LatticePoint> =
            fine.vertices.iter().map(|v| (v.0, told(v.0))).collect();
        let mut right = Became::others(hashed(&all));
        right.keep_within(&fine, &from, &to, 1.0);
        assert!(
            all.keys()
                .all(|&place| right.of(place) == Some(all[&place]))
        );
        // Straight up.
        let (strayed, up) = ([3 * CELL, 3 * CELL, 0], [2 * CELL, 2 * CELL, APART]);
        let mut wrong = hashed(&all);
        wrong.insert(strayed, up);
        for most in [1.0, 29.0] {
            let mut became = Became::others(wrong.clone());
            became.keep_within(&fine, &from, &to, most);
            assert_eq!(became.of(strayed), None, "{most}");
            for (&place, &to) in &all {
                if place != strayed {
                    let is_beside = place
                        .iter()
                        .zip(strayed)
                        .all(|(&a, b)| a.abs_diff(b) <= CELL);
                    let kept = became.of(place);
                    assert!(kept == Some(to) || is_beside && kept.is_none(), "{place:?}");
                }
            }
        }
        // Nothing would be at the sheet's corner.
        let rim = [SIDE * CELL, SIDE * CELL, 0];
        let mut bare = hashed(&all);
        bare.insert(rim, [(SIDE - 2) * CELL, (SIDE - 2) * CELL, 0]);
        let mut became = Became::others(bare);
        became.keep_within(&fine, &from, &to, 1.0);
        assert_eq!(became.of(rim), None);
        // Where the bound allows as much it may.
        let mut became = Became::others(wrong.clone());
        became.keep_within(&fine, &from, &to, f64::from(APART));
        assert_eq!(became.of(strayed), Some(up));
    }

    #[test]
    fn what_would_leave_a_hole_on_its_way_is_forgotten() {
        let (fine, coarse) = (sheets(1), sheets(2));
        let [own, whole] = [&coarse, &fine].map(Shape::positions);
        let to = Target::new(&own, &coarse.triangles).unwrap();
        let from = Target::new(&whole, &fine.triangles).unwrap();
        // Mirrored: all is covered at the end, and half-way all is a line.
        let told = |[x, y, z]: LatticePoint| [SIDE * CELL - x, y, z];
        let all = fine.vertices.iter().map(|v| (v.0, told(v.0)));
        let mut became = Became::others(all.collect());
        became.keep_within(&fine, &from, &to, 1.0);
        let is_kept = |v: &(LatticePoint, [u8; 2], [u8; 3])| became.of(v.0).is_some();
        let kept: Vec<u32> = (fine.vertices.iter().filter(|v| is_kept(v)))
            .map(|v| v.0[0])
            .collect();
        assert!(kept.iter().all(|&x| x == SIDE * CELL / 2), "{kept:?}");
    }

    #[test]
    fn what_is_moved_later_is_moved_in_it() {
        let [from, other, to] = [[0; 3], [4, 5, 6], [1, 2, 3]];
        let mut became = Became::others([from, other].map(|place| (place, place)).into());
        assert_eq!(became.of(from), Some(from));
        became.and_moved(&HashMap::from([(from, to)]));
        assert_eq!(became.of(from), Some(to));
        assert_eq!(became.of(other), Some(other));
        assert_eq!(became.of([9, 9, 9]), None);
        assert_eq!(Became::itself().of([9, 9, 9]), Some([9, 9, 9]));
    }
}
