//! Distances between the open borders of two meshes.
//!
//! A border is what no distance between surfaces sees: a hole that grew, or was closed, leaves every sample of the one surface
//! near to the other. Edges that one triangle alone has are its segments, and samples go along them as those of a surface over its area.
//!
//! Pitfall: a border that the other mesh does not have anywhere near (a hole that was closed) is measured to the nearest that it
//! has, wherever that is; compare the lengths first.
//! Limit: vertices are one where their coordinates are equal to the last bit. A mesh whose triangles do not share vertices
//! exactly has borders along its cracks.

use super::sampling::{Strata, unit};
use super::{Bvh, CHUNK, Mesh, MeshError, OneWay, Sums, check, chunks};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Open borders of a mesh.
#[derive(Debug)]
pub struct Borders {
    positions: Vec<DVec3>,
    /// Ends of each segment, the last of them twice: a triangle without area, which a [`Bvh`] can hold.
    segments: Vec<[u32; 3]>,
    length: f64,
}

impl Borders {
    /// Of a mesh; triangles whose corners are not three places do not count.
    ///
    /// # Errors
    /// When the mesh has an index out of range or a coordinate that is not finite.
    pub fn of(mesh: Mesh<'_>) -> Result<Self, MeshError> {
        check(mesh)?;
        let place_of = places(mesh.positions);
        let mut edges: Vec<[u32; 2]> = (mesh.triangles.par_iter())
            .map(|triangle| triangle.map(|vertex| place_of[vertex as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .flat_map_iter(|[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.par_sort_unstable();
        let alone = edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        let mut borders = Self {
            positions: Vec::new(),
            segments: Vec::new(),
            length: 0.0,
        };
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        for &[ends] in alone.filter_map(|same| same.first_chunk::<1>()) {
            let [a, b] = ends.map(|place| {
                *numbers.entry(place).or_insert_with(|| {
                    borders.positions.push(mesh.positions[place as usize]);
                    u32::try_from(borders.positions.len() - 1).unwrap_or(u32::MAX)
                })
            });
            borders.segments.push([a, b, b]);
            let [from, to] = ends.map(|place| mesh.positions[place as usize]);
            borders.length += from.distance(to);
        }
        Ok(borders)
    }

    /// Whether there are none: the mesh is closed.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// All of them together.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Distances from these to others, and from the others to these, with `samples` (at least 1) samples each way beside all
    /// vertices; `None` where either has none. Deterministic, for any number of threads.
    ///
    /// # Errors
    /// When there are more segments than a tree can hold.
    pub fn measure(&self, other: &Self, samples: u64) -> Result<Option<[OneWay; 2]>, MeshError> {
        if self.is_empty() || other.is_empty() {
            return Ok(None);
        }
        Ok(Some([
            self.to(other, samples.max(1))?,
            other.to(self, samples.max(1))?,
        ]))
    }

    fn to(&self, other: &Self, samples: u64) -> Result<OneWay, MeshError> {
        let tree = Bvh::new(&other.positions, &other.segments)?;
        let ends = |segment: usize| {
            let [a, b, _] = self.segments[segment];
            [a, b].map(|v| self.positions[v as usize])
        };
        let lengths = (0..self.segments.len()).map(|segment| {
            let [a, b] = ends(segment);
            a.distance(b)
        });
        let strata = Strata::new(lengths, samples);
        let parts: Vec<Sums> = chunks(strata.len())
            .into_par_iter()
            .map(|range| {
                let (mut hint, mut sums) = (0, Sums::default());
                strata.for_each(range, |segment, counter| {
                    let [a, b] = ends(segment);
                    if let Some(closest) = tree.closest_from(a.lerp(b, unit(counter)), &mut hint) {
                        sums.add(closest.distance2);
                    }
                });
                sums
            })
            .collect();
        let mut total = Sums::default();
        for part in &parts {
            total.merge(part);
        }
        let farthest = (self.positions.par_chunks(CHUNK))
            .flat_map_iter(|places| {
                let mut hint = 0;
                let of = |&place: &DVec3| tree.closest_from(place, &mut hint);
                let found: Vec<_> = places.iter().filter_map(of).collect();
                found.into_iter().map(|closest| closest.distance2)
            })
            .reduce(|| 0.0, f64::max);
        total.max2 = total.max2.max(farthest);
        Ok(total.distances())
    }
}

/// By vertex, the first that is at its place.
fn places(positions: &[DVec3]) -> Vec<u32> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(positions.len());
    let number = |vertex: usize| u32::try_from(vertex).unwrap_or(u32::MAX);
    (positions.iter().enumerate())
        .map(|(vertex, place)| {
            // Both zeros are one place.
            let key = place.to_array().map(|x| (x + 0.0).to_bits());
            *first.entry(key).or_insert_with(|| number(vertex))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::closest_point;
    use std::f64::consts::PI;

    /// A disc of `n` slices around the z axis, `height` above 0, each triangle with vertices of its own.
    fn disc(n: u32, radius: f64, height: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let at = |k: u32| {
            let angle = 2.0 * PI * f64::from(k % n) / f64::from(n);
            DVec3::new(radius * angle.cos(), radius * angle.sin(), height)
        };
        let positions = (0..n).flat_map(|k| [DVec3::Z * height, at(k), at(k + 1)]);
        let triangles = (0..n).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
        (positions.collect(), triangles.collect())
    }

    fn borders((positions, triangles): &(Vec<DVec3>, Vec<[u32; 3]>)) -> Borders {
        let mesh = Mesh {
            positions,
            triangles,
        };
        Borders::of(mesh).unwrap()
    }

    #[test]
    fn rims_of_discs_are_as_far_apart_as_their_radii() {
        let (small, large) = (disc(4000, 1.0, 0.0), disc(4000, 1.25, 0.0));
        let [small, large] = [&small, &large].map(borders);
        assert!((small.length() - 2.0 * PI).abs() < 1e-5);
        for way in small.measure(&large, 10_000).unwrap().unwrap() {
            assert!((way.rms - 0.25).abs() < 1e-5 && (way.max - 0.25).abs() < 1e-5);
        }
    }

    #[test]
    fn a_shift_out_of_the_plane_is_the_distance() {
        let [low, high] = [&disc(40, 1.0, 0.0), &disc(40, 1.0, 0.125)].map(borders);
        for way in low.measure(&high, 1000).unwrap().unwrap() {
            assert!((way.rms - 0.125).abs() < 1e-12 && (way.max - 0.125).abs() < 1e-12);
        }
    }

    #[test]
    fn measured_as_segment_by_segment() {
        let [few, many] = [&disc(7, 1.0, 0.1), &disc(50, 1.1, 0.0)].map(borders);
        let [forward, _] = few.measure(&many, 200_000).unwrap().unwrap();
        let nearest = |point: DVec3| {
            let corners = |segment: &[u32; 3]| segment.map(|v| many.positions[v as usize]);
            let distances = (many.segments.iter())
                .map(|segment| closest_point(corners(segment), point).distance(point));
            distances.fold(f64::INFINITY, f64::min)
        };
        let (mut sum, mut max) = (0.0, 0.0_f64);
        let steps = 2000;
        for segment in &few.segments {
            let [a, b] = [0, 1].map(|k: usize| few.positions[segment[k] as usize]);
            for step in 0..steps {
                let distance = nearest(a.lerp(b, (f64::from(step) + 0.5) / f64::from(steps)));
                sum += distance * distance;
                max = max.max(distance).max(nearest(a));
            }
        }
        let rms = (sum / (f64::from(steps) * few.segments.len() as f64)).sqrt();
        assert!(
            (forward.rms / rms - 1.0).abs() < 1e-3,
            "{} {rms}",
            forward.rms
        );
        assert!(
            (forward.max / max - 1.0).abs() < 1e-3,
            "{} {max}",
            forward.max
        );
    }

    #[test]
    fn closed_meshes_have_none_and_stray_triangles_do_not_count() {
        // A tetrahedron, and a triangle that is an edge.
        let positions = vec![
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            DVec3::new(-0.0, 0.0, 0.0),
        ];
        let triangles = vec![[0, 2, 1], [4, 1, 3], [1, 2, 3], [2, 0, 3], [0, 4, 1]];
        let closed = borders(&(positions, triangles));
        assert!(closed.is_empty() && closed.length() == 0.0);
        let open = borders(&disc(5, 1.0, 0.0));
        assert_eq!(closed.measure(&open, 10).unwrap(), None);
        assert_eq!(open.measure(&closed, 10).unwrap(), None);
    }

    #[test]
    fn meshes_that_are_none_are_refused() {
        let mesh = Mesh {
            positions: &[DVec3::ZERO],
            triangles: &[[0, 1, 2]],
        };
        assert!(matches!(
            Borders::of(mesh),
            Err(MeshError::IndexOutOfRange { vertex: 1, .. })
        ));
    }
}
