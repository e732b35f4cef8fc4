//! Geometric error against triangles and bytes.
//!
//! The file's surface is measured at uniform cuts, exactly as `measure` does; levels of detail are made of the input with as many
//! triangles as those cuts have, and measured alike.

use super::super::open::Opened;
use super::super::reference::Reference;
use super::super::surface::{self, Surface, Wanted};
use super::data::{Fronts, GeometryPoint, Method};
use super::lods::{self, Frame};
use super::split::SplitMesh;
use anyhow::Context;
use glam::DVec3;
use marquetry_evaluation::distance::{self, Distances, Mesh};
use marquetry_evaluation::pareto;
use std::time::Instant;

/// Each cut has at most this part of the triangles of the one before.
const STEP: u64 = 2;

/// Surfaces of the file, finest first: `most` of them, each of at most half the triangles of the one before.
///
/// # Errors
/// When the file cannot be read, or a surface cannot be measured.
pub(super) fn file_curve(
    file: &str,
    opened: &Opened,
    reference: &Reference,
    samples: u64,
    most: usize,
    mut tell: impl FnMut(f64),
) -> anyhow::Result<Vec<GeometryPoint>> {
    let coarsest = surface::coarsest_triangles(opened);
    let mut points: Vec<GeometryPoint> = Vec::new();
    let mut wanted = Wanted::Finest;
    while points.len() < most {
        let start = Instant::now();
        let surface = surface::extract(file, opened, wanted)?;
        let seconds = start.elapsed().as_secs_f64();
        let mut point =
            file_point(&surface, reference, samples, seconds).context(file.to_owned())?;
        if let Wanted::Triangles(most) = wanted {
            point.asked_triangles = Some(most);
        }
        points.push(point);
        tell(points.len() as f64 / most as f64);
        let next = surface.triangles.len() as u64 / STEP;
        if next < coarsest || next == 0 {
            break;
        }
        wanted = Wanted::Triangles(next);
    }
    Ok(points)
}

fn file_point(
    surface: &Surface,
    reference: &Reference,
    samples: u64,
    seconds: f64,
) -> anyhow::Result<GeometryPoint> {
    let measured = Mesh {
        positions: &surface.positions,
        triangles: &surface.triangles,
    };
    let distances = distance::measure(measured, reference.mesh(), samples)?;
    Ok(GeometryPoint {
        bytes: Some(surface.bytes),
        bound_rel: Some(surface.error_rel),
        seconds: Some(seconds),
        ..point(
            Method::Marquetry,
            surface.triangles.len(),
            reference,
            &distances,
        )
    })
}

fn point(
    method: Method,
    triangles: usize,
    reference: &Reference,
    distances: &Distances,
) -> GeometryPoint {
    GeometryPoint {
        method,
        asked_triangles: None,
        triangles: triangles as u64,
        bytes: None,
        rms_rel: reference.rel(distances.rms()),
        rms_interval_rel: Some(distances.rms_interval().map(|length| reference.rel(length))),
        hausdorff_rel: Some(reference.rel(distances.hausdorff())),
        bound_rel: None,
        normal_deviation_deg: Some(distances.normal_deviation_deg.mean),
        seconds: None,
        on_front: Fronts::default(),
    }
}

/// Triangles of the levels that are compared with cuts of so many, finest first: as many as each, and halves between two that are
/// farther apart.
pub(super) fn level_sizes(cuts: &[GeometryPoint]) -> Vec<u64> {
    let mut sizes: Vec<u64> = Vec::new();
    for cut in cuts {
        while let Some(&last) = sizes
            .last()
            .filter(|&&last| last / STEP > cut.triangles * 3 / 2)
        {
            sizes.push(last / STEP);
        }
        sizes.push(cut.triangles);
    }
    sizes
}

/// A level of detail and what is known of it.
#[derive(Debug)]
pub(super) struct Level {
    pub(super) mesh: SplitMesh,
    pub(super) point: GeometryPoint,
}

