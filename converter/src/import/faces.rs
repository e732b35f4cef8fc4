//! The faces that a parser found, in file order, until all vertices are known.

use super::polygon;
use crate::error::{Fault, MAX_TRIANGLES, ParseError, Place};
use glam::DVec3;

/// Faces with any number of corners. Triangles, nearly always all of them, take no more than their three indices.
#[derive(Debug, Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Corners of all faces with more than three.
    corners: Vec<u32>,
    /// For each of these: number of triangles before it, and end of its range in `corners`.
    polygons: Vec<(usize, usize)>,
    /// Faces with fewer than three corners.
    short: u64,
    /// Greatest index so far, and where it stood.
    greatest: Option<(u32, Place)>,
}

impl Faces {
    /// Makes room for `triangles`; the caller has bounded the number by the file's size.
    pub(super) fn reserve(&mut self, triangles: usize) {
        self.triangles.reserve(triangles);
    }

    pub(super) fn push_triangle(&mut self, triangle: [u32; 3], place: Place) {
        self.note(&triangle, place);
        self.triangles.push(triangle);
    }

    /// Adds triangles whose indices are known to be in range.
    pub(super) fn extend_checked(&mut self, triangles: Vec<[u32; 3]>) {
        if self.triangles.is_empty() {
            self.triangles = triangles;
        } else {
            self.triangles.extend(triangles);
        }
    }

    /// The same faces, of vertices that are numbered from `first` on. The caller sees to it that ids do not overflow.
    pub(super) fn shifted(mut self, first: u32) -> Self {
        for corner in self.triangles.as_flattened_mut() {
            *corner += first;
        }
        for corner in &mut self.corners {
            *corner += first;
        }
        if let Some((greatest, _)) = &mut self.greatest {
            *greatest += first;
        }
        self
    }

    /// Adds faces that were read apart from these, after them.
    pub(super) fn append(&mut self, other: Self) {
        let (triangles, corners) = (self.triangles.len(), self.corners.len());
        self.polygons.extend(
            other
                .polygons
                .iter()
                .map(|&(before, end)| (triangles + before, corners + end)),
        );
        self.triangles.extend(other.triangles);
        self.corners.extend(other.corners);
        self.short += other.short;
        if let Some((i, place)) = other.greatest
            && self.greatest.is_none_or(|(g, _)| i > g)
        {
            self.greatest = Some((i, place));
        }
    }

    /// Adds a face of any number of corners.
    pub(super) fn push(&mut self, face: &[u32], place: Place) {
        if let Ok(triangle) = <[u32; 3]>::try_from(face) {
            return self.push_triangle(triangle, place);
        }
        self.note(face, place);
        if face.len() < 3 {
            self.short += 1;
            return;
        }
        self.corners.extend_from_slice(face);
        self.polygons
            .push((self.triangles.len(), self.corners.len()));
    }

