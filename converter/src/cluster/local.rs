//! Bounds triangle by triangle.
//!
//! What a group's children become is at most so far from them, and they from what they are made of: added up as the largest of each, that is far above the truth, since
//! where one is largest the other mostly is not. So it is added up where it is: a [`Link`] says that a part of a triangle of a child and a part of one of a member
//! are so near to each other. What is known of a child's triangle, both that all of it is near the source and that the parts of the source that are nearest to it are, then holds
//! for the member's with that distance more. The largest of all triangles of a group is its error.

use super::leaf::upwards;

/// A triangle of a group's children and one of its members, parts of which are at most `distance` apart; by number, those of the first node first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Link {
    pub(super) child: u32,
    pub(super) member: u32,
    /// Lattice units.
    pub(super) distance: f32,
}

impl Link {
    pub(super) fn new(child: u32, member: u32, distance: f64) -> Self {
        Self {
            child,
            member,
            distance: upwards(distance),
        }
    }
}

/// The farthest link of each pair.
pub(super) fn merged(mut links: Vec<Link>) -> Vec<Link> {
    links.sort_unstable_by(|a, b| {
        let pairs = (a.member, a.child).cmp(&(b.member, b.child));
        pairs.then(b.distance.total_cmp(&a.distance))
    });
    links.dedup_by_key(|link| (link.member, link.child));
    links
}

/// What is known of the triangles of the members of a group, of which there are `count`, from what is known of its children's, `below`.
pub(super) fn above(links: &[Link], below: &[f32], count: usize) -> Vec<f32> {
    let mut above = vec![0.0_f32; count];
    for link in links {
        let own = &mut above[link.member as usize];
        let distance = f64::from(below[link.child as usize]) + f64::from(link.distance);
        *own = own.max(upwards(distance));
    }
    above
}

#[cfg(test)]
mod tests {
    use super::super::bound::{Target, linked};
    use super::super::direct::tests::{bumps, places, sheet};
    use super::*;
    use glam::DVec3;

    #[test]
    fn what_is_known_is_added_up_where_it_is() {
        let link = |[child, member]: [u32; 2], distance| Link::new(child, member, distance);
        let links = [
            link([1, 1], 2.0),
            link([0, 0], 1.0),
            link([1, 1], 5.0),
            link([0, 1], 3.0),
        ];
        let links = merged(links.to_vec());
        assert_eq!(links.len(), 3);
        // Not 105, as the largest of both sums to: what is 100 off has become something nearer.
        assert_eq!(above(&links, &[100.0, 7.0], 2), [101.0, 103.0]);
        assert_eq!(above(&links, &[1.0, 7.0], 2), [2.0, 12.0]);
    }

    /// Every point of either sheet is as near to one that is linked to its triangle as the link says: so a known distance of the
    /// one holds for the other with that more.
    #[test]
    fn links_hold_both_ways() {
        let spike = |x: f64, y: f64| {
            let from = (x - 0.4).hypot(y - 0.65);
            bumps(x, y) + (0.08 - from).max(0.0)
        };
        let (fine, coarse) = (sheet(40, spike), sheet(8, bumps));
        let [first, second] = [&coarse, &fine]
            .map(|(positions, triangles)| Target::new(positions, triangles).unwrap());
        let (distance, links) = linked(&first, &second);
        let most = links.iter().map(|link| link.distance).fold(0.0, f32::max);
        assert!(f64::from(most) >= distance.bound && most < 0.12, "{most}");
        let corners = |(positions, triangles): &(Vec<DVec3>, Vec<[u32; 3]>), t: u32| {
            triangles[t as usize].map(|v| positions[v as usize])
        };
        let mut tight = 0;
        for (own, other, is_back) in [(&fine, &coarse, false), (&coarse, &fine, true)] {
            for t in (0u32..).take(own.1.len()) {
                let linked: Vec<&Link> = (links.iter())
                    .filter(|link| t == if is_back { link.member } else { link.child })
                    .collect();
                let largest = linked.iter().map(|link| link.distance).fold(0.0, f32::max);
                tight += usize::from(largest < 0.75 * most);
                for point in places(corners(own, t)) {
                    let is_near = |link: &&&Link| {
                        let other = corners(other, if is_back { link.child } else { link.member });
                        let nearest = marquetry_evaluation::distance::closest_point(other, point);
                        nearest.distance(point) <= f64::from(link.distance) * (1.0 + 1e-9)
                    };
                    assert!(linked.iter().any(|link| is_near(&link)), "{t} {point}");
                }
            }
        }
        assert!(tight > fine.1.len() / 2, "{tight}");
    }
}
