//! What a chart is made of: the JSON report, and what tables and plots are drawn from.
//!
//! Lengths that end in `_rel` are parts of the diagonal of the input's bounds.

use marquetry_evaluation::image::OutlineDistance;
use marquetry_evaluation::popping::Spread;
use serde::Serialize;

/// The whole report.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Report {
    pub(super) file: FileInfo,
    pub(super) input: InputInfo,
    pub(super) settings: Settings,
    /// `None` where no pictures were made.
    pub(super) adapter: Option<Adapter>,
    pub(super) geometry: Vec<GeometryPoint>,
    pub(super) pictures: Vec<PicturePoint>,
    pub(super) equal_cost: Option<EqualCost>,
    /// Empty unless asked for.
    pub(super) transitions: Vec<TransitionPoint>,
    /// Empty unless asked for.
    pub(super) rows: Vec<RowPoint>,
    pub(super) recommendations: Vec<Recommendation>,
    pub(super) conversions: Vec<ConversionPoint>,
    /// What a reader has to know of these numbers.
    pub(super) notes: Vec<String>,
    pub(super) seconds: f64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct FileInfo {
    pub(super) path: String,
    pub(super) bytes: u64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct InputInfo {
    pub(super) path: String,
    pub(super) bytes: u64,
    pub(super) triangles: u64,
    pub(super) textured: bool,
    /// In the input's unit.
    pub(super) diagonal: f64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct Settings {
    /// Each way, beside all vertices.
    pub(super) samples: u64,
    pub(super) size: [u32; 2],
    /// Numbers of standard views.
    pub(super) views: Vec<usize>,
    /// Bounding-sphere radii.
    pub(super) distances: Vec<f64>,
    pub(super) threads: usize,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Adapter {
    pub(super) name: String,
    /// Whether it is a program on the processor, whose times are no graphics card's.
    pub(super) software: bool,
}

/// Whose surface a point is of.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// The file.
    Marquetry,
    /// Discrete levels of detail by quadric simplification.
    DiscreteLods,
    /// The input as it is.
    Original,
    /// Another tool, by name.
    External(String),
}

impl Method {
    /// For people.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Marquetry => "Marquetry",
            Self::DiscreteLods => "discrete LODs",
            Self::Original => "original mesh",
            Self::External(name) => name,
        }
    }
}

/// On which fronts of all points of its kind a point is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub(super) struct Fronts {
    /// RMS against triangles.
    pub(super) triangles: bool,
    /// RMS against bytes.
    pub(super) bytes: bool,
    /// Hausdorff distance against triangles.
    pub(super) hausdorff: bool,
}

/// A surface: how far from the input, for how much.
#[derive(Debug, Clone, Serialize)]
pub(super) struct GeometryPoint {
    pub(super) method: Method,
    /// Most triangles that were asked for, as of `measure --triangles`; absent for what is finest.
    pub(super) asked_triangles: Option<u64>,
    pub(super) triangles: u64,
    /// To read it; of the original: as stored.
    pub(super) bytes: Option<u64>,
    pub(super) rms_rel: f64,
    /// 95% confidence; absent where it is not known.
    pub(super) rms_interval_rel: Option<[f64; 2]>,
    /// Sampled: a lower bound.
    pub(super) hausdorff_rel: Option<f64>,
    /// Guaranteed: an upper bound.
    pub(super) bound_rel: Option<f64>,
    /// Mean, degrees.
    pub(super) normal_deviation_deg: Option<f64>,
    /// To make it.
    pub(super) seconds: Option<f64>,
    pub(super) on_front: Fronts,
}

#[cfg(test)]
impl GeometryPoint {
    /// One of which nothing else is known.
    pub(super) fn bare(method: Method, triangles: u64, rms_rel: f64) -> Self {
        Self {
            method,
            asked_triangles: None,
            triangles,
            bytes: None,
            rms_rel,
            rms_interval_rel: None,
            hausdorff_rel: None,
            bound_rel: None,
            normal_deviation_deg: None,
            seconds: None,
            on_front: Fronts::default(),
        }
    }
}

/// A mean over views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Estimate {
    pub(super) mean: f64,
    /// 95% confidence, by the spread between views; `None` for fewer than two.
    pub(super) interval: Option<[f64; 2]>,
}

impl Estimate {
    /// Of `values`, by the normal distribution; `None` without any.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let interval = (values.len() > 1).then(|| {
            let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
            let reach = 1.96 * (squares / (count - 1.0) / count).sqrt();
            [mean - reach, mean + reach]
        });
        Some(Self { mean, interval })
    }
}