    /// Adds a strip: triangle i is (i, i+1, i+2), every second one turned round. Triangles with a repeated index
    /// only steer the strip and are no faces.
    pub(super) fn push_strip(&mut self, strip: &[u32], place: Place) {
        for (i, w) in strip.windows(3).enumerate() {
            if w[0] != w[1] && w[1] != w[2] && w[2] != w[0] {
                let triangle = if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[1], w[0], w[2]]
                };
                self.push_triangle(triangle, place);
            }
        }
    }

    fn note(&mut self, indices: &[u32], place: Place) {
        for &i in indices {
            if self.greatest.is_none_or(|(g, _)| i > g) {
                self.greatest = Some((i, place));
            }
        }
    }

    /// Faces added so far.
    pub(super) fn len(&self) -> u64 {
        self.triangles.len() as u64 + self.polygons.len() as u64 + self.short
    }

    /// The triangles among the faces, in order.
    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Whether all indices are below `vertices`, and the faces of three and more corners have `corners` in all.
    pub(super) fn fits(&self, vertices: usize, corners: usize) -> bool {
        self.greatest.is_none_or(|(g, _)| (g as usize) < vertices)
            && 3 * self.triangles.len() + self.corners.len() == corners
    }

    /// Faces of three and more corners.
    pub(super) fn filed(&self) -> usize {
        self.triangles.len() + self.polygons.len()
    }

    /// For every triangle that [`Self::triangulate`] makes, what `values` has for its face: one entry a face of three and more
    /// corners, in order. None where there are more or fewer, or an index is out of range.
    pub(super) fn spread<T: Copy>(&self, positions: &[DVec3], values: &[T]) -> Option<Vec<T>> {
        let is_known = self
            .greatest
            .is_none_or(|(g, _)| (g as usize) < positions.len());
        if !is_known || values.len() != self.filed() {
            return None;
        }
        let mut out = Vec::with_capacity(values.len());
        let (mut at, mut done, mut start) = (0, 0, 0);
        let mut triangles = Vec::new();
        for &(before, end) in &self.polygons {
            let polygon = at + before - done;
            out.extend_from_slice(&values[at..polygon]);
            triangles.clear();
            polygon::triangulate(&self.corners[start..end], positions, &mut triangles);
            out.extend(triangles.iter().map(|_| values[polygon]));
            (at, done, start) = (polygon + 1, before, end);
        }
        out.extend_from_slice(&values[at..]);
        Some(out)
    }

    /// For every triangle that [`Self::triangulate`] makes, its corners' places in `values`, which has one entry a corner
    /// of the faces added, in order; faces with fewer than three corners have none there.
    pub(super) fn carry<T: Copy>(&self, positions: &[DVec3], values: &[T], out: &mut Vec<[T; 3]>) {
        let (mut at, mut done, mut start) = (0, 0, 0);
        let mut triangles = Vec::new();
        let plain = |count: usize, at: &mut usize, out: &mut Vec<[T; 3]>| {
            for corners in values[*at..*at + 3 * count].chunks_exact(3) {
                out.push([corners[0], corners[1], corners[2]]);
            }
            *at += 3 * count;
        };
        for &(before, end) in &self.polygons {
            plain(before - done, &mut at, out);
            let corners = &self.corners[start..end];
            triangles.clear();
            polygon::triangulate(corners, positions, &mut triangles);
            let own = &values[at..at + corners.len()];
            let value = |vertex: u32| {
                let place = corners
                    .iter()
                    .position(|&v| v == vertex)
                    .unwrap_or_default();
                own[place]
            };
            out.extend(triangles.iter().map(|t| t.map(value)));
            at += corners.len();
            (done, start) = (before, end);
        }
        plain(self.triangles.len() - done, &mut at, out);
    }

    /// All faces as triangles, in order, and how many faces had fewer than three distinct corners.
    pub(super) fn triangulate(
        self,
        positions: &[DVec3],
    ) -> Result<(Vec<[u32; 3]>, u64), ParseError> {
        if let Some((index, place)) = self.greatest
            && index as usize >= positions.len()
        {
            let fault = Fault::IndexOutOfRange {
                index: i64::from(index),
                vertices: positions.len() as u64,
            };
            return Err(ParseError::at(place, fault));
        }
        let mut without_area = self.short;
        let mut out = Vec::new();
        if self.polygons.is_empty() {
            out = self.triangles;
        } else {
            out.reserve(self.triangles.len() + self.corners.len() - 2 * self.polygons.len());
            let (mut done, mut start) = (0, 0);
            for (before, end) in self.polygons {
                out.extend_from_slice(&self.triangles[done..before]);
                without_area += u64::from(!polygon::triangulate(
                    &self.corners[start..end],
                    positions,
                    &mut out,
                ));
                (done, start) = (before, end);
            }
            out.extend_from_slice(&self.triangles[done..]);
        }
        if out.len() > MAX_TRIANGLES {
            let fault = Fault::TooMany {
                what: "triangles",
                count: out.len() as u64,
                limit: MAX_TRIANGLES as u64,
            };
            return Err(ParseError::at(Place::File, fault));
        }
        Ok((out, without_area))
    }
}
