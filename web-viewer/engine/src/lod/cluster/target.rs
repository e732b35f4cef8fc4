//! Where the vertices of a cluster are on the surface that its group takes the place of.
//!
//! With all of them there the group's children show what its members show, so they can come and go without a jump: the geomorph
//! of Hoppe, "Progressive Meshes", 1996. The file tells the place that a vertex was collapsed to by its rank
//! ([`marquetry_format::cluster::morph`]). Where it does not, a vertex whose place some member has stays there, and others go to the nearest point
//! of the surface. The outer border of the group is of vertices that stay, so what lies beside it meets it all the way. Clusters
//! of one group ask the same surface, so what they share moves alike.
//!
//! Limits: of vertices that go to nearest points edges of the members are not edges of the children, so at the end of the way both surfaces differ by what the children's
//! edges cut off of these; where the surface has two sheets nearer to each other than the error, such a vertex may go to the wrong one.

use super::nearest::{Nearest, OnTriangle};
use glam::{DVec3, Vec3};
use marquetry_format::cluster::morph::{Places, UNRANKED};
use marquetry_format::{ClusterMesh, LatticePoint, octahedral};
use std::sync::{Arc, OnceLock};

/// What the members of a group show, for the targets of its children.
#[derive(Debug)]
pub struct GroupSurface {
    members: Vec<Arc<ClusterMesh>>,
    /// Made for the first child, on whatever thread.
    prepared: OnceLock<Prepared>,
}

/// Of all vertices of a cluster, in their order: what they are on the group's surface.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Targets {
    /// Positions on the lattice.
    pub positions: Vec<LatticePoint>,
    /// Octahedral normals.
    pub normals: Vec<[u8; 2]>,
    /// sRGB colours; empty where clusters have none.
    pub colours: Vec<[u8; 3]>,
}

#[derive(Debug)]
struct Prepared {
    /// Least coordinates.
    floor: LatticePoint,
    places: Places,
    /// Made for the first vertex of which the file does not say what it becomes.
    nearest: OnceLock<Nearest>,
    /// Member and corners of each triangle.
    triangles: Vec<(u32, [u8; 3])>,
    /// All vertices, in the order of their places.
    vertices: Vec<(LatticePoint, u32, u8)>,
}

impl GroupSurface {
    /// The surface of `members`, in an order that is always the same for a group.
    pub fn new(members: Vec<Arc<ClusterMesh>>) -> Self {
        Self {
            members,
            prepared: OnceLock::new(),
        }
    }

    /// Where the vertices of `mesh`, a child of the group, are on it.
    pub fn targets(&self, mesh: &ClusterMesh) -> Targets {
        let prepared = self.prepared.get_or_init(|| Prepared::new(&self.members));
        let mut targets = Targets::default();
        let mut hint = 0;
        for (vertex, (&place, &normal)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
            let rank = mesh.ranks.get(vertex).copied().unwrap_or(UNRANKED);
            let on = (prepared.places.at(place, rank))
                .and_then(|became| self.at(prepared, became, normal))
                .or_else(|| self.at(prepared, place, normal))
                .or_else(|| self.nearest(prepared, place, &mut hint));
            let colour = mesh.colours.get(vertex).copied();
            // A group without triangles has nothing to move to.
            let (position, normal, colour) = match on {
                Some((position, normal, other)) => (position, normal, colour.and(other)),
                None => (place, normal, colour),
            };
            targets.positions.push(position);
            targets.normals.push(normal);
            targets.colours.extend(colour);
        }
        targets
    }

    /// Of the members' vertices at `place` the one whose normal is most like `normal`.
    fn at(&self, prepared: &Prepared, place: LatticePoint, normal: [u8; 2]) -> Option<OnSurface> {
        let first = prepared.vertices.partition_point(|vertex| vertex.0 < place);
        let own = Vec3::from_array(octahedral::decode(normal));
        let like = |code: [u8; 2]| own.dot(Vec3::from_array(octahedral::decode(code)));
        let alike = prepared.vertices.get(first..)?.iter();
        alike
            .take_while(|vertex| vertex.0 == place)
            .filter_map(|&(_, member, vertex)| {
                let (normal, colour) = self.vertex(member, vertex)?;
                Some((place, normal, colour))
            })
            .max_by(|a, b| like(a.1).total_cmp(&like(b.1)))
    }

    fn nearest(
        &self,
        prepared: &Prepared,
        place: LatticePoint,
        hint: &mut usize,
    ) -> Option<OnSurface> {
        let nearest = (prepared.nearest).get_or_init(|| prepared.nearest(&self.members));
        let found = nearest.to(offset(prepared.floor, place), *hint)?;
        *hint = found.place;
        let OnTriangle {
            triangle, weights, ..
        } = found;
        let &(member, corners) = prepared.triangles.get(usize::try_from(triangle).ok()?)?;
        let mesh = self.members.get(usize::try_from(member).ok()?)?;
        let (mut position, mut normal, mut colour) = (DVec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        let mut has_colour = true;
        for (corner, weight) in corners.into_iter().zip(weights) {
            let at = mesh.positions.get(usize::from(corner))?;
            let (own, rgb) = self.vertex(member, corner)?;
            position += f64::from(weight) * DVec3::from_array(at.map(f64::from));
            normal += weight * Vec3::from_array(octahedral::decode(own));
            has_colour &= rgb.is_some();
            colour += weight * Vec3::from_array(rgb.unwrap_or_default().map(f32::from));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "means of coordinates and of bytes"
        )]
        let (position, colour) = (
            position.to_array().map(|c| c.round() as u32),
            colour.to_array().map(|c| c.round() as u8),
        );
        let normal = octahedral::encode(normal.to_array());
        Some((position, normal, has_colour.then_some(colour)))
    }

