//! The undirected edges of a triangle list.

/// "No triangle" and "no edge".
pub(crate) const NONE: u32 = u32::MAX;

/// Edges, numbered in the order of their ends.
#[derive(Debug, Clone, Default)]
pub(crate) struct Edges {
    /// Ends of every edge, the lower index first.
    pub(crate) ends: Vec<[u32; 2]>,
    /// How many triangles use the edge: 1 on the boundary, 2 inside.
    pub(crate) uses: Vec<u32>,
    /// Edge `k` of a triangle joins its vertices `k` and `k + 1`.
    pub(crate) of_triangle: Vec<[u32; 3]>,
}

impl Edges {
    /// Edges of `triangles`; fewer than 2^32 / 3 triangles.
    pub(crate) fn of(triangles: &[[u32; 3]]) -> Self {
        // A counting sort by the lower end, then small sorts by the higher one.
        let vertices = triangles.as_flattened().iter().max();
        let mut starts = vec![0u32; vertices.map_or(0, |&v| v as usize + 1) + 1];
        let ends = |corners: &[u32; 3], k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            (a.min(b), a.max(b))
        };
        for corners in triangles {
            for k in 0..3 {
                starts[ends(corners, k).0 as usize + 1] += 1;
            }
        }
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        let mut half_edges = vec![(0u32, 0u32); triangles.len() * 3];
        let mut next = starts.clone();
        for (triangle, corners) in (0u32..).zip(triangles) {
            for (k, half_edge) in (0..3).zip(triangle * 3..) {
                let (a, b) = ends(corners, k);
                half_edges[next[a as usize] as usize] = (b, half_edge);
                next[a as usize] += 1;
            }
        }
        let mut edges = Self {
            ends: Vec::with_capacity(half_edges.len() / 2 + 2),
            uses: Vec::with_capacity(half_edges.len() / 2 + 2),
            of_triangle: vec![[NONE; 3]; triangles.len()],
        };
        let mut id = NONE;
        for (a, range) in (0u32..).zip(starts.windows(2)) {
            let around = &mut half_edges[range[0] as usize..range[1] as usize];
            around.sort_unstable();
            let mut last = NONE;
            for &(b, half_edge) in &*around {
                if b != last {
                    last = b;
                    id = id.wrapping_add(1);
                    edges.ends.push([a, b]);
                    edges.uses.push(0);
                }
                if let Some(uses) = edges.uses.last_mut() {
                    *uses += 1;
                }
                edges.of_triangle[half_edge as usize / 3][half_edge as usize % 3] = id;
            }
        }
        edges
    }

    /// The triangle across every edge of every triangle, [`NONE`] on the boundary and where more than two meet.
    pub(crate) fn neighbours(&self) -> Vec<[u32; 3]> {
        let mut pair = vec![[NONE; 2]; self.ends.len()];
        for (triangle, ids) in (0u32..).zip(&self.of_triangle) {
            for &edge in ids {
                let slot = &mut pair[edge as usize];
                slot[usize::from(slot[0] != NONE)] = triangle;
            }
        }
        let across = |triangle: u32, edge: u32| match pair[edge as usize] {
            _ if self.uses[edge as usize] != 2 => NONE,
            [a, b] if a == triangle => b,
            [a, _] => a,
        };
        (0u32..)
            .zip(&self.of_triangle)
            .map(|(triangle, ids)| ids.map(|edge| across(triangle, edge)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_share_one_edge() {
        let edges = Edges::of(&[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(edges.ends, [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]);
        assert_eq!(edges.uses, [1, 2, 1, 1, 1]);
        assert_eq!(edges.of_triangle, [[0, 3, 1], [1, 4, 2]]);
        assert_eq!(edges.neighbours(), [[NONE, NONE, 1], [0, NONE, NONE]]);
    }
}
