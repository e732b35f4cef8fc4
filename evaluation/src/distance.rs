//! Distances between two triangle meshes, sampled both ways.
//!
//! From every vertex of one mesh, and from samples spread evenly over its area, the exact distance to the
//! nearest point of the other mesh is taken (a [`Bvh`] answers it); then the same the other way round.
//!
//! Cignoni, Rocchini & Scopigno, "Metro: Measuring Error on Simplified Surfaces", 1998.
//! Differs: samples are stratified along the accumulated area, so any number of them covers the surface, and
//! the same input gives the same numbers for any number of threads.
//! Limit: a maximum over samples is a lower bound of the Hausdorff distance. It says nothing of what lies
//! between two samples; the guaranteed bound comes from the converter.

mod borders;
mod bvh;
mod indexed;
mod sampling;
mod triangle;

pub use borders::Borders;
pub use bvh::{Bvh, Closest};
pub use indexed::Indexed;
pub use triangle::{closest_point, normal};

use glam::DVec3;
use rayon::prelude::*;
use sampling::AreaSampler;
use std::ops::Range;

/// Vertices or samples worked on in one go; also fixes the order of summation.
const CHUNK: usize = 4096;
/// Bins of a degree in the histogram that percentiles are read from.
const BINS_PER_DEGREE: usize = 100;

/// A mesh that cannot be measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// Which triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A triangle uses a vertex with a coordinate that is infinite or no number.
    #[error("vertex {vertex} of triangle {triangle} is not finite")]
    NotFinite {
        /// Which triangle.
        triangle: usize,
        /// Its vertex.
        vertex: u32,
    },
    /// More triangles or vertices than 32-bit indices can name.
    #[error("{count} triangles or vertices are more than can be measured")]
    TooLarge {
        /// How many there are.
        count: usize,
    },
    /// Nothing to measure.
    #[error("the mesh has no triangles")]
    Empty,
}

/// A triangle mesh, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Mesh<'a> {
    /// Vertex positions.
    pub positions: &'a [DVec3],
    /// Vertex indices, three a triangle, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
}

impl Mesh<'_> {
    /// Corners of a triangle.
    ///
    /// # Panics
    /// If `triangle` or one of its indices is out of range.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// Diagonal of the bounding box of all vertices; 0 without vertices.
    pub fn diagonal(&self) -> f64 {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = self
            .positions
            .iter()
            .fold(start, |(min, max), &p| (min.min(p), max.max(p)));
        if self.positions.is_empty() {
            0.0
        } else {
            (max - min).length()
        }
    }
}

/// Distances from one mesh to another, as lengths.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OneWay {
    /// Largest, over all vertices and samples.
    pub max: f64,
    /// Root of the mean square over the area (samples only: vertices are not spread evenly).
    pub rms: f64,
    /// Where the RMS over all of the area lies with 95% confidence, as far as it follows from how much the samples'
    /// squares vary. Wide for few samples. Samples are stratified, so it is rather too wide than too narrow, but rare
    /// places that no sample hit are not in it.
    pub rms_interval: [f64; 2],
}

/// Angles between surface normals at nearest points, in degrees, 0..=180.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct NormalDeviation {
    /// Mean over the area, both ways.
    pub mean: f64,
    /// 95th percentile over the area, both ways; rounded up to a hundredth of a degree.
    pub p95: f64,
}

/// How far two meshes are apart. Lengths; divide by [`Mesh::diagonal`] of the reference for relative ones.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Distances {
    /// From the first mesh to the second.
    pub forward: OneWay,
    /// From the second mesh to the first.
    pub backward: OneWay,
    /// How far the triangles' normals disagree.
    pub normal_deviation_deg: NormalDeviation,
    /// Samples over the area, each way, beside the vertices.
    pub samples: u64,
}

impl Distances {
    /// Symmetric Hausdorff distance (sampled): the larger of the two maxima.
    pub fn hausdorff(&self) -> f64 {
        self.forward.max.max(self.backward.max)
    }

    /// Symmetric RMS distance: the larger of the two.
    pub fn rms(&self) -> f64 {
        self.forward.rms.max(self.backward.rms)
    }

    /// The [`OneWay::rms_interval`] of the way that [`Self::rms`] is of.
    pub fn rms_interval(&self) -> [f64; 2] {
        if self.forward.rms >= self.backward.rms {
            self.forward.rms_interval
        } else {
            self.backward.rms_interval
        }
    }
}