/// Pictures of one method at one setting from one distance.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PicturePoint {
    pub(super) method: Method,
    /// Bounding-sphere radii.
    pub(super) distance: f64,
    /// What was asked for: a screen-space error, or a level.
    pub(super) setting: String,
    /// Drawn, mean over the views.
    pub(super) triangles: f64,
    /// Over the object's pixels, 1 for equal pictures.
    pub(super) ssim: Estimate,
    /// Over the object's pixels, 0 for equal pictures.
    pub(super) flip: Estimate,
    /// Over the object's pixels of all views; `None` for equal pictures.
    pub(super) psnr_db: Option<f64>,
    /// Largest and mean over the views' outlines; `None` where there is none.
    pub(super) outline: Option<OutlineDistance>,
    /// SSIM over three views at right angles.
    pub(super) ssim_three_views: Option<f64>,
    pub(super) time: FrameTime,
    pub(super) views: usize,
    /// SSIM against triangles, of this distance.
    pub(super) on_front: bool,
}

/// Time of a frame, everything resident: medians over the views that were timed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(super) struct FrameTime {
    /// Until the GPU has its commands.
    pub(super) cpu_ms: f64,
    /// Until the picture is there.
    pub(super) frame_ms: f64,
    /// `None` where it cannot be measured, or the adapter is no GPU.
    pub(super) gpu_ms: Option<f64>,
    /// Frames that were timed.
    pub(super) frames: usize,
}

/// The file against discrete levels at the same cost.
#[derive(Debug, Clone, Serialize)]
pub(super) struct EqualCost {
    pub(super) pairs: Vec<EqualCostPair>,
    /// Means over the pairs; `None` without any.
    pub(super) all_views: Option<Versus>,
    /// The same for three views at right angles.
    pub(super) three_views: Option<Versus>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct EqualCostPair {
    pub(super) distance: f64,
    pub(super) setting: String,
    pub(super) triangles: f64,
    pub(super) all_views: Versus,
    pub(super) three_views: Option<Versus>,
}

/// SSIM of two methods.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Versus {
    pub(super) marquetry: f64,
    pub(super) discrete_lods: f64,
}

/// One way of changing levels, along one path.
#[derive(Debug, Clone, Serialize)]
pub(super) struct TransitionPoint {
    pub(super) transition: String,
    /// Number of a standard view.
    pub(super) view: usize,
    /// Changes of levels that were looked at.
    pub(super) changes: usize,
    /// Of all looks.
    pub(super) frames: usize,
    /// Change from frame to frame that the reference does not have.
    pub(super) temporal: Spread,
    /// The same of frames that draw the levels of the frame before, where these change at once: what the camera's motion does by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) unchanged: Option<Spread>,
    /// Distance from the reference.
    pub(super) fidelity: Spread,
    /// Drawn, mean.
    pub(super) triangles: f64,
}

#[cfg(test)]
impl TransitionPoint {
    /// Pops by `p99` in every frame, and draws so many triangles.
    pub(super) fn bare(transition: &str, p99: f64, triangles: f64) -> Self {
        let spread = |value| Spread {
            mean: value,
            p99: value,
            max: value,
        };
        Self {
            transition: transition.to_owned(),
            view: 0,
            changes: 1,
            frames: 10,
            temporal: spread(p99),
            unchanged: None,
            fidelity: spread(0.1),
            triangles,
        }
    }
}

/// A frame of many models in a row along the view axis, mean over frames.
#[derive(Debug, Clone, Serialize)]
pub(super) struct RowPoint {
    pub(super) transition: String,
    pub(super) instances: usize,
    pub(super) triangles: f64,
    pub(super) draw_calls: f64,
    /// Choosing what is drawn, and, where a graphics card is timed, giving it its commands.
    pub(super) cpu_ms: f64,
    /// `None` where it cannot be measured, and where the adapter is a program.
    pub(super) gpu_ms: Option<f64>,
}

/// Which transition to take for so many models.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Recommendation {
    pub(super) instances: usize,
    pub(super) transition: String,
    /// Of one model, mean over paths.
    pub(super) popping_p99: f64,
    /// Cost of its frames over that of the cheapest transition's.
    pub(super) over_cheapest: f64,
}

/// A conversion of the input.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ConversionPoint {
    /// RMS error asked for.
    pub(super) error_rel: f64,
    pub(super) seconds: f64,
    pub(super) cpu_seconds: f64,
    pub(super) bytes: u64,
    /// Measured.
    pub(super) rms_rel: f64,
    /// Guaranteed.
    pub(super) max_rel: f64,
    /// RMS against seconds.
    pub(super) on_front: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_knows_how_sure_it_is() {
        assert_eq!(Estimate::of(&[]), None);
        let one = Estimate::of(&[0.5]).unwrap();
        assert_eq!(one.interval, None);
        let [low, high] = Estimate::of(&[0.4, 0.6]).unwrap().interval.unwrap();
        // Standard error of the mean: 0.1.
        assert!((low - (0.5 - 0.196)).abs() < 1e-12 && (high - 0.696).abs() < 1e-12);
        let many = Estimate::of(&[0.4, 0.6].repeat(50)).unwrap();
        assert!(many.interval.unwrap()[1] < 0.53);
    }
}
