//! Vertices at the places of others.
//!
//! A mesh that is cut apart for its texture has most vertices along the cuts twice, with the same normal and colour. Such a *twin* is told by how
//! many earlier vertices are nearer to where it is predicted than the first at its place, which is nearly always few.

#![allow(
    clippy::arithmetic_side_effects,
    reason = "coordinates have 21 bits, and what predicts them is within the lattice"
)]

use super::walk::Prediction;
use crate::Error;
use crate::codec::range::{Bit, Coder, Number};
use crate::codec::sample::Position;

/// Which vertices are twins, as far as they are known, and how likely those to come are.
#[derive(Debug, Default)]
pub(crate) struct Twins {
    /// By vertex the first at its place: itself, where it is no twin.
    first: Vec<u8>,
    is_twin: [Bit; 6],
    /// `None` where there are no twins.
    rank: Option<Number>,
    /// Vertices that are no twins, and the squares of their distances from where one is predicted.
    nearest: Vec<(u64, u8)>,
}

impl Twins {
    /// For a mesh that has `some`; without, no vertex is one.
    pub(crate) fn new(some: bool) -> Self {
        Self {
            rank: some.then(|| Number::new(4)),
            ..Self::default()
        }
    }

    /// The first vertex at the place of `vertex`, if it is another.
    pub(crate) fn of(&self, vertex: usize) -> Option<usize> {
        let first = usize::from(*self.first.get(vertex)?);
        (first != vertex).then_some(first)
    }

    /// Whether the next vertex, which is predicted to be at `from`, is at the place of one of those `before`: then its position.
    pub(crate) fn next(
        &mut self,
        coder: &mut impl Coder,
        prediction: Prediction,
        from: Position,
        before: &[Position],
        told: Option<Position>,
    ) -> Result<Option<Position>, Error> {
        let vertex = before.len();
        let own = u8::try_from(vertex).unwrap_or(u8::MAX);
        let Some(rank) = &mut self.rank else {
            self.first.push(own);
            return Ok(None);
        };
        let told = told.and_then(|told| before.iter().position(|&other| other == told));
        let kind = match prediction {
            Prediction::Nothing => 0,
            Prediction::Near(other) => 1 + usize::from(is_twin(&self.first, other)),
            Prediction::Across([a, b, _]) => {
                3 + usize::from(is_twin(&self.first, a)) + usize::from(is_twin(&self.first, b))
            }
        };
        let model = self.is_twin.get_mut(kind);
        if !model.is_some_and(|model| coder.bit(model, told.is_some())) {
            self.first.push(own);
            return Ok(None);
        }
        self.nearest.clear();
        for (&position, other) in before.iter().zip(0..=u8::MAX) {
            if !is_twin(&self.first, other) {
                self.nearest.push((distance2(from, position), other));
            }
        }
        let told = told.and_then(|told| Some((distance2(from, *before.get(told)?), told)));
        let is_nearer = |&&(distance2, other): &&(u64, u8)| {
            told.is_some_and(|told| (distance2, usize::from(other)) < told)
        };
        let number = self.nearest.iter().filter(is_nearer).count();
        let number = rank.unsigned(coder, u32::try_from(number).unwrap_or_default());
        let at = usize::try_from(number).unwrap_or(usize::MAX);
        if at >= self.nearest.len() {
            return Err(Error::Value {
                what: "twin of a cluster's vertex",
                found: u64::from(number),
            });
        }
        let (_, &mut (_, first), _) = self.nearest.select_nth_unstable(at);
        self.first.push(first);
        Ok(before.get(usize::from(first)).copied())
    }
}

/// Whether a vertex is at the place of an earlier one.
fn is_twin(first: &[u8], vertex: u8) -> bool {
    first
        .get(usize::from(vertex))
        .is_some_and(|&first| first != vertex)
}

fn distance2(Position(a): Position, Position(b): Position) -> u64 {
    let square = |(a, b): (i32, i32)| u64::from(a.abs_diff(b)).pow(2);
    a.into_iter().zip(b).map(square).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};

    /// Each predicted by the one before; which are twins of which.
    fn run(
        coder: &mut impl Coder,
        told: &[Position],
        count: usize,
    ) -> Result<(Vec<Position>, Vec<Option<usize>>), Error> {
        let mut twins = Twins::new(true);
        let mut positions: Vec<Position> = Vec::new();
        for vertex in 0..count {
            let last = positions.last().copied().unwrap_or_default();
            let prediction = match vertex.checked_sub(1) {
                Some(before) => Prediction::Near(u8::try_from(before).unwrap()),
                None => Prediction::Nothing,
            };
            let own = told.get(vertex).copied();
            let twin = twins.next(coder, prediction, last, &positions, own)?;
            // The reader is not told where those are that are none: each as far on as its number.
            positions.push(twin.or(own).unwrap_or(Position([vertex as i32, 0, 0])));
        }
        Ok((positions, (0..count).map(|v| twins.of(v)).collect()))
    }

    #[test]
    fn twins_are_found_and_lead_to_the_first_at_their_place() {
        let told = [0, 1, 2, 1, 0, 5, 1, 5].map(|x| Position([x, 0, 0]));
        let mut encoder = Encoder::new();
        let (_, first) = run(&mut encoder, &told, told.len()).unwrap();
        let expected = [None, None, None, Some(1), Some(0), None, Some(1), Some(5)];
        assert_eq!(first, expected);
        let bytes = encoder.finish();
        let (positions, first) = run(&mut Decoder::new(&bytes), &[], told.len()).unwrap();
        assert_eq!(positions, told);
        assert_eq!(first, expected);
        assert!(bytes.len() < 7, "{}", bytes.len());
    }

    #[test]
    fn the_last_vertex_may_be_a_twin() {
        let mut told: Vec<Position> = (0..255).map(|x| Position([x, 0, 0])).collect();
        told.push(Position([9, 0, 0]));
        let mut encoder = Encoder::new();
        run(&mut encoder, &told, told.len()).unwrap();
        let bytes = encoder.finish();
        let (positions, first) = run(&mut Decoder::new(&bytes), &[], told.len()).unwrap();
        assert_eq!((positions, first[255]), (told, Some(9)));
    }

    #[test]
    fn a_twin_of_nothing_is_refused() {
        let mut encoder = Encoder::new();
        encoder.bit(&mut Bit::default(), true);
        Number::new(4).unsigned(&mut encoder, 0);
        let bytes = encoder.finish();
        let refused = run(&mut Decoder::new(&bytes), &[], 1);
        assert!(matches!(refused, Err(Error::Value { what, .. }) if what.starts_with("twin")));
    }
}
