//! Decimation up to an error that is measured.
//!
//! How far collapses move a surface depends on what it is like: smooth, noisy, or full of creases. So the first pass stays well below what is wanted,
//! what it did is measured against the source, and the next ones are given what is left. One that goes too far is taken back.
//! What comes near what is wanted is fitted to the source ([`mod@crate::mesh::refit`]) before it is measured, which leaves room for more.

use super::{Decimated, Limits, Pass, area};
use crate::mesh::normals::vertex_normals;
use crate::mesh::refit::{Cloud, Refit, Shading, refit};
use crate::mesh::{NONE, WeldedMesh, weld};
use glam::{DVec3, Vec3};
use marquetry_evaluation::distance::{self, Indexed, MeshError};
use std::borrow::Cow;

/// Most triangles of a source that is kept to measure against what is made of it.
pub const MOST_KEPT: usize = 8_000_000;
/// Samples of a measurement.
const SAMPLES: u64 = 60_000;
/// A measurement of one in so many of the samples does where it shows a part of what is wanted outside of these.
const FEW: usize = 4;
const NEAR: std::ops::Range<f64> = 0.8..1.3;
/// What shows less than this part of what is wanted has a long way to go, and is not fitted.
const FITTED: f64 = 0.6;
/// Points that a mesh is fitted to, by its triangles; at most, of all of it.
const FITTED_TO: usize = 8;
const MOST_FITTED_TO: usize = 4_000_000;
/// Passes, at most, those taken back among them.
const PASSES: u32 = 6;
/// Limit of the first pass, over the RMS distance wanted.
const FIRST: f64 = 1.6;
/// What passes aim at, over what is wanted, and from which part on it is enough.
const AIM: f64 = 0.985;
const ENOUGH: f64 = 0.95;
/// By how much a pass goes beyond the one before at the same limit.
const AGAIN: f64 = 1.17;
/// How the limit has to follow where a pass went too far: the distance falls by less than it.
const BACK: f64 = 1.6;
/// Most that a limit gets to, over the RMS distance wanted. Where a surface is large faces and small detail, that is what keeps the detail.
const MOST: f64 = 3.0;
/// How much larger, or smaller, a limit gets at most from one pass to the next.
const STEP: f64 = 2.0;
const LEAST_STEP: f64 = 0.88;
/// Guaranteed distance of a pass, over the RMS distance wanted. It adds up from collapse to collapse: a quarter of it is found afterwards.
const BOUND: f64 = 30.0;
/// The same of a torn mesh, where large faces have the area and small detail is what moves, as far as it may.
const BOUND_TORN: f64 = 8.0;
/// What a unit of normal is to a pass, over the RMS distance wanted.
const NORMALS: f64 = 8.0;
/// Cosine between a vertex's own normal and the one that it was left with, at least.
const ALIKE: f64 = 0.7;
/// A pass that takes fewer triangles than one of so many has nothing more to gain.
const FEWEST: usize = 30;

/// What is left of a mesh.
#[derive(Debug, Clone)]
pub struct Aimed {
    /// Its triangles.
    pub mesh: WeldedMesh,
    /// Normals of its vertices that are nearest to those of the source, of length 1 or zero; none where nothing is gone, or the source was not kept.
    pub normals: Vec<DVec3>,
    /// What was done.
    pub decimated: Decimated,
}

impl Aimed {
    /// All of a mesh.
    pub fn whole(mesh: WeldedMesh) -> Self {
        Self {
            mesh,
            normals: Vec::new(),
            decimated: Decimated::default(),
        }
    }
}

