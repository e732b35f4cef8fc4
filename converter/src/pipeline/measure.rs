//! Measuring what will be written, before it is.

use super::{Conversion, ConvertError, Frame};
use crate::atlas::{build, quantize};
use crate::cluster;
use crate::report::ErrorReport;
use glam::DVec3;
use marquetry_evaluation::distance::{self, Indexed, MeshError};

/// Part of the target that clusters are made for.
pub(super) const TRIM_AIM: f64 = 0.95;
/// At least so much closer clusters are made that turn out too coarse.
const TRIM_STEP: f64 = 0.9;

/// A guaranteed distance is tight enough at this multiple of what was found.
const TIGHT: f64 = 2.0;

/// So many times the root mean square is rarely exceeded, by the worst places of torn scans alone. That all else is nearer does not take long to find out.
const RARE: f64 = 16.0;

/// Samples of the measurement of the written file, each way, beside all vertices.
pub(super) const MEASURED_SAMPLES: u64 = 100_000;

impl Conversion<'_> {
    /// Measures the surface that will be written, with more in its clusters where too much was left out.
    pub(super) fn measured(
        &self,
        source: distance::Mesh<'_>,
        gone: &[DVec3],
        atlas: &build::Atlas,
        clusters: Option<&mut cluster::Layer>,
        frame: &Frame,
    ) -> Result<ErrorReport, ConvertError> {
        let Some(layer) = clusters else {
            let (positions, triangles) = quantize::finest_surface(&atlas.charts, &frame.lattice);
            let surface = distance::Mesh {
                positions: &positions,
                triangles: &triangles,
            };
            let found = Found::of(surface, source, gone).map_err(|e| self.unmeasured(e))?;
            return Ok(self.error(found, atlas.max_error, frame));
        };
        if atlas.charts.is_empty() && gone.is_empty() {
            return self.measured_clusters(source, layer, frame);
        }
        let mut aim = TRIM_AIM;
        loop {
            let (mut positions, mut triangles) =
                quantize::finest_surface(&atlas.charts, &frame.lattice);
            cluster::append_finest(&layer.nodes, &frame.lattice, &mut positions, &mut triangles);
            let surface = distance::Mesh {
                positions: &positions,
                triangles: &triangles,
            };
            let found = Found::of(surface, source, gone).map_err(|e| self.unmeasured(e))?;
            let error = self.error(found, atlas.max_error.max(layer.max_error), frame);
            if !trimmed_less(layer, &error, &mut aim, frame) {
                return Ok(error);
            }
        }
    }

    /// The same where clusters are all there is, and `source` all that they are made of. Then what can be guaranteed is measured as well.
    fn measured_clusters(
        &self,
        source: distance::Mesh<'_>,
        layer: &mut cluster::Layer,
        frame: &Frame,
    ) -> Result<ErrorReport, ConvertError> {
        let source = Indexed::new(source).map_err(|e| self.unmeasured(e))?;
        let mut aim = TRIM_AIM;
        loop {
            let (mut positions, mut triangles) = (Vec::new(), Vec::new());
            cluster::append_finest(&layer.nodes, &frame.lattice, &mut positions, &mut triangles);
            let surface = Indexed::new(distance::Mesh {
                positions: &positions,
                triangles: &triangles,
            })
            .map_err(|e| self.unmeasured(e))?;
            let measured = surface.measure(&source, MEASURED_SAMPLES);
            let found = Found {
                rms: measured.rms(),
                hausdorff: measured.hausdorff(),
            };
            let error = self.error(found, layer.max_error, frame);
            if trimmed_less(layer, &error, &mut aim, frame) {
                continue;
            }
            if layer.max_error <= TIGHT * found.hausdorff {
                return Ok(error);
            }
            let rare = found.hausdorff.min(RARE * found.rms);
            layer.tighten(&surface, &source, rare);
            return Ok(self.error(found, layer.max_error, frame));
        }
    }

    pub(super) fn unmeasured(&self, source: MeshError) -> ConvertError {
        ConvertError::Measure {
            path: self.input.to_owned(),
            source,
        }
    }

    /// What is stated of a surface, of which `bound` is a guaranteed distance.
    fn error(&self, found: Found, bound: f64, frame: &Frame) -> ErrorReport {
        let relative = |length: f64| {
            if frame.diagonal > 0.0 {
                length / frame.diagonal
            } else {
                0.0
            }
        };
        ErrorReport {
            target_rel: self.options.error_rel,
            // The bound holds for real numbers; rounding must not let it fall below what was seen.
            max_rel: relative(found.hausdorff.max(bound)),
            rms_rel: relative(found.rms),
            hausdorff_rel: relative(found.hausdorff),
        }
    }

    /// Refuses an error above the target.
    pub(super) fn judge(&self, error: &ErrorReport) -> Result<(), ConvertError> {
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

/// Distances that were found, lengths.
#[derive(Debug, Clone, Copy)]
struct Found {
    rms: f64,
    hausdorff: f64,
}

impl Found {
    /// Between a surface and a source. Points of the source that are `gone` from the mesh to measure against are measured by themselves.
    fn of(
        surface: distance::Mesh<'_>,
        source: distance::Mesh<'_>,
        gone: &[DVec3],
    ) -> Result<Self, MeshError> {
        let measured = distance::measure(surface, source, MEASURED_SAMPLES)?;
        let of_gone = distance::from_points(gone, surface)?;
        Ok(Self {
            rms: measured.rms().max(of_gone.rms),
            hausdorff: measured.hausdorff().max(of_gone.max),
        })
    }
}

/// Trims clusters less that came out too coarse; whether there was something to do.
fn trimmed_less(
    layer: &mut cluster::Layer,
    error: &ErrorReport,
    aim: &mut f64,
    frame: &Frame,
) -> bool {
    // What costs nothing is left out whatever the aim is.
    let costs_nothing = frame.trimmed_rms(*aim) == 0.0;
    if error.rms_rel <= error.target_rel || !layer.is_trimmed() || costs_nothing {
        return false;
    }
    *aim *= (error.target_rel / error.rms_rel).min(TRIM_STEP);
    layer.trim(frame.trimmed_rms(*aim), frame.most_distance());
    true
}