/// Measures how far `first` and `second` are apart, with `samples` (at least 1) samples each way.
///
/// Deterministic, for any number of threads.
///
/// # Errors
/// When a mesh has no triangles, an index out of range or a coordinate that is not finite.
pub fn measure(first: Mesh<'_>, second: Mesh<'_>, samples: u64) -> Result<Distances, MeshError> {
    let samples = samples.max(1);
    let [forward, backward] = both_ways(first, second, samples, one_way)?;
    Ok(of_both(&forward, &backward, samples))
}

/// The symmetric RMS distance that [`measure`] finds; quicker, as vertices are not looked at.
///
/// # Errors
/// As [`measure`].
pub fn rms(first: Mesh<'_>, second: Mesh<'_>, samples: u64) -> Result<f64, MeshError> {
    let ways = both_ways(first, second, samples.max(1), sampled)?;
    let [forward, backward] = ways.map(|sums| sums.distances().rms);
    Ok(forward.max(backward))
}

/// What `one_way` finds from each mesh to the other.
fn both_ways(
    first: Mesh<'_>,
    second: Mesh<'_>,
    samples: u64,
    one_way: impl Fn(Mesh<'_>, Mesh<'_>, &Bvh, u64) -> Sums,
) -> Result<[Sums; 2], MeshError> {
    if first.triangles.is_empty() || second.triangles.is_empty() {
        return Err(MeshError::Empty);
    }
    // One tree at a time: it is what takes the memory.
    let tree = Bvh::new(second.positions, second.triangles)?;
    check(first)?;
    let forward = one_way(first, second, &tree, samples);
    drop(tree);
    let tree = Bvh::new(first.positions, first.triangles)?;
    Ok([forward, one_way(second, first, &tree, samples)])
}

fn of_both(forward: &Sums, backward: &Sums, samples: u64) -> Distances {
    let mut angles = forward.angles.clone();
    angles.merge(&backward.angles);
    Distances {
        forward: forward.distances(),
        backward: backward.distances(),
        normal_deviation_deg: angles.deviation(),
        samples,
    }
}

/// Distances from points to a mesh; the RMS counts each point alike. Zero without points.
///
/// Quicker where points follow one another on a surface. Deterministic, for any number of threads.
///
/// # Errors
/// When the mesh has no triangles, an index out of range or a coordinate that is not finite.
pub fn from_points(points: &[DVec3], mesh: Mesh<'_>) -> Result<OneWay, MeshError> {
    Ok(Indexed::new(mesh)?.from_points(points))
}

/// About `count` points spread evenly over the area of a mesh, in the order of its triangles; none where it has no area.
///
/// # Errors
/// When the mesh has an index out of range or a coordinate that is not finite.
pub fn samples(mesh: Mesh<'_>, count: u64) -> Result<Vec<DVec3>, MeshError> {
    let mut points = Vec::new();
    for_each_sample(mesh, count, |_, point| points.push(point))?;
    Ok(points)
}

/// Calls `visit` with each of the [`samples`] and the triangle that it is on.
///
/// # Errors
/// As [`samples`].
pub fn for_each_sample(
    mesh: Mesh<'_>,
    count: u64,
    visit: impl FnMut(usize, DVec3),
) -> Result<(), MeshError> {
    check(mesh)?;
    let sampler = AreaSampler::new(mesh, count);
    sampler.for_each(0..sampler.len(), visit);
    Ok(())
}

/// Sums of one direction, or of one chunk of it.
#[derive(Debug, Clone, Default)]
struct Sums {
    max2: f64,
    sum2: f64,
    sum4: f64,
    count: u64,
    angles: Angles,
}

impl Sums {
    fn distances(&self) -> OneWay {
        let mean2 = if self.count == 0 {
            0.0
        } else {
            self.sum2 / self.count as f64
        };
        OneWay {
            max: self.max2.sqrt(),
            rms: mean2.sqrt(),
            rms_interval: self.interval(mean2),
        }
    }

    /// Of the RMS, by the normal distribution of the mean square.
    fn interval(&self, mean2: f64) -> [f64; 2] {
        if self.count < 2 {
            return [0.0, self.max2.sqrt()];
        }
        let count = self.count as f64;
        let variance = (self.sum4 / count - mean2 * mean2).max(0.0) * count / (count - 1.0);
        let reach = 1.96 * (variance / count).sqrt();
        [(mean2 - reach).max(0.0), mean2 + reach].map(f64::sqrt)
    }

    fn add(&mut self, distance2: f64) {
        self.max2 = self.max2.max(distance2);
        self.sum2 += distance2;
        self.sum4 += distance2 * distance2;
        self.count += 1;
    }

    fn merge(&mut self, other: &Self) {
        self.max2 = self.max2.max(other.max2);
        self.sum2 += other.sum2;
        self.sum4 += other.sum4;
        self.count += other.count;
        self.angles.merge(&other.angles);
    }
}

