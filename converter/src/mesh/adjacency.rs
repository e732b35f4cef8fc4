//! Which half-edges lie on the same edge, and how to walk among them.

use super::NONE;
use rayon::prelude::*;

/// The half-edge after `h` in its triangle.
#[inline]
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline]
pub fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// The vertex where `h` starts.
#[inline]
pub fn start(triangles: &[[u32; 3]], h: u32) -> u32 {
    triangles[h as usize / 3][h as usize % 3]
}

/// The vertex where `h` ends.
#[inline]
pub fn end(triangles: &[[u32; 3]], h: u32) -> u32 {
    start(triangles, next(h))
}

/// The corner of the triangle that `h` does not touch.
#[inline]
pub fn apex(triangles: &[[u32; 3]], h: u32) -> u32 {
    start(triangles, previous(h))
}

/// `len` as the id that the next element gets. [`NONE`] cannot occur: imports are limited to a third of it.
pub(crate) fn id(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(NONE)
}

/// All half-edges, grouped by undirected edge. Edges are ordered by lower, then higher vertex; half-edges by id.
#[derive(Debug, Clone)]
pub struct EdgeTable {
    half_edges: Vec<u32>,
    starts: Vec<u32>,
}

impl EdgeTable {
    /// Builds the table in O(triangles) (plus sorting within each vertex); every index must be below `vertices`.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn new(triangles: &[[u32; 3]], vertices: usize) -> Self {
        // A counting sort by the lower vertex, then small sorts by the higher one.
        let mut offsets = vec![0_u32; vertices + 1];
        for t in triangles {
            for k in 0..3 {
                offsets[t[k].min(t[(k + 1) % 3]) as usize + 1] += 1;
            }
        }
        for i in 0..vertices {
            offsets[i + 1] += offsets[i];
        }
        let mut at = offsets.clone();
        let mut entries = vec![0_u64; 3 * triangles.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let slot = &mut at[a.min(b) as usize];
                entries[*slot as usize] = u64::from(a.max(b)) << 32 | u64::from(id(3 * t + k));
                *slot += 1;
            }
        }
        drop(at);
        split_at_offsets(&mut entries, &offsets)
            .into_par_iter()
            .for_each(|(entries, offsets)| {
                let base = offsets[0];
                for w in offsets.windows(2) {
                    entries[(w[0] - base) as usize..(w[1] - base) as usize].sort_unstable();
                }
            });
        let mut starts = Vec::with_capacity(entries.len() / 2 + vertices + 1);
        let mut half_edges = Vec::with_capacity(entries.len());
        for w in offsets.windows(2) {
            let mut last = None;
            for &entry in &entries[w[0] as usize..w[1] as usize] {
                if last != Some(entry >> 32) {
                    last = Some(entry >> 32);
                    starts.push(id(half_edges.len()));
                }
                #[expect(clippy::cast_possible_truncation, reason = "the low half of the entry")]
                half_edges.push(entry as u32);
            }
        }
        starts.push(id(half_edges.len()));
        Self { half_edges, starts }
    }

    /// Number of edges.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no edge.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The half-edges of each edge.
    pub fn edges(&self) -> impl Iterator<Item = &[u32]> {
        self.starts
            .windows(2)
            .map(|w| &self.half_edges[w[0] as usize..w[1] as usize])
    }

    /// Ends of the edges that have not exactly two triangles.
    pub fn open<'a>(&'a self, triangles: &'a [[u32; 3]]) -> impl Iterator<Item = [u32; 2]> + 'a {
        self.edges()
            .filter(|of| of.len() != 2)
            .filter_map(<[u32]>::first)
            .map(|&h| [start(triangles, h), end(triangles, h)])
    }
}

/// Cuts `entries` into some pieces at bucket ends, each with its part of `offsets`.
fn split_at_offsets<'a>(
    entries: &'a mut [u64],
    offsets: &'a [u32],
) -> Vec<(&'a mut [u64], &'a [u32])> {
    const BUCKETS: usize = 1 << 14;
    let mut rest = entries;
    let mut pieces = Vec::new();
    let mut from = 0;
    while from + 1 < offsets.len() {
        let to = (from + BUCKETS).min(offsets.len() - 1);
        let (piece, tail) = rest.split_at_mut((offsets[to] - offsets[from]) as usize);
        pieces.push((piece, &offsets[from..=to]));
        rest = tail;
        from = to;
    }
    pieces
}

/// Disjoint sets; the smallest member stands for its set, so the result does not depend on the order of unions.
#[derive(Debug, Clone)]
pub struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// `n` sets of one member each.
    pub fn new(n: usize) -> Self {
        Self {
            parent: (0..id(n)).collect(),
        }
    }

    /// The smallest member of the set that `i` is in.
    pub fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let up = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = up;
            i = up;
        }
        i
    }

    /// Joins two sets.
    pub fn union(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

/// Numbers the sets among `members` in order of first occurrence: a label for each, and how many there are.
pub(crate) fn label(sets: &mut UnionFind, members: impl Iterator<Item = u32>) -> (Vec<u32>, u32) {
    let mut number = vec![NONE; sets.parent.len()];
    let mut count = 0;
    let labels = members
        .map(|m| {
            let slot = &mut number[sets.find(m) as usize];
            if *slot == NONE {
                *slot = count;
                count += 1;
            }
            *slot
        })
        .collect();
    (labels, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_groups_every_half_edge_once() {
        let triangles = [[0, 1, 2], [2, 1, 3], [1, 0, 4], [0, 1, 5]];
        let table = EdgeTable::new(&triangles, 6);
        let groups: Vec<&[u32]> = table.edges().collect();
        assert_eq!(groups[0], [0, 6, 9]);
        assert_eq!(groups.iter().map(|g| g.len()).sum::<usize>(), 12);
        assert_eq!(table.len(), 9);
        for group in groups {
            for &h in group {
                let key = |h| {
                    let (a, b) = (start(&triangles, h), end(&triangles, h));
                    (a.min(b), a.max(b))
                };
                assert_eq!(key(h), key(group[0]));
            }
        }
    }

    #[test]
    fn smallest_member_stands_for_its_set() {
        let mut sets = UnionFind::new(6);
        sets.union(5, 3);
        sets.union(3, 4);
        assert_eq!((sets.find(5), sets.find(4), sets.find(0)), (3, 3, 0));
        assert_eq!(label(&mut sets, 0..6), (vec![0, 1, 2, 3, 3, 3], 4));
    }
}