    /// Normal and colour of a member's vertex.
    fn vertex(&self, member: u32, vertex: u8) -> Option<([u8; 2], Option<[u8; 3]>)> {
        let mesh = self.members.get(usize::try_from(member).ok()?)?;
        let vertex = usize::from(vertex);
        Some((
            *mesh.normals.get(vertex)?,
            mesh.colours.get(vertex).copied(),
        ))
    }
}

/// Position, normal and colour.
type OnSurface = (LatticePoint, [u8; 2], Option<[u8; 3]>);

impl Prepared {
    fn new(members: &[Arc<ClusterMesh>]) -> Self {
        let mut floor = [u32::MAX; 3];
        let mut vertices = Vec::new();
        for (member, mesh) in (0..).zip(members) {
            for (vertex, place) in (0..=u8::MAX).zip(&mesh.positions) {
                vertices.push((*place, member, vertex));
                for (low, c) in floor.iter_mut().zip(place) {
                    *low = (*low).min(*c);
                }
            }
        }
        vertices.sort_unstable();
        let mut triangles = Vec::new();
        for (member, mesh) in (0..).zip(members) {
            let is_there = |&corner: &u8| usize::from(corner) < mesh.positions.len();
            let whole = mesh.triangles.iter().filter(|t| t.iter().all(is_there));
            triangles.extend(whole.map(|&triangle| (member, triangle)));
        }
        Self {
            floor,
            places: Places::of(members.iter().map(AsRef::as_ref)),
            nearest: OnceLock::new(),
            triangles,
            vertices,
        }
    }

    /// Of the same members.
    fn nearest(&self, members: &[Arc<ClusterMesh>]) -> Nearest {
        let corners = self.triangles.iter().filter_map(|&(member, corners)| {
            let mesh = members.get(usize::try_from(member).ok()?)?;
            let at = |corner: u8| mesh.positions.get(usize::from(corner)).copied();
            let [a, b, c] = corners.map(at);
            Some([a?, b?, c?].map(|place| offset(self.floor, place)))
        });
        Nearest::new(&corners.collect::<Vec<_>>())
    }
}

/// From `floor`, the least coordinates, so that less is lost to rounding.
fn offset(floor: LatticePoint, place: LatticePoint) -> Vec3 {
    let [x, y, z] = place.map(f64::from);
    let [a, b, c] = floor.map(f64::from);
    DVec3::new(x - a, y - b, z - c).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(size: u32, normal: [f32; 3]) -> ClusterMesh {
        ClusterMesh {
            positions: vec![[0, 0, 50], [size, 0, 50], [size, size, 50], [0, size, 50]],
            normals: vec![octahedral::encode(normal); 4],
            colours: vec![[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..ClusterMesh::default()
        }
    }

    #[test]
    fn vertices_fall_onto_the_surface_and_those_of_a_member_stay() {
        let up = [0.0, 0.0, 1.0];
        let surface = GroupSurface::new(vec![Arc::new(square(1000, up))]);
        let mut child = square(1000, [0.0, 1.0, 0.0]);
        child.positions.extend([[250, 500, 70], [1200, 1100, 10]]);
        child.normals.extend([[0; 2]; 2]);
        child.colours.extend([[9; 3]; 2]);
        let targets = surface.targets(&child);
        assert_eq!(targets.positions[..4], child.positions[..4]);
        assert_eq!(targets.positions[4..], [[250, 500, 50], [1000, 1000, 50]]);
        assert_eq!(targets.colours[4..], [[25, 50, 0], [100, 100, 0]]);
        assert!(targets.normals.iter().all(|&n| n == octahedral::encode(up)));
    }

    #[test]
    fn vertices_become_what_the_file_says() {
        let (up, aside) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let members = [up, aside].map(|normal| Arc::new(square(1000, normal)));
        let mut child = square(1000, up);
        child.positions[2] = [900, 990, 60];
        child.positions[3] = [10, 900, 40];
        child.normals[3] = octahedral::encode(aside);
        // The fourth is told nothing that there is.
        for (ranks, last) in [([0, 1, 0, 9], [10, 900, 50]), ([0, 1, 0, 1], [0, 0, 50])] {
            child.ranks = ranks.to_vec();
            let targets = GroupSurface::new(members.to_vec()).targets(&child);
            assert_eq!(
                targets.positions,
                [[0, 0, 50], [0, 0, 50], [1000, 1000, 50], last]
            );
            assert_eq!(targets.normals[..3], [octahedral::encode(up); 3]);
            assert_eq!(targets.colours[1..3], [[0, 0, 0], [100, 100, 0]]);
        }
        let targets = GroupSurface::new(members.to_vec()).targets(&child);
        assert_eq!(targets.normals[3], octahedral::encode(aside));
    }

    #[test]
    fn of_several_normals_at_a_place_the_nearest_is_meant() {
        let (up, aside) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let members = [up, aside].map(|normal| Arc::new(square(1000, normal)));
        let surface = GroupSurface::new(members.to_vec());
        for normal in [up, aside] {
            let child = square(1000, normal);
            assert_eq!(surface.targets(&child).normals, child.normals);
        }
    }

    #[test]
    fn without_members_nothing_moves() {
        let child = square(1000, [0.0, 0.0, 1.0]);
        let targets = GroupSurface::new(Vec::new()).targets(&child);
        assert_eq!(targets.positions, child.positions);
        assert_eq!(targets.colours, child.colours);
    }
}
