//! The order in which a cluster's triangles are told.
//!
//! A triangle is told by the edge that it shares with those before it, and by its third corner, which mostly is new or the
//! next vertex along the front: the boundary of what has been told (Gumhold & Straßer, "Real time compression of triangle mesh
//! connectivity", 1998). A new vertex is predicted to complete the parallelogram across that edge (Touma & Gotsman, "Triangle mesh
//! compression", 1998). Meshes here have few vertices and may have several sheets at an edge, so the front is a plain list of
//! edges.

#[cfg(not(target_arch = "wasm32"))]
mod tell;

#[cfg(not(target_arch = "wasm32"))]
pub(crate) use tell::{Told, tell};

use super::MAX_CLUSTER_VERTICES;
use crate::Error;

/// Edges of the front that can be named.
#[cfg(not(target_arch = "wasm32"))]
const NAMED: usize = 63;
/// Named by a triangle that shares no edge with those before it.
pub(crate) const START: u8 = 63;
/// Bits of the third corner in an operation.
pub(crate) const APEX_BITS: u32 = 2;
/// The third corner: a new vertex,
const NEW: u8 = 0;
/// where the front comes from to the edge,
const LEFT: u8 = 1;
/// where it goes on from the edge,
const RIGHT: u8 = 2;
/// or given by its number.
const GIVEN: u8 = 3;

/// The edge that an operation names, and its third corner.
pub(crate) fn parts(operation: u8) -> (u8, u8) {
    (operation >> APEX_BITS, operation & GIVEN)
}

/// How many corners an operation gives by their numbers.
pub(crate) fn given_by(operation: u8) -> usize {
    match parts(operation) {
        (START, _) => 3,
        (_, GIVEN) => 1,
        _ => 0,
    }
}

/// What a new vertex is predicted by: vertices before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Prediction {
    /// Nothing.
    Nothing,
    /// A vertex.
    Near(u8),
    /// The ends of an edge, and the corner opposite to it on this side.
    Across([u8; 3]),
}

/// Triangles in order, and what predicts each vertex.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Walk {
    pub(crate) triangles: Vec<[u8; 3]>,
    pub(crate) predictions: Vec<Prediction>,
}

/// A wrong code for a corner.
pub(crate) fn refuse(found: usize) -> Error {
    Error::Value {
        what: "corner of a cluster's triangle",
        found: found as u64,
    }
}

impl Walk {
    /// The vertex that `code` stands for: so far behind the next new one. 0 is a new vertex, or the first where there are as many as
    /// there may be.
    pub(crate) fn vertex(&self, code: u8) -> Result<usize, Error> {
        let next = self.predictions.len();
        if code == 0 && next < MAX_CLUSTER_VERTICES {
            return Ok(next);
        }
        let back = if code == 0 {
            MAX_CLUSTER_VERTICES
        } else {
            usize::from(code)
        };
        next.checked_sub(back).ok_or_else(|| refuse(back))
    }

    /// Takes a corner; a new one has the `prediction`.
    pub(crate) fn corner(
        &mut self,
        vertex: usize,
        vertices: usize,
        prediction: Prediction,
    ) -> Result<u8, Error> {
        if vertex >= vertices {
            return Err(refuse(vertex));
        }
        if vertex == self.predictions.len() {
            self.predictions.push(prediction);
        }
        u8::try_from(vertex).ok().ok_or_else(|| refuse(vertex))
    }

    /// The prediction by the corner before.
    pub(crate) fn by_last(&self) -> Prediction {
        match self.triangles.last() {
            Some(&[.., last]) => Prediction::Near(last),
            None => Prediction::Nothing,
        }
    }

    /// Takes a triangle.
    pub(crate) fn push(&mut self, corners: [u8; 3]) -> Result<(), Error> {
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            return Err(refuse(usize::from(a)));
        }
        self.triangles.push(corners);
        Ok(())
    }

    /// The walk, if it met all `vertices`.
    pub(crate) fn finish(self, vertices: usize) -> Result<Self, Error> {
        if self.predictions.len() == vertices {
            return Ok(self);
        }
        Err(Error::Mismatch {
            what: "vertices of a cluster",
            expected: vertices as u64,
            found: self.predictions.len() as u64,
        })
    }
}

/// The boundary of what has been told.
#[derive(Debug)]
struct Front {
    /// Edges of its triangles, and the corner opposite to each; the newest is the last.
    edges: Vec<[u8; 3]>,
    /// By vertex, how many edges leave it.
    leaving: [u32; MAX_CLUSTER_VERTICES],
}

impl Default for Front {
    fn default() -> Self {
        Self {
            edges: Vec::new(),
            leaving: [0; MAX_CLUSTER_VERTICES],
        }
    }
}

