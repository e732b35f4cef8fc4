//! A closed triangulated surface as neighbour lists, under edge contraction.
//!
//! An edge may be contracted iff that leaves the surface what it is: its ends have exactly two common
//! neighbours and the surface is more than a tetrahedron (Dey, Edelsbrunner, Guha & Nekhayev, "Topology preserving
//! edge contraction", 1999). In a simplicial surface the neighbours say it all, so no triangle is kept.
//! Limit: the caller counts vertices and spares the tetrahedron; a pillow (two triangles with the same corners) is no
//! simplicial surface.

/// Where a vertex's neighbours lie in the pool.
#[derive(Debug, Clone, Copy, Default)]
struct Span {
    start: u32,
    len: u32,
    capacity: u32,
}

/// Neighbour lists in one pool: 12 bytes a vertex and 4 a neighbour.
#[derive(Debug, Clone, Default)]
pub(super) struct Complex {
    spans: Vec<Span>,
    pool: Vec<u32>,
    gained: Vec<u32>,
}

/// An index as an id. Every count here is below the number of half-edges, which are `u32` by [`crate::mesh::ManifoldMesh`].
#[expect(
    clippy::cast_possible_truncation,
    reason = "counts are bounded by the u32 half-edge ids"
)]
pub(super) fn id(index: usize) -> u32 {
    index as u32
}

impl Complex {
    /// Appends the next vertex with its neighbours, all distinct.
    pub(super) fn push(&mut self, neighbours: impl IntoIterator<Item = u32>) {
        let start = id(self.pool.len());
        self.pool.extend(neighbours);
        let len = id(self.pool.len()) - start;
        self.spans.push(Span {
            start,
            len,
            capacity: len,
        });
    }

    /// Neighbours of `v`, in no order.
    pub(super) fn neighbours(&self, v: u32) -> &[u32] {
        let span = self.spans[v as usize];
        &self.pool[span.start as usize..][..span.len as usize]
    }

    /// Number of neighbours of `v`.
    pub(super) fn degree(&self, v: u32) -> u32 {
        self.spans[v as usize].len
    }

    /// Whether `u` and `v` are neighbours.
    pub(super) fn adjacent(&self, u: u32, v: u32) -> bool {
        self.neighbours(u).contains(&v)
    }

    /// The common neighbours of `u` and `v` where there are exactly two.
    pub(super) fn link(&self, u: u32, v: u32) -> Option<[u32; 2]> {
        let (mut few, mut many) = (self.neighbours(u), self.neighbours(v));
        if few.len() > many.len() {
            (few, many) = (many, few);
        }
        let mut common = few.iter().copied().filter(|w| many.contains(w));
        match (common.next(), common.next(), common.next()) {
            (Some(a), Some(b), None) => Some([a, b]),
            _ => None,
        }
    }

    /// Contracts edge `keep`–`gone` into `keep`; `common` are their two common neighbours.
    pub(super) fn contract(&mut self, keep: u32, gone: u32, common: [u32; 2]) {
        let mut gained = std::mem::take(&mut self.gained);
        gained.clear();
        gained.extend(
            self.neighbours(gone)
                .iter()
                .filter(|&&w| w != keep && !common.contains(&w)),
        );
        for &w in &gained {
            if let Some(slot) = self.slots(w).iter_mut().find(|slot| **slot == gone) {
                *slot = keep;
            }
        }
        for w in [common[0], common[1], keep] {
            self.remove(w, gone);
        }
        self.append(keep, gone, &gained);
        self.gained = gained;
    }

    /// Replaces edge `old` by `new` unless that is an edge already; whether it did.
    pub(super) fn flip(&mut self, old: [u32; 2], new: [u32; 2]) -> bool {
        if self.adjacent(new[0], new[1]) {
            return false;
        }
        self.remove(old[0], old[1]);
        self.remove(old[1], old[0]);
        self.insert(new[0], new[1]);
        self.insert(new[1], new[0]);
        true
    }

    fn insert(&mut self, v: u32, w: u32) {
        let mut span = self.spans[v as usize];
        if span.len == span.capacity {
            let from = span.start as usize..(span.start + span.len) as usize;
            span.start = id(self.pool.len());
            span.capacity = span.len + 4;
            self.pool.extend_from_within(from);
            self.pool.resize((span.start + span.capacity) as usize, 0);
        }
        self.pool[(span.start + span.len) as usize] = w;
        span.len += 1;
        self.spans[v as usize] = span;
    }

    fn slots(&mut self, v: u32) -> &mut [u32] {
        let span = self.spans[v as usize];
        &mut self.pool[span.start as usize..][..span.len as usize]
    }

    fn remove(&mut self, v: u32, gone: u32) {
        let slots = self.slots(v);
        if let Some(at) = slots.iter().position(|&w| w == gone) {
            let last = slots.len() - 1;
            slots.swap(at, last);
            self.spans[v as usize].len -= 1;
        }
    }

    /// Appends to `keep`'s list, in `gone`'s space where that is the larger.
    fn append(&mut self, keep: u32, gone: u32, gained: &[u32]) {
        let (mut span, spare) = (self.spans[keep as usize], self.spans[gone as usize]);
        let needed = span.len + id(gained.len());
        if needed > span.capacity {
            let from = span.start as usize..(span.start + span.len) as usize;
            if needed <= spare.capacity {
                self.pool.copy_within(from, spare.start as usize);
                (span.start, span.capacity) = (spare.start, spare.capacity);
            } else {
                span.start = id(self.pool.len());
                span.capacity = needed + needed / 4;
                self.pool.extend_from_within(from);
                self.pool.resize((span.start + span.capacity) as usize, 0);
            }
        }
        self.pool[(span.start + span.len) as usize..][..gained.len()].copy_from_slice(gained);
        span.len = needed;
        self.spans[keep as usize] = span;
        self.spans[gone as usize].len = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::Complex;

    fn octahedron() -> Complex {
        let mut complex = Complex::default();
        for v in 0..6_u32 {
            complex.push((0..6).filter(|&w| w != v && w != (v + 3) % 6));
        }
        complex
    }

    #[test]
    fn contraction_joins_the_neighbours() {
        let mut complex = octahedron();
        let common = complex.link(0, 1).unwrap();
        complex.contract(0, 1, common);
        let mut neighbours = complex.neighbours(0).to_vec();
        neighbours.sort_unstable();
        assert_eq!(neighbours, [2, 3, 4, 5]);
        assert_eq!([2, 3, 4, 5].map(|v| complex.degree(v)), [3, 4, 4, 3]);
        assert!(!complex.adjacent(3, 1) && complex.adjacent(4, 0));
    }

    #[test]
    fn edge_in_a_third_triangle_of_neighbours_is_refused() {
        let mut complex = octahedron();
        let common = complex.link(0, 1).unwrap();
        complex.contract(0, 1, common);
        // 0 is now joined to 3 and 4 at opposite ends of the ring 2-3-5-4 of its neighbours.
        assert!(complex.link(3, 4).is_none());
    }
}
