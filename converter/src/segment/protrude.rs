//! Regions split at given vertices.
//!
//! A flattening shrinks a protrusion exponentially with its length over its girth (the decay of a harmonic function along
//! a tube), so a finger inside a region ends up as a speck that is not sampled. Only the flattening shows it; whoever
//! made one names the tips. Method: the tip and the vertex of its region that is farthest from it grow cells in the
//! region's place, the centres of the others theirs; [`repair`](super::repair) adds what makes the cells valid, and those
//! outside the split regions are merged again.

use super::complex::id;
use super::surface::Surface;
use super::voronoi::{Seed, Voronoi, centres, within};
use super::{Labels, Segmentation, goals, merge_cells, repair};
use crate::mesh::{ManifoldMesh, NONE};

/// Splits the regions that hold `tips`. `None` when that has no valid result.
///
/// `locked` says of every vertex whether it is in a region that was split before, and is updated.
pub fn split_at(
    mesh: &ManifoldMesh,
    segmentation: &Segmentation,
    tips: &[u32],
    locked: &mut [bool],
) -> Option<Segmentation> {
    let surface = Surface::of(mesh);
    let mut labels = segmentation.labels.clone();
    for (label, &component) in labels.iter_mut().zip(&surface.component_of) {
        if component == NONE {
            *label = NONE;
        }
    }
    let mut seeds: Vec<u32> = centres(&surface, &labels, segmentation.regions, 0.0)
        .into_iter()
        .map(|seed| seed.vertex)
        .collect();
    let mut split = vec![false; segmentation.regions as usize];
    for &tip in tips {
        let region = labels[tip as usize];
        let from_tip = within(&surface, &labels, &[tip]);
        let members = (0..labels.len()).filter(|&v| labels[v] == region);
        let root = members.max_by(|&a, &b| from_tip[a].total_cmp(&from_tip[b]));
        if let (Some(root), Some(seed)) = (root, seeds.get_mut(region as usize)) {
            *seed = id(root);
            split[region as usize] = true;
        }
    }
    let distances = within(&surface, &labels, &seeds);
    let tips: Vec<Seed> = tips
        .iter()
        .filter(|&&v| distances[v as usize] > 0.0)
        .map(|&vertex| Seed { vertex, start: 0.0 })
        .collect();
    if tips.is_empty() {
        return None;
    }
    // What splitting has made of a region must not be merged to it again.
    for (locked, &label) in locked.iter_mut().zip(&labels) {
        *locked |= label != NONE && split[label as usize];
    }
    let mut voronoi = Voronoi {
        touched: vec![false; seeds.len()],
        seeds,
        labels,
        distances,
    };
    voronoi.add(&surface, tips);
    if !repair::repair(mesh, &surface, &mut voronoi).is_empty() {
        return None;
    }
    let goal = segmentation.regions;
    let mut labels = merge_cells(mesh, &surface, &voronoi, &goals(&surface, goal), locked);
    // Where nothing moved the borders stay; elsewhere they cross in the middle. A region lives on where most of it is.
    let lives_on = heirs(&segmentation.labels, segmentation.regions, &labels);
    let mut crossings = vec![0.5; segmentation.crossings.len()];
    for (h, crossing) in crossings.iter_mut().enumerate() {
        let t = mesh.triangles[h / 3];
        let kept =
            |v: u32| lives_on[segmentation.labels[v as usize] as usize] == labels.of[v as usize];
        let (u, v) = (t[h % 3], t[(h % 3 + 1) % 3]);
        if kept(u) && kept(v) {
            *crossing = segmentation.crossings[h];
        }
    }
    for label in &mut labels.of {
        *label = if *label == NONE { 0 } else { *label };
    }
    Some(Segmentation {
        labels: labels.of,
        regions: labels.count,
        crossings,
    })
}

/// For every old region the new one that holds most of it.
fn heirs(old: &[u32], regions: u32, new: &Labels) -> Vec<u32> {
    let mut pairs: Vec<(u32, u32)> = old.iter().copied().zip(new.of.iter().copied()).collect();
    pairs.sort_unstable();
    let mut heirs = vec![(0, NONE); regions as usize];
    for run in pairs.chunk_by(|a, b| a == b) {
        let heir = &mut heirs[run[0].0 as usize];
        if run.len() > heir.0 && run[0].1 != NONE {
            *heir = (run.len(), run[0].1);
        }
    }
    heirs.into_iter().map(|(_, new)| new).collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::Soup;
    use super::super::{segment, verify};
    use super::*;

    #[test]
    fn the_ends_of_a_long_tube_become_regions() {
        let mesh = Soup::tube(24, 200, 60.0, true).manifold();
        let segmentation = segment(&mesh, 8);
        let poles = [id(mesh.positions.len() - 2), id(mesh.positions.len() - 1)];
        let split = split_at(
            &mesh,
            &segmentation,
            &poles,
            &mut vec![false; mesh.positions.len()],
        )
        .unwrap();
        assert!(
            split.regions > segmentation.regions,
            "{} regions",
            split.regions
        );
        assert_eq!(verify(&mesh, &split), Ok(()));
    }

    #[test]
    fn a_region_of_one_vertex_is_not_split() {
        let mesh = Soup::tetrahedron().manifold();
        let segmentation = segment(&mesh, 4);
        assert!(split_at(&mesh, &segmentation, &[0], &mut [false; 4]).is_none());
    }
}
