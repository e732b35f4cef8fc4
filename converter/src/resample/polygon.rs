//! Small convex polygons, cut by lines and planes.

use glam::DVec3;

/// Corners at most: a triangle gains one with every cut of one of its pieces, and a piece is cut five times at most for the
/// overlay, and then a few times more.
const CAPACITY: usize = 16;

/// A corner that knows what lies between itself and another.
pub(super) trait Corner: Copy {
    /// Anything.
    const BLANK: Self;

    /// The corner at fraction `along` of the way to `other`.
    fn towards(self, other: Self, along: f64) -> Self;
}

impl Corner for DVec3 {
    const BLANK: Self = Self::ZERO;

    fn towards(self, other: Self, along: f64) -> Self {
        self + (other - self) * along
    }
}

/// A convex polygon without allocation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon<C> {
    length: usize,
    corners: [C; CAPACITY],
}

impl<C: Corner> Polygon<C> {
    pub(super) const EMPTY: Self = Self {
        length: 0,
        corners: [C::BLANK; CAPACITY],
    };

    /// The polygon with these corners, at most [`CAPACITY`].
    pub(super) fn set(&mut self, corners: impl IntoIterator<Item = C>) {
        self.length = 0;
        for corner in corners {
            self.push(corner);
        }
    }

    pub(super) fn corners(&self) -> &[C] {
        &self.corners[..self.length]
    }

    fn push(&mut self, corner: C) {
        if let Some(slot) = self.corners.get_mut(self.length) {
            *slot = corner;
            self.length += 1;
        } else {
            debug_assert!(false, "a cut polygon has too many corners");
        }
    }

    /// Cuts along the zero line of `height`, linear over the polygon: what is below and what is above, both with
    /// the corners on the line. `snap` puts a new corner exactly on it.
    pub(super) fn cut(
        &self,
        height: impl Fn(&C) -> f64,
        snap: impl Fn(&mut C),
        below: &mut Self,
        above: &mut Self,
    ) {
        below.length = 0;
        above.length = 0;
        let Some(last) = self.corners().last() else {
            return;
        };
        let (mut from, mut from_height) = (*last, height(last));
        for &to in self.corners() {
            let to_height = height(&to);
            if (from_height < 0.0 && to_height > 0.0) || (from_height > 0.0 && to_height < 0.0) {
                let mut crossing = from.towards(to, from_height / (from_height - to_height));
                snap(&mut crossing);
                below.push(crossing);
                above.push(crossing);
            }
            if to_height <= 0.0 {
                below.push(to);
            }
            if to_height >= 0.0 {
                above.push(to);
            }
            (from, from_height) = (to, to_height);
        }
    }
}