/// What is left of a mesh without colours when as many triangles are gone as an RMS distance of `wanted`, a length, from it allows.
///
/// An owned mesh is freed after the first pass; what is made of it is not fitted, and its normals count for nothing. What is torn is not fitted either: what is nearest there is often another
/// sheet. Its vertices have the normals that collapses leave them. The same for any number of threads.
pub fn aimed(source: Cow<'_, WeldedMesh>, wanted: f64, is_torn: bool) -> Aimed {
    let bound = if is_torn { BOUND_TORN } else { BOUND };
    let mut decimated = Decimated::default();
    let (triangles, area_before) = (source.triangles.len(), area(&source));
    // What is welded has indices in range and finite places; anything else stays as it is.
    let Ok(samples) = Samples::of(&source) else {
        return Aimed::whole(source.into_owned());
    };
    let kept = match &source {
        Cow::Borrowed(source) if !is_torn => Some(*source),
        _ => None,
    };
    let normals = match &source {
        Cow::Borrowed(source) => vertex_normals(source.surface()),
        Cow::Owned(_) => Vec::new(),
    };
    let unit = |n: &DVec3| n.normalize_or_zero().as_vec3();
    let mut carried: Vec<Vec3> = normals.iter().map(unit).collect();
    let mut shading = Shading::default();
    let mut mesh = source;
    let mut limit = FIRST * wanted;
    for number in 0..PASSES {
        let limits = Limits {
            edge: f64::INFINITY,
            rms: limit,
            normals: NORMALS * wanted,
            bound: bound * wanted,
            notes_gone: false,
        };
        // Other blocks each time.
        let pass = Pass::over(&mesh, &carried, limits, (0.6 * f64::from(number)).fract());
        let count = mesh.triangles.len();
        let is_last = count - pass.triangles.len() < count / FEWEST;
        let pass_bound = pass.bound;
        let (mut after, carried_after) = left(&mesh, &carried, pass);
        let mut reached = samples.rms(&after, wanted);
        let (apart, mut fitted) = (reached / wanted, Refit::default());
        if let Some(source) = kept.filter(|_| apart >= FITTED) {
            let count = (FITTED_TO * after.triangles.len()).min(MOST_FITTED_TO);
            if let Ok(cloud) = Cloud::on(source.surface(), &normals, count as u64) {
                fitted = refit(&mut after, &cloud, |_| false);
                reached = samples.rms(&after, wanted);
            }
        }
        let (left, part) = (after.triangles.len(), reached / wanted);
        tracing::debug!(
            number,
            limit = limit / wanted,
            count,
            left,
            apart,
            part,
            "pass"
        );
        let further = AIM * wanted / reached.max(f64::MIN_POSITIVE);
        if reached <= wanted {
            decimated.rms = reached;
            decimated.bound += pass_bound + fitted.farthest;
            mesh = Cow::Owned(after);
            carried = carried_after;
            shading = fitted.shading;
            if is_last && number > 0 || reached >= ENOUGH * wanted {
                break;
            }
            limit = (limit * (further / AGAIN).clamp(LEAST_STEP, STEP)).min(MOST * wanted);
        } else {
            limit *= further.powf(BACK).max(1.0 / STEP);
        }
    }
    decimated.triangles = triangles - mesh.triangles.len();
    decimated.area = area_before - area(&mesh);
    let mesh = mesh.into_owned();
    let mut normals = Vec::new();
    if decimated.triangles > 0 && !carried.is_empty() {
        normals = unit_normals(&mesh);
        if shading.is_empty() {
            take_alike(&mut normals, &carried);
        }
        shading.fit(&mesh.triangles, &mut normals, |_| false);
    }
    Aimed {
        mesh,
        normals,
        decimated,
    }
}

/// What a pass leaves of a mesh, and of the normals of its vertices, if there are any.
fn left(mesh: &WeldedMesh, normals: &[Vec3], pass: Pass) -> (WeldedMesh, Vec<Vec3>) {
    let mut after = WeldedMesh {
        positions: mesh.positions.clone(),
        colours: Vec::new(),
        triangles: pass.triangles,
    };
    let mut normals = normals.to_vec();
    for moved in pass.moved {
        after.positions[moved.vertex as usize] = moved.place;
        if let Some(normal) = normals.get_mut(moved.vertex as usize) {
            *normal = moved.normal;
        }
    }
    let numbers = weld::drop_unused(&mut after.positions, &mut after.triangles);
    let mut numbers = numbers.iter();
    normals.retain(|_| numbers.next().is_some_and(|&number| number != NONE));
    (after, normals)
}

/// Normals of vertices by the faces around them, of length 1 or zero.
fn unit_normals(mesh: &WeldedMesh) -> Vec<DVec3> {
    let normals = vertex_normals(mesh.surface());
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// Takes the normals of `others` that are about like those that there are.
fn take_alike(normals: &mut [DVec3], others: &[Vec3]) {
    for (normal, other) in normals.iter_mut().zip(others) {
        let other = other.as_dvec3();
        if other.dot(*normal) >= ALIKE {
            *normal = other;
        }
    }
}

/// Points of the source.
struct Samples {
    all: Vec<DVec3>,
    few: Vec<DVec3>,
}

impl Samples {
    fn of(source: &WeldedMesh) -> Result<Self, MeshError> {
        let all = distance::samples(source.surface(), SAMPLES)?;
        let few = all.iter().copied().step_by(FEW).collect();
        Ok(Self { all, few })
    }

    /// RMS distance from a mesh; from few of the points where it is not near what is `wanted`.
    fn rms(&self, mesh: &WeldedMesh, wanted: f64) -> f64 {
        let Ok(mesh) = Indexed::new(mesh.surface()) else {
            return f64::INFINITY;
        };
        let reached = mesh.from_points(&self.few).rms;
        if NEAR.contains(&(reached / wanted)) {
            mesh.from_points(&self.all).rms
        } else {
            reached
        }
    }
}