/// Levels of the input with at most as many triangles as `wanted` says, those left out that have more than the input or do not
/// come out smaller than the one before.
///
/// # Errors
/// When a level cannot be measured or stored.
pub(super) fn levels(
    source: &SplitMesh,
    reference: &Reference,
    wanted: impl Iterator<Item = u64>,
    samples: u64,
    mut tell: impl FnMut(f64),
) -> anyhow::Result<Vec<Level>> {
    let frame = Frame::new(reference.min, reference.max);
    let appearance = &reference.mesh.appearance;
    let images: u64 = appearance.images.iter().map(|i| i.bytes.len() as u64).sum();
    let wanted: Vec<u64> = wanted.collect();
    let mut levels: Vec<Level> = Vec::new();
    let all = wanted.len() as f64;
    for (done, wanted) in wanted.into_iter().enumerate() {
        tell(done as f64 / all);
        let last = levels
            .last()
            .map_or(source.triangles.len(), |level| level.mesh.triangles.len());
        let wanted = usize::try_from(wanted).unwrap_or(usize::MAX);
        if wanted >= last {
            continue;
        }
        let start = Instant::now();
        let mesh = lods::simplified(source, wanted, &frame);
        let seconds = start.elapsed().as_secs_f64();
        if mesh.triangles.is_empty() || mesh.triangles.len() >= last {
            continue;
        }
        let positions: Vec<DVec3> = mesh.vertices.iter().map(|v| v.position).collect();
        let measured = Mesh {
            positions: &positions,
            triangles: &mesh.triangles,
        };
        let distances = distance::measure(measured, reference.mesh(), samples)?;
        let (textured, coloured) = (images > 0, !reference.mesh.colours.is_empty());
        let bytes = images + lods::stored_bytes(&mesh, &frame, textured, coloured)?;
        let point = GeometryPoint {
            asked_triangles: Some(wanted as u64),
            bytes: Some(bytes),
            seconds: Some(seconds),
            ..point(
                Method::DiscreteLods,
                mesh.triangles.len(),
                reference,
                &distances,
            )
        };
        levels.push(Level { mesh, point });
    }
    Ok(levels)
}

/// The input itself, `bytes` long.
pub(super) fn original(reference: &Reference, bytes: u64) -> GeometryPoint {
    GeometryPoint {
        method: Method::Original,
        asked_triangles: None,
        triangles: reference.mesh.triangles.len() as u64,
        bytes: Some(bytes),
        rms_rel: 0.0,
        rms_interval_rel: Some([0.0; 2]),
        hausdorff_rel: Some(0.0),
        bound_rel: Some(0.0),
        normal_deviation_deg: Some(0.0),
        seconds: None,
        on_front: Fronts::default(),
    }
}

/// Says of all points on which fronts they are.
pub(super) fn mark_fronts(points: &mut [GeometryPoint]) {
    let front = |points: &[GeometryPoint], of: fn(&GeometryPoint) -> Option<(f64, f64)>| {
        let pairs: Vec<_> = points
            .iter()
            .map(|p| of(p).unwrap_or((f64::NAN, f64::NAN)))
            .collect();
        pareto::front(&pairs)
    };
    let triangles = front(points, |p| Some((p.triangles as f64, p.rms_rel)));
    let bytes = front(points, |p| Some((p.bytes? as f64, p.rms_rel)));
    let hausdorff = front(points, |p| Some((p.triangles as f64, p.hausdorff_rel?)));
    for (k, point) in points.iter_mut().enumerate() {
        point.on_front = Fronts {
            triangles: triangles[k],
            bytes: bytes[k],
            hausdorff: hausdorff[k],
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(triangles: u64, rms_rel: f64, bytes: Option<u64>) -> GeometryPoint {
        GeometryPoint {
            bytes,
            ..GeometryPoint::bare(Method::Marquetry, triangles, rms_rel)
        }
    }

    #[test]
    fn levels_have_no_gaps_where_cuts_have() {
        let cuts = [4_000, 1_900, 100].map(|triangles| point(triangles, 1e-3, None));
        assert_eq!(level_sizes(&cuts), [4_000, 1_900, 950, 475, 237, 100]);
        assert!(level_sizes(&[]).is_empty());
    }

    #[test]
    fn fronts_are_of_points_that_have_both_numbers() {
        let mut points = [
            point(10, 1e-2, Some(100)),
            point(20, 1e-3, None),
            point(30, 2e-3, Some(50)),
        ];
        mark_fronts(&mut points);
        let triangles = points.each_ref().map(|p| p.on_front.triangles);
        assert_eq!(triangles, [true, true, false]);
        assert_eq!(
            points.each_ref().map(|p| p.on_front.bytes),
            [false, false, true]
        );
        assert!(points.iter().all(|p| !p.on_front.hausdorff));
    }
}
