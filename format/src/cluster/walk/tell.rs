//! From triangles to a walk.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "no bytes of a file come here, and the caller has checked the mesh"
)]

use super::{APEX_BITS, Front, GIVEN, LEFT, NAMED, NEW, Prediction, RIGHT, START, Walk, refuse};
use crate::Error;
use crate::cluster::MAX_CLUSTER_VERTICES;

/// Triangles told as [`read`](super::read) reads them.
#[derive(Debug, Default)]
pub(crate) struct Told {
    pub(crate) operations: Vec<u8>,
    pub(crate) given: Vec<u8>,
    pub(crate) walk: Walk,
    /// By new number, the vertex it had before.
    pub(crate) order: Vec<u8>,
}

/// Tells `triangles` in an order of its own, which telling them again does not change.
///
/// The vertices are numbered in the order in which they are met. Corners of a triangle differ.
pub(crate) fn tell(triangles: &[[u8; 3]]) -> Result<Told, Error> {
    // Edges, the triangle and its corner opposite to each.
    let mut edges: Vec<([u8; 2], usize, u8)> = Vec::with_capacity(3 * triangles.len());
    for (index, &[a, b, c]) in triangles.iter().enumerate() {
        edges.extend([([a, b], index, c), ([b, c], index, a), ([c, a], index, b)]);
    }
    edges.sort_unstable();
    let mut told = Told::default();
    let mut front = Front::default();
    let mut numbers: [Option<u8>; MAX_CLUSTER_VERTICES] = [None; MAX_CLUSTER_VERTICES];
    let mut is_told = vec![false; triangles.len()];
    // Edges beyond which all has been told, by their ends.
    let mut is_border = vec![[false; MAX_CLUSTER_VERTICES]; MAX_CLUSTER_VERTICES];
    let mut first_untold = 0;
    while told.walk.triangles.len() < triangles.len() {
        let named = front.edges.iter().rev().take(NAMED).enumerate();
        let across = named.into_iter().find_map(|(place, &[from, to, _])| {
            if is_border[usize::from(from)][usize::from(to)] {
                return None;
            }
            let old = [to, from].map(|new| told.order[usize::from(new)]);
            let start = edges.partition_point(|edge| edge.0 < old);
            let same = edges[start..].iter().take_while(|edge| edge.0 == old);
            let untold = same.into_iter().find(|&&(_, index, _)| !is_told[index]);
            is_border[usize::from(from)][usize::from(to)] = untold.is_none();
            untold.map(|&(_, index, apex)| (place, index, apex))
        });
        let Some((place, index, apex)) = across else {
            while is_told[first_untold] {
                first_untold += 1;
            }
            is_told[first_untold] = true;
            told.start(triangles[first_untold], &mut numbers, &mut front)?;
            continue;
        };
        is_told[index] = true;
        let Some(edge) = front.take(place) else {
            return Err(refuse(place));
        };
        let [from, to, _] = edge;
        let known = numbers[usize::from(apex)];
        let code = match known {
            None => NEW,
            Some(known) if front.before(from) == Some(known) => LEFT,
            Some(known) if front.after(to) == Some(known) => RIGHT,
            Some(_) => GIVEN,
        };
        told.operations.push((place as u8) << APEX_BITS | code);
        let prediction = Prediction::Across(edge);
        let corner = told.name(apex, &mut numbers, prediction, code == GIVEN)?;
        told.walk.push([to, from, corner])?;
        front.add_triangle([to, from, corner], false);
    }
    Ok(told)
}

impl Told {
    /// Tells a triangle that shares no edge.
    fn start(
        &mut self,
        [a, b, c]: [u8; 3],
        numbers: &mut [Option<u8>; MAX_CLUSTER_VERTICES],
        front: &mut Front,
    ) -> Result<(), Error> {
        self.operations.push(START << APEX_BITS | NEW);
        let a = self.name(a, numbers, self.walk.by_last(), true)?;
        let b = self.name(b, numbers, Prediction::Near(a), true)?;
        let c = self.name(c, numbers, Prediction::Near(b), true)?;
        self.walk.push([a, b, c])?;
        front.add_triangle([a, b, c], true);
        Ok(())
    }

    /// The new number of a vertex, which is `is_given` by how far it is behind the next new one.
    fn name(
        &mut self,
        old: u8,
        numbers: &mut [Option<u8>; MAX_CLUSTER_VERTICES],
        prediction: Prediction,
        is_given: bool,
    ) -> Result<u8, Error> {
        let next = self.walk.predictions.len();
        let vertex = numbers[usize::from(old)].map_or(next, usize::from);
        if is_given {
            // 256 is 0.
            self.given.push((next - vertex) as u8);
        }
        let number = self.walk.corner(vertex, MAX_CLUSTER_VERTICES, prediction)?;
        if vertex == next {
            self.order.push(old);
            numbers[usize::from(old)] = Some(number);
        }
        Ok(number)
    }
}
