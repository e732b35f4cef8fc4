//! Triangles with more texels than a cluster's image has room for are halved.
//!
//! The longest edge of such a triangle is halved, in all triangles that have it (those of other sheets, which have their own
//! copies of its vertices, as well), so nothing comes apart and the surface stays what it was, up to the lattice.

use super::Need;
use crate::mesh::ManifoldMesh;
use crate::mesh::adjacency::id;
use glam::DVec3;
use std::collections::HashMap;

/// Halves triangles of `components` that have more than `most` texels, as `needs` says of each. The halves join the component of
/// the whole. Neighbours are no longer known.
pub fn refine(
    mesh: &mut ManifoldMesh,
    components: &mut [Vec<u32>],
    needs: &mut Vec<Need>,
    most: f32,
) {
    if needs.iter().all(|need| need.texels() <= most) {
        return;
    }
    let mut component_of = vec![0; mesh.triangles.len()];
    for (number, component) in (0u32..).zip(&*components) {
        for &t in component {
            component_of[t as usize] = number;
        }
    }
    mesh.twins = Vec::new();
    let mut origins = mesh.origin.iter().map(|&o| o + 1).max().unwrap_or(0);
    // Triangles at every edge, which is named by the origins of its ends.
    let mut sides: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for (t, corners) in (0u32..).zip(&mesh.triangles) {
        for edge in edges(corners.map(|v| mesh.origin[v as usize])) {
            sides.entry(edge).or_default().push(t);
        }
    }
    let mut next = 0;
    while next < mesh.triangles.len() {
        if needs[next].texels() <= most {
            next += 1;
            continue;
        }
        let edge = longest(mesh, mesh.triangles[next]);
        let mut middles: Vec<([u32; 2], u32)> = Vec::new();
        for t in sides.remove(&edge).unwrap_or_default() {
            let corners = mesh.triangles[t as usize];
            let own = edges(corners)
                .into_iter()
                .find(|own| named(mesh, *own) == edge);
            let Some(ends) = own else { continue };
            let known = middles.iter().find(|(other, _)| *other == ends);
            let middle =
                known.map_or_else(|| add_middle(mesh, ends, origins), |(_, middle)| *middle);
            middles.push((ends, middle));
            let half = |end: u32| corners.map(|v| if v == end { middle } else { v });
            let other = id(mesh.triangles.len());
            for edge in edges(corners) {
                if let Some(sides) = sides.get_mut(&named(mesh, edge)) {
                    sides.retain(|side| *side != t);
                }
            }
            for (number, corners) in [(t, half(ends[0])), (other, half(ends[1]))] {
                for edge in edges(corners) {
                    sides.entry(named(mesh, edge)).or_default().push(number);
                }
            }
            mesh.triangles[t as usize] = half(ends[0]);
            mesh.triangles.push(half(ends[1]));
            needs[t as usize] = needs[t as usize].halved();
            needs.push(needs[t as usize]);
            component_of.push(component_of[t as usize]);
        }
        origins += 1;
    }
    components.iter_mut().for_each(Vec::clear);
    for (t, component) in (0u32..).zip(component_of) {
        components[component as usize].push(t);
    }
}

/// The vertex half-way between two, which is one with those of the same `origin`.
fn add_middle(mesh: &mut ManifoldMesh, ends: [u32; 2], origin: u32) -> u32 {
    let [a, b] = ends.map(|v| v as usize);
    let middle = id(mesh.positions.len());
    mesh.positions
        .push(mesh.positions[a].midpoint(mesh.positions[b]));
    let normal = (mesh.normals[a] + mesh.normals[b]).normalize_or(mesh.normals[a]);
    mesh.normals.push(normal);
    if !mesh.colours.is_empty() {
        let [one, other] = [mesh.colours[a], mesh.colours[b]];
        mesh.colours
            .push([0, 1, 2].map(|k: usize| one[k].midpoint(other[k])));
    }
    mesh.origin.push(origin);
    middle
}

/// The name of an edge between two vertices.
fn named(mesh: &ManifoldMesh, ends: [u32; 2]) -> [u32; 2] {
    let [a, b] = ends.map(|v| mesh.origin[v as usize]);
    [a.min(b), a.max(b)]
}

fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// The name of the longest edge.
fn longest(mesh: &ManifoldMesh, corners: [u32; 3]) -> [u32; 2] {
    let length = |[a, b]: [u32; 2]| {
        let [a, b]: [DVec3; 2] = [a, b].map(|v| mesh.positions[v as usize]);
        a.distance_squared(b)
    };
    let [first, rest @ ..] = edges(corners);
    let longest = rest.into_iter().fold(first, |best, edge| {
        let order = length(edge)
            .total_cmp(&length(best))
            .then(named(mesh, best).cmp(&named(mesh, edge)));
        if order.is_gt() { edge } else { best }
    });
    named(mesh, longest)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "halves of 0 and 1 are exact")]
