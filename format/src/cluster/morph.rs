//! What the vertices of a group's children become as the group's members take their place.
//!
//! Members are made of children by collapsing edges. With every vertex at the place of the one that it was collapsed to, the children
//! show exactly what the members show (Hoppe, "Progressive Meshes", 1996). That place is stored as its rank among all places of
//! the members, by distance from the vertex: nearly always one of the first.

use super::ClusterMesh;
use crate::LatticePoint;

/// A rank that says nothing: what the vertex becomes is not known.
pub const UNRANKED: u8 = u8::MAX;

/// Places of the vertices of a group's members.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Places(Vec<LatticePoint>);

impl Places {
    /// Of all `members` of a group.
    pub fn of<'a>(members: impl IntoIterator<Item = &'a ClusterMesh>) -> Self {
        let all = members.into_iter().flat_map(|mesh| &mesh.positions);
        let mut places: Vec<LatticePoint> = all.copied().collect();
        places.sort_unstable();
        places.dedup();
        Self(places)
    }

    /// How many places come before `to` by distance from `from`, of equally near ones those with the lesser coordinates; [`UNRANKED`] where
    /// that is as many or more, or `to` is no place.
    pub fn rank(&self, from: LatticePoint, to: LatticePoint) -> u8 {
        if self.0.binary_search(&to).is_err() {
            return UNRANKED;
        }
        let key = key(from, to);
        let before = (self.outward(from))
            .take_while(|&place| along_x(from, place) <= key.0)
            .filter(|&place| self::key(from, place) < key);
        u8::try_from(before.count()).unwrap_or(UNRANKED)
    }

    /// The place of a rank; `None` for [`UNRANKED`] and where there are no more than `rank`.
    pub fn at(&self, from: LatticePoint, rank: u8) -> Option<LatticePoint> {
        if rank == UNRANKED || usize::from(rank) >= self.0.len() {
            return None;
        }
        let wanted = usize::from(rank);
        // The nearest so far, in order, up to the one that is wanted.
        let mut nearest: Vec<(u64, LatticePoint)> = Vec::new();
        for place in self.outward(from) {
            let last = nearest.get(wanted).copied();
            if last.is_some_and(|(distance, _)| along_x(from, place) > distance) {
                break;
            }
            let key = key(from, place);
            if last.is_none_or(|last| key < last) {
                nearest.insert(nearest.partition_point(|&other| other < key), key);
                nearest.truncate(wanted.saturating_add(1));
            }
        }
        nearest.get(wanted).map(|&(_, place)| place)
    }

    /// All places, by their distance from `from` along the first axis.
    fn outward(&self, from: LatticePoint) -> impl Iterator<Item = LatticePoint> {
        let (below, above) = self.0.split_at(self.0.partition_point(|&p| p < from));
        let (mut below, mut above) = (below.iter().rev().peekable(), above.iter().peekable());
        std::iter::from_fn(move || {
            let is_below = match (below.peek(), above.peek()) {
                (Some(&&low), Some(&&high)) => along_x(from, low) < along_x(from, high),
                (low, _) => low.is_some(),
            };
            if is_below { below.next() } else { above.next() }.copied()
        })
    }
}

/// Squared distance along the first axis.
fn along_x([x, ..]: LatticePoint, [a, ..]: LatticePoint) -> u64 {
    u64::from(x.abs_diff(a)).saturating_pow(2)
}

/// Squared distance, and the place.
fn key(from: LatticePoint, place: LatticePoint) -> (u64, LatticePoint) {
    let [x, y, z] = from;
    let [a, b, c] = place;
    let square = |p: u32, q: u32| u64::from(p.abs_diff(q)).saturating_pow(2);
    let sum = square(x, a)
        .saturating_add(square(y, b))
        .saturating_add(square(z, c));
    (sum, place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_by_distance_and_lead_back() {
        let mesh = |positions: &[LatticePoint]| ClusterMesh {
            positions: positions.to_vec(),
            ..ClusterMesh::default()
        };
        let members = [
            mesh(&[[0, 0, 0], [8, 0, 0]]),
            mesh(&[[8, 0, 0], [4, 0, 4], [4, 4, 0]]),
        ];
        let places = Places::of(&members);
        assert_eq!(places.0.len(), 4);
        // Two are equally near: the lesser coordinates come first.
        let from = [4, 0, 0];
        let order = [[0, 0, 0], [4, 0, 4], [4, 4, 0], [8, 0, 0]];
        for (rank, place) in (0..).zip(order) {
            assert_eq!(places.rank(from, place), rank);
            assert_eq!(places.at(from, rank), Some(place));
        }
        assert_eq!(places.rank([4, 3, 0], [4, 4, 0]), 0);
        assert_eq!(places.rank(from, [1, 0, 0]), UNRANKED);
        assert_eq!(places.at(from, 4), None);
        assert_eq!(places.at(from, UNRANKED), None);
        assert_eq!(Places::default().at(from, 0), None);
    }

    #[test]
    fn ranks_are_those_of_all_places_sorted() {
        // Of a small cube, so that many are equally near, and some from outside of it.
        let mut seed = 1_u32;
        let mut draw = |below: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) % below
        };
        for count in [1, 2, 7, 60, 200] {
            let positions = (0..count).map(|_| [0; 3].map(|_| 4 + draw(8))).collect();
            let places = Places::of(&[ClusterMesh {
                positions,
                ..ClusterMesh::default()
            }]);
            for _ in 0..50 {
                let from = [0; 3].map(|_: u32| draw(16));
                let mut sorted = places.0.clone();
                sorted.sort_by_key(|&place| key(from, place));
                for (rank, place) in (0..).zip(sorted) {
                    assert_eq!(places.rank(from, place), rank, "{from:?} {place:?}");
                    assert_eq!(places.at(from, rank), Some(place), "{from:?} {rank}");
                }
            }
        }
    }

    #[test]
    fn what_is_beyond_the_last_rank_has_none() {
        let positions = (0..300).map(|x| [x, 0, 0]).collect();
        let places = Places::of(&[ClusterMesh {
            positions,
            ..ClusterMesh::default()
        }]);
        assert_eq!(places.rank([0; 3], [254, 0, 0]), 254);
        assert_eq!(places.rank([0; 3], [255, 0, 0]), UNRANKED);
    }
}
