//! Which releases of a button, or of a finger, end a double click.

use std::time::{Duration, Instant};

/// Longest time between two clicks that belong together.
const PAUSE: Duration = Duration::from_millis(400);
/// Farthest that the places of one click, or of two, may be apart, physical pixels.
const NEAR_PX: f64 = 12.0;

/// What was pressed and released last.
#[derive(Debug, Default)]
pub(crate) struct Clicks {
    pressed: Option<[f64; 2]>,
    clicked: Option<(Instant, [f64; 2])>,
}

impl Clicks {
    /// Something went down.
    pub(crate) fn press(&mut self, place: [f64; 2]) {
        self.pressed = Some(place);
    }

    /// It went up; whether that was the second of two clicks at one place.
    pub(crate) fn release(&mut self, now: Instant, place: [f64; 2]) -> bool {
        let is_near = |a: [f64; 2]| (a[0] - place[0]).hypot(a[1] - place[1]) <= NEAR_PX;
        if !self.pressed.take().is_some_and(is_near) {
            self.clicked = None;
            return false;
        }
        let is_second = self
            .clicked
            .take()
            .is_some_and(|(then, at)| now.duration_since(then) <= PAUSE && is_near(at));
        if !is_second {
            self.clicked = Some((now, place));
        }
        is_second
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_quick_clicks_at_one_place_are_one() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut clicks = Clicks::default();
        let mut click = |ms, from: [f64; 2], to: [f64; 2]| {
            clicks.press(from);
            clicks.release(at(ms), to)
        };
        assert!(!click(0, [5.0, 5.0], [5.0, 5.0]));
        assert!(click(300, [8.0, 5.0], [8.0, 6.0]));
        // The third is a first again; then too late, elsewhere, a drag.
        assert!(!click(400, [8.0, 5.0], [8.0, 6.0]));
        assert!(!click(900, [8.0, 5.0], [8.0, 6.0]));
        assert!(!click(950, [80.0, 5.0], [80.0, 6.0]));
        assert!(!click(1000, [80.0, 5.0], [180.0, 6.0]));
        assert!(!click(1050, [180.0, 5.0], [180.0, 6.0]));
    }
}