impl Front {
    /// How many edges leave a vertex.
    #[expect(
        clippy::indexing_slicing,
        reason = "there is a place for all that a byte can number"
    )]
    fn leaving(&mut self, vertex: u8) -> &mut u32 {
        &mut self.leaving[usize::from(vertex)]
    }

    /// Adds an edge, which closes one that runs the other way.
    fn add(&mut self, edge: [u8; 3]) {
        let [from, to, _] = edge;
        // Mostly none does, and then it need not be looked for.
        let twin = (*self.leaving(to) > 0)
            .then(|| {
                self.edges
                    .iter()
                    .rposition(|&[a, b, _]| a == to && b == from)
            })
            .flatten();
        if let Some(twin) = twin {
            self.remove(twin);
        } else {
            let leaving = self.leaving(from);
            *leaving = leaving.saturating_add(1);
            self.edges.push(edge);
        }
    }

    fn remove(&mut self, index: usize) -> [u8; 3] {
        let edge = self.edges.remove(index);
        let leaving = self.leaving(edge[0]);
        *leaving = leaving.saturating_sub(1);
        edge
    }

    /// Removes the edge that is `place` edges before the newest.
    fn take(&mut self, place: usize) -> Option<[u8; 3]> {
        let index = self.edges.len().checked_sub(place)?.checked_sub(1)?;
        Some(self.remove(index))
    }

    /// Where the newest edge to `to` comes from.
    fn before(&self, to: u8) -> Option<u8> {
        let edge = self.edges.iter().rfind(|edge| edge[1] == to);
        edge.map(|edge| edge[0])
    }

    /// Where the newest edge from `from` goes.
    fn after(&self, from: u8) -> Option<u8> {
        let edge = self.edges.iter().rfind(|edge| edge[0] == from);
        edge.map(|edge| edge[1])
    }

    /// Adds all edges of a triangle, or those but the first.
    fn add_triangle(&mut self, [a, b, c]: [u8; 3], is_start: bool) {
        if is_start {
            self.add([a, b, c]);
        }
        self.add([b, c, a]);
        self.add([c, a, b]);
    }
}

/// The walk that `operations` tell, one a triangle, with the vertices `given` by their numbers.
pub(crate) fn read(operations: &[u8], given: &[u8], vertices: usize) -> Result<Walk, Error> {
    let mut walk = Walk::default();
    let mut front = Front::default();
    let mut given = given.iter().copied();
    for &operation in operations {
        let (place, apex) = parts(operation);
        let mut next = || given.next().ok_or_else(|| refuse(usize::from(operation)));
        if place == START {
            if apex != NEW {
                return Err(refuse(usize::from(operation)));
            }
            let vertex = walk.vertex(next()?)?;
            let a = walk.corner(vertex, vertices, walk.by_last())?;
            let vertex = walk.vertex(next()?)?;
            let b = walk.corner(vertex, vertices, Prediction::Near(a))?;
            let vertex = walk.vertex(next()?)?;
            let c = walk.corner(vertex, vertices, Prediction::Near(b))?;
            walk.push([a, b, c])?;
            front.add_triangle([a, b, c], true);
            continue;
        }
        let refused = || refuse(usize::from(operation));
        let edge = front.take(usize::from(place)).ok_or_else(refused)?;
        let [from, to, _] = edge;
        let vertex = match apex {
            NEW => walk.predictions.len(),
            LEFT => usize::from(front.before(from).ok_or_else(refused)?),
            RIGHT => usize::from(front.after(to).ok_or_else(refused)?),
            _ => walk.vertex(next()?)?,
        };
        let corner = walk.corner(vertex, vertices, Prediction::Across(edge))?;
        walk.push([to, from, corner])?;
        front.add_triangle([to, from, corner], false);
    }
    if given.next().is_some() {
        return Err(refuse(operations.len()));
    }
    walk.finish(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A triangle that starts, by new vertices.
    const STARTED: u8 = START << APEX_BITS;

    fn found(operations: &[u8], given: &[u8], vertices: usize) -> u64 {
        match read(operations, given, vertices) {
            Err(Error::Value {
                what: "corner of a cluster's triangle",
                found,
            }) => found,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn two_triangles_are_read() {
        let walk = read(&[STARTED, NEW], &[0, 0, 0], 4).unwrap();
        assert_eq!(walk.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(walk.predictions[3], Prediction::Across([2, 0, 1]));
        assert_eq!(parts(STARTED), (START, NEW));
        assert_eq!([STARTED, GIVEN, LEFT].map(given_by), [3, 1, 0]);
    }

    #[test]
    fn corners_that_do_not_exist_are_refused() {
        // Before the first.
        assert_eq!(found(&[STARTED], &[1, 0, 0], 3), 1);
        // Two equal ones.
        assert_eq!(found(&[STARTED], &[0, 1, 0], 3), 0);
        // A new one beyond the last.
        assert_eq!(found(&[STARTED, NEW], &[0, 0, 0], 3), 3);
        // An edge that is not there, and nothing to start from.
        assert_eq!(found(&[STARTED, 62 << APEX_BITS], &[0, 0, 0], 4), 62 << 2);
        assert_eq!(found(&[NEW], &[], 3), 0);
        // A start with a neighbour.
        assert_eq!(found(&[STARTED | LEFT], &[0, 0, 0], 3), 253);
        // One too many, and one too few.
        assert_eq!(found(&[STARTED], &[0, 0, 0, 0], 3), 1);
        assert_eq!(found(&[STARTED], &[0, 0], 3), 252);
    }

    #[test]
    fn vertices_that_no_triangle_has_are_refused() {
        assert!(matches!(
            read(&[STARTED], &[0, 0, 0], 4),
            Err(Error::Mismatch {
                what: "vertices of a cluster",
                expected: 4,
                found: 3
            })
        ));
    }

    proptest! {
        #[test]
        fn any_operations_are_read_or_refused(operations in prop::collection::vec(any::<u8>(), 0..60), given in prop::collection::vec(0..9u8, 0..90)) {
            let _ = read(&operations, &given, 40);
        }
    }
}