/// A mean and a histogram of angles; `bins` may be shorter than 180 degrees.
#[derive(Debug, Clone, Default)]
struct Angles {
    sum: f64,
    count: u64,
    bins: Vec<u64>,
}

impl Angles {
    fn add(&mut self, degrees: f64) {
        self.sum += degrees;
        self.count += 1;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..=180"
        )]
        let bin = (degrees * BINS_PER_DEGREE as f64) as usize;
        if self.bins.len() <= bin {
            self.bins.resize(bin + 1, 0);
        }
        self.bins[bin] += 1;
    }

    fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.count += other.count;
        if self.bins.len() < other.bins.len() {
            self.bins.resize(other.bins.len(), 0);
        }
        for (bin, add) in self.bins.iter_mut().zip(&other.bins) {
            *bin += add;
        }
    }

    fn deviation(&self) -> NormalDeviation {
        if self.count == 0 {
            return NormalDeviation {
                mean: 0.0,
                p95: 0.0,
            };
        }
        let rank = (self.count * 95).div_ceil(100);
        let mut below = 0;
        let bin = self.bins.iter().position(|&count| {
            below += count;
            below >= rank
        });
        let p95 = bin.map_or(180.0, |bin| (bin + 1) as f64 / BINS_PER_DEGREE as f64);
        NormalDeviation {
            mean: self.sum / self.count as f64,
            p95: p95.min(180.0),
        }
    }
}

/// Refuses indices out of range and coordinates that are not finite.
fn check(mesh: Mesh<'_>) -> Result<(), MeshError> {
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        for &vertex in corners {
            match mesh.positions.get(vertex as usize) {
                Some(position) if position.is_finite() => {}
                Some(_) => return Err(MeshError::NotFinite { triangle, vertex }),
                None => {
                    return Err(MeshError::IndexOutOfRange {
                        triangle,
                        vertex,
                        vertices: mesh.positions.len(),
                    });
                }
            }
        }
    }
    Ok(())
}

fn one_way(from: Mesh<'_>, to: Mesh<'_>, tree: &Bvh, samples: u64) -> Sums {
    let mut total = sampled(from, to, tree, samples);
    total.max2 = farthest_vertex(from, tree, total.max2);
    total
}

/// From samples over the area, without the vertices.
fn sampled(from: Mesh<'_>, to: Mesh<'_>, tree: &Bvh, samples: u64) -> Sums {
    let sampler = AreaSampler::new(from, samples);
    let parts: Vec<Sums> = chunks(sampler.len())
        .into_par_iter()
        .map(|range| {
            let mut hint = 0;
            let mut sums = Sums::default();
            sampler.for_each(range, |triangle, point| {
                let Some(closest) = tree.closest_from(point, &mut hint) else {
                    return;
                };
                sums.add(closest.distance2);
                let here = normal(from.corners(triangle));
                let there = normal(to.corners(closest.triangle as usize));
                if let (Some(here), Some(there)) = (here, there) {
                    sums.angles.add(angle_degrees(here, there));
                }
            });
            sums
        })
        .collect();
    let mut total = Sums::default();
    for part in &parts {
        total.merge(part);
    }
    total
}

/// The largest squared distance of a vertex, or `max2` if none is farther. All but the few vertices that set a new record
/// are done with the first triangle found within it.
fn farthest_vertex(from: Mesh<'_>, tree: &Bvh, max2: f64) -> f64 {
    let used = used_vertices(from);
    chunks(used.len())
        .into_par_iter()
        .map(|range| {
            let mut max2 = max2;
            let mut hint = 0;
            for v in range.filter(|&v| used[v]) {
                let point = from.positions[v];
                if !tree.is_within(point, max2, &mut hint)
                    && let Some(closest) = tree.closest(point, f64::INFINITY)
                {
                    max2 = max2.max(closest.distance2);
                }
            }
            max2
        })
        .reduce(|| max2, f64::max)
}

/// Which vertices belong to a triangle: a stray vertex is no part of the surface.
fn used_vertices(mesh: Mesh<'_>) -> Vec<bool> {
    let mut used = vec![false; mesh.positions.len()];
    for &vertex in mesh.triangles.iter().flatten() {
        used[vertex as usize] = true;
    }
    used
}

fn chunks(len: usize) -> Vec<Range<usize>> {
    (0..len)
        .step_by(CHUNK)
        .map(|start| start..(start + CHUNK).min(len))
        .collect()
}

/// Angle between unit vectors by the arc tangent, which is exact near 0 where the arc cosine is not.
fn angle_degrees(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

#[cfg(test)]
mod tests;
