//! Shortest paths from many starts, in buckets of distances.
//!
//! Δ-stepping (Meyer & Sanders, "Δ-stepping: a parallelizable shortest path algorithm", 2003) on one thread: what is about
//! equally far waits in one bucket, in the order it came, and a vertex that later turns out to be nearer is looked at again.
//! Edges of a scan are about equally long, so few are, and nothing has to be sorted.
//!
//! Limit: where edges are much shorter than the mean, vertices are looked at often.

use super::surface::Surface;

/// Buckets; what is farther waits apart.
const BUCKETS: usize = 1024;

/// Width of a bucket in mean lengths of edges.
const WIDTH: f64 = 0.5;

/// Vertices to look at, by distance.
pub(super) struct Front {
    /// Bucket `k` holds distances from `base + k * width` on.
    buckets: Vec<Vec<(f64, u32)>>,
    far: Vec<(f64, u32)>,
    base: f64,
    width: f64,
}

impl Front {
    pub(super) fn new(surface: &Surface) -> Self {
        Self {
            buckets: vec![Vec::new(); BUCKETS],
            far: Vec::new(),
            base: 0.0,
            width: (WIDTH * surface.mean_length).max(f64::MIN_POSITIVE),
        }
    }

    /// Adds a vertex at a finite distance, not below the one looked at.
    pub(super) fn push(&mut self, distance: f64, vertex: u32) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the cast saturates, as wanted"
        )]
        let at = ((distance - self.base) / self.width) as usize;
        match self.buckets.get_mut(at) {
            Some(bucket) => bucket.push((distance, vertex)),
            None => self.far.push((distance, vertex)),
        }
    }

    /// Shortens `distances` until no edge does; `edges` gives ends and lengths of those from a vertex. `allow` is told of every
    /// step that would, and may refuse it.
    pub(super) fn spread<Edges: Iterator<Item = (u32, f64)>>(
        mut self,
        edges: impl Fn(u32) -> Edges,
        distances: &mut [f64],
        mut allow: impl FnMut(u32, u32) -> bool,
    ) {
        loop {
            for at in 0..self.buckets.len() {
                let mut seen = 0;
                while let Some(&(distance, v)) = self.buckets[at].get(seen) {
                    seen += 1;
                    if distance > distances[v as usize] {
                        continue;
                    }
                    for (w, length) in edges(v) {
                        let through = distance + length;
                        if through < distances[w as usize] && allow(v, w) {
                            distances[w as usize] = through;
                            self.push(through, w);
                        }
                    }
                }
                self.buckets[at].clear();
            }
            let mut far = std::mem::take(&mut self.far);
            far.retain(|&(distance, v)| distance <= distances[v as usize]);
            self.base = far.iter().map(|&(d, _)| d).fold(f64::INFINITY, f64::min);
            if self.base == f64::INFINITY {
                return;
            }
            // However far they are, a few rounds get there.
            self.width *= 2.0;
            for (distance, v) in far {
                self.push(distance, v);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::Soup;
    use super::*;

    /// Bellman and Ford's relaxation of all edges until nothing changes.
    fn naive(surface: &Surface, start: u32) -> Vec<f64> {
        let mut distances = vec![f64::INFINITY; surface.cells.len()];
        distances[start as usize] = 0.0;
        loop {
            let before = distances.clone();
            for v in 0..u32::try_from(distances.len()).unwrap() {
                for (w, length) in surface.edges_from(v) {
                    let through = distances[v as usize] + length;
                    distances[w as usize] = distances[w as usize].min(through);
                }
            }
            if distances == before {
                return distances;
            }
        }
    }

    #[test]
    fn distances_are_the_shortest() {
        // 60 girths long: most of it is beyond the first buckets.
        for mesh in [
            Soup::tube(5, 400, 400.0, true).manifold(),
            Soup::tube(24, 60, 3.0, false).manifold(),
        ] {
            let surface = Surface::of(&mesh);
            let mut distances = vec![f64::INFINITY; surface.cells.len()];
            distances[7] = 0.0;
            let mut front = Front::new(&surface);
            front.width /= 8.0;
            front.push(0.0, 7);
            front.spread(|v| surface.edges_from(v), &mut distances, |_, _| true);
            assert_eq!(distances, naive(&surface, 7));
        }
    }
}
