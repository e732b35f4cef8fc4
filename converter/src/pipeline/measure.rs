//! Measuring what will be written, before it is.

use super::{Conversion, ConvertError, Frame};
use crate::atlas::{build, quantize};
use crate::cluster;
use crate::report::ErrorReport;
use glam::DVec3;
use marquetry_evaluation::distance;

/// Part of the target that clusters are made for.
pub(super) const TRIM_AIM: f64 = 0.95;
/// At least so much closer clusters are made that turn out too coarse.
const TRIM_STEP: f64 = 0.9;

/// Samples of the measurement of the written file, each way, beside all vertices.
const MEASURED_SAMPLES: u64 = 100_000;

impl Conversion<'_> {
    /// Measures the surface that will be written, with more in its clusters where too much was left out, and refuses it above the target.
    pub(super) fn measured(
        &self,
        source: distance::Mesh<'_>,
        gone: &[DVec3],
        atlas: &build::Atlas,
        mut clusters: Option<&mut cluster::Layer>,
        frame: &Frame,
    ) -> Result<ErrorReport, ConvertError> {
        let mut aim = TRIM_AIM;
        loop {
            let error = self.measure(source, gone, atlas, clusters.as_deref(), frame)?;
            match clusters.as_deref_mut() {
                Some(layer) if error.rms_rel > error.target_rel && layer.is_trimmed() => {
                    aim *= (error.target_rel / error.rms_rel).min(TRIM_STEP);
                    layer.trim(frame.trimmed_rms(aim), frame.most_distance());
                }
                _ => {
                    self.judge(&error)?;
                    return Ok(error);
                }
            }
        }
    }

    /// Measures the surface that will be written. Vertices of the source that are `gone` from the mesh to measure against are measured
    /// by themselves.
    fn measure(
        &self,
        source: distance::Mesh<'_>,
        gone: &[DVec3],
        atlas: &build::Atlas,
        clusters: Option<&cluster::Layer>,
        frame: &Frame,
    ) -> Result<ErrorReport, ConvertError> {
        let (mut positions, mut triangles) =
            quantize::finest_surface(&atlas.charts, &frame.lattice);
        let mut bound = atlas.max_error;
        if let Some(layer) = clusters {
            cluster::append_finest(&layer.nodes, &frame.lattice, &mut positions, &mut triangles);
            bound = bound.max(layer.max_error);
        }
        let surface = distance::Mesh {
            positions: &positions,
            triangles: &triangles,
        };
        let unmeasured = |source| ConvertError::Measure {
            path: self.input.to_owned(),
            source,
        };
        let measured = distance::measure(surface, source, MEASURED_SAMPLES).map_err(unmeasured)?;
        let of_gone = distance::from_points(gone, surface).map_err(unmeasured)?;
        let hausdorff = measured.hausdorff().max(of_gone.max);
        let relative = |length: f64| {
            if frame.diagonal > 0.0 {
                length / frame.diagonal
            } else {
                0.0
            }
        };
        Ok(ErrorReport {
            target_rel: self.options.error_rel,
            // The bound holds for real numbers; rounding must not let it fall below what was seen.
            max_rel: relative(hausdorff.max(bound)),
            rms_rel: relative(measured.rms().max(of_gone.rms)),
            hausdorff_rel: relative(hausdorff),
        })
    }

    /// Refuses an error above the target.
    fn judge(&self, error: &ErrorReport) -> Result<(), ConvertError> {
        if error.rms_rel > error.target_rel && !self.options.allow_worse {
            return Err(ConvertError::AboveTarget {
                path: self.input.to_owned(),
                reached: error.rms_rel,
                target: error.target_rel,
            });
        }
        Ok(())
    }
}