mod tests {
    use super::*;

    /// A square of two triangles, the first of which has far more texels.
    fn square() -> (ManifoldMesh, Vec<Vec<u32>>, Vec<Need>) {
        let mesh = ManifoldMesh {
            positions: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(|[x, y]| DVec3::new(x, y, 0.0))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            normals: vec![DVec3::Z; 4],
            colours: vec![[0, 100, 200]; 4],
            origin: vec![0, 1, 2, 3],
            ..ManifoldMesh::default()
        };
        (
            mesh,
            vec![vec![0, 1]],
            [1000.0, 10.0].map(Need::Texels).to_vec(),
        )
    }

    #[test]
    fn halves_cover_what_the_whole_did_without_t_junctions() {
        let (mut mesh, mut components, mut needs) = square();
        refine(&mut mesh, &mut components, &mut needs, 70.0);
        assert!(needs.iter().all(|need| need.texels() <= 70.0));
        assert_eq!(needs.len(), mesh.triangles.len());
        assert_eq!(components[0].len(), mesh.triangles.len());
        let mut area = 0.0;
        let mut open: HashMap<[u32; 2], i32> = HashMap::new();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let doubled = (b - a).cross(c - a);
            assert!(doubled.z > 0.0);
            area += doubled.z / 2.0;
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                *open.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!((area - 1.0).abs() < 1e-12);
        // What is left open is the outline: no vertex lies within an edge that others use.
        for [a, b] in open
            .iter()
            .filter(|(_, sum)| **sum != 0)
            .map(|(edge, _)| *edge)
        {
            let [a, b] = [a, b].map(|v| mesh.positions[v as usize]);
            let on = |k: usize| a[k] == b[k] && (a[k] == 0.0 || a[k] == 1.0);
            assert!(on(0) || on(1), "{a} {b}");
        }
        assert_eq!(mesh.colours.len(), mesh.positions.len());
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        assert_eq!(mesh.origin.len(), mesh.positions.len());
    }

    /// Both triangles have their own vertices, as sheets have that were cut apart.
    #[test]
    fn what_was_cut_apart_is_halved_together() {
        let (mut mesh, _, mut needs) = square();
        for v in [0, 2] {
            mesh.positions.push(mesh.positions[v]);
            mesh.normals.push(mesh.normals[v]);
            mesh.colours.push(mesh.colours[v]);
            mesh.origin.push(mesh.origin[v]);
        }
        mesh.triangles[1] = [4, 5, 3];
        let mut components = vec![vec![0], vec![1]];
        refine(&mut mesh, &mut components, &mut needs, 70.0);
        let places = |component: &[u32]| -> Vec<[u64; 3]> {
            let corners = component.iter().flat_map(|&t| mesh.triangles[t as usize]);
            let on_cut = corners
                .map(|v| mesh.positions[v as usize])
                .filter(|p| p.x == p.y);
            let mut places: Vec<_> = on_cut.map(|p| p.to_array().map(f64::to_bits)).collect();
            places.sort_unstable();
            places.dedup();
            places
        };
        assert_eq!(places(&components[0]), places(&components[1]));
        assert!(places(&components[0]).len() > 2);
        let vertices = |component: &[u32]| -> std::collections::HashSet<u32> {
            component
                .iter()
                .flat_map(|&t| mesh.triangles[t as usize])
                .collect()
        };
        assert!(vertices(&components[0]).is_disjoint(&vertices(&components[1])));
    }

    #[test]
    fn halves_have_the_colour_of_the_whole() {
        let (mut mesh, mut components, mut needs) = square();
        needs[1] = Need::Colour([1, 2, 3]);
        refine(&mut mesh, &mut components, &mut needs, 70.0);
        let coloured: f64 = (mesh.triangles.iter().zip(&needs))
            .filter(|(_, need)| **need == Need::Colour([1, 2, 3]))
            .map(|(t, _)| {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                (b - a).cross(c - a).z / 2.0
            })
            .sum();
        assert!((coloured - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_has_few_texels_stays() {
        let (mut mesh, mut components, mut needs) = square();
        let before = mesh.triangles.clone();
        refine(&mut mesh, &mut components, &mut needs, 1000.0);
        assert_eq!(mesh.triangles, before);
    }
}
