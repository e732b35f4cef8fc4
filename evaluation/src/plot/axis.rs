//! Axes: what they reach, and where their ticks are.

/// How values are spread along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm; shows values above 0 only.
    Log,
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    /// What is along it, with its unit.
    pub label: String,
    /// How.
    pub scale: Scale,
}

impl Axis {
    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Log,
        }
    }

    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
        }
    }

    /// Whether `value` has a place along the axis.
    pub(super) fn can_show(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == Scale::Linear || value > 0.0)
    }

    /// What the axis has to reach for `values`, with a little room; `None` where it can show none of them.
    pub(super) fn span(&self, values: impl Iterator<Item = f64>) -> Option<Span> {
        let (low, high) = values
            .filter(|&value| self.can_show(value))
            .map(|value| forward(self.scale, value))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return None;
        }
        let least = match self.scale {
            Scale::Log => 0.1,
            Scale::Linear => (1e-6 * high.abs()).max(1e-9),
        };
        let room = (0.05 * (high - low)).max(0.5 * least);
        Some(Span {
            scale: self.scale,
            low: low - room,
            high: high + room,
        })
    }
}

fn forward(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Log => value.log10(),
    }
}

/// A part of an axis; ends are decimal logarithms where it is logarithmic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    scale: Scale,
    low: f64,
    high: f64,
}

impl Span {
    /// Where `value` is, 0 at the low end and 1 at the high one, never outside.
    pub(super) fn part(&self, value: f64) -> f64 {
        let part = (forward(self.scale, value) - self.low) / (self.high - self.low);
        part.clamp(0.0, 1.0)
    }

    /// Round values along the span, with their labels; three at least where that is possible, nine at most.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        let values = match self.scale {
            Scale::Linear => steps(self.low, self.high),
            Scale::Log => decades(self.low, self.high),
        };
        let last = values.last().copied().unwrap_or(0.0).abs();
        let nearest = values.windows(2).map(|pair| pair[1] - pair[0]);
        let step = nearest.fold(last.max(1e-300), f64::min);
        let label = |value: f64| match self.scale {
            Scale::Linear => with_decimals(value, step),
            Scale::Log => short(value),
        };
        values
            .into_iter()
            .map(|value| (value, label(value)))
            .collect()
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn steps(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 6.0;
    let power = 10_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0];
    let step = power
        * factor
            .into_iter()
            .find(|f| f * power >= rough)
            .unwrap_or(10.0);
    let first = (low / step).ceil();
    (0..12)
        .map(|k| (first + f64::from(k)) * step)
        .take_while(|value| *value <= high)
        .collect()
}

/// Powers of ten; with their double and fivefold where there are few.
fn decades(low: f64, high: f64) -> Vec<f64> {
    let wide = high - low;
    let factors: &[f64] = if wide < 1.1 {
        &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0]
    } else if wide < 2.6 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "decimal logarithms of finite values"
    )]
    let (from, to) = (low.floor() as i32, high.ceil() as i32);
    // Every second or third power where there are too many.
    let stride = 1 + (to - from) / 9;
    (from..=to)
        .filter(|power| power % stride == 0)
        .flat_map(|power| factors.iter().map(move |f| f * 10_f64.powi(power)))
        .filter(|value| (low..=high).contains(&value.log10()))
        .collect()
}

/// `value` with as many decimals as `step` needs.
fn with_decimals(value: f64, step: f64) -> String {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let decimals = (-(step * 1.000_1).log10().floor()).clamp(0.0, 9.0) as usize;
    // Steps such as 0.25 need one more than their size says.
    let exact = (step * 10_f64.powi(i32::try_from(decimals).unwrap_or(0))).fract();
    let decimals = decimals + usize::from((0.01..0.99).contains(&exact));
    let value = if value.abs() < 1e-9 * step {
        0.0
    } else {
        value
    };
    format!("{value:.decimals$}")
}

/// A number in few letters: 0.5, 20, 5k, 2M, 1e-4.
pub fn short(value: f64) -> String {
    let size = value.abs();
    let trimmed = |value: f64| {
        let text = format!("{value:.2}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    if size >= 1e9 {
        format!("{}G", trimmed(value / 1e9))
    } else if size >= 1e6 {
        format!("{}M", trimmed(value / 1e6))
    } else if size >= 1e3 {
        format!("{}k", trimmed(value / 1e3))
    } else if size >= 0.01 || size <= 0.0 {
        trimmed(value)
    } else {
        let text = format!("{value:.1e}");
        text.replace(".0e", "e")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.5, "0.5"),
            (20.0, "20"),
            (1500.0, "1.5k"),
            (2e6, "2M"),
            (3e9, "3G"),
            (1e-4, "1e-4"),
            (2.5e-5, "2.5e-5"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn ticks_are_round_and_within() {
        let axis = Axis::linear("x");
        let labels = |axis: &Axis, values: &[f64]| -> Vec<String> {
            let span = axis.span(values.iter().copied()).unwrap();
            let ticks = span.ticks();
            assert!(ticks.iter().all(|t| (0.0..=1.0).contains(&span.part(t.0))));
            ticks.into_iter().map(|t| t.1).collect()
        };
        assert_eq!(
            labels(&axis, &[0.0, 1.0]),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        let log = Axis::log("x");
        assert_eq!(
            labels(&log, &[1e-5, 1e-2]),
            ["1e-5", "1e-4", "1e-3", "0.01"]
        );
        assert!(labels(&log, &[3e3, 9e3]).len() >= 3);
        assert!(labels(&log, &[1e-9, 1e9]).len() <= 10);
    }

    #[test]
    fn one_value_and_equal_values_have_a_span() {
        for axis in [Axis::linear("x"), Axis::log("x")] {
            let span = axis.span([7.0, 7.0].into_iter()).unwrap();
            assert!((span.part(7.0) - 0.5).abs() < 1e-9);
        }
        assert_eq!(Axis::log("x").span([0.0, -1.0, f64::NAN].into_iter()), None);
        assert_eq!(Axis::linear("x").span(std::iter::empty()), None);
    }
}
