//! Facts about whole segmentations.

use super::test_meshes::{Random, Soup};
use super::test_scans::scan;
use super::{Segmentation, Violation, segment, verify};
use crate::mesh::ManifoldMesh;
use glam::DVec3;
use std::time::Instant;

/// Segments, checks, and prints what came out.
fn check(name: &str, mesh: &ManifoldMesh, target: u32) -> Segmentation {
    let start = Instant::now();
    let segmentation = segment(mesh, target);
    let took = start.elapsed();
    if let Err(violation) = verify(mesh, &segmentation) {
        panic!("{name}: {violation}");
    }
    println!(
        "{name}: {} triangles, target {target}: {} regions in {took:.2?}; {}",
        mesh.triangles.len(),
        segmentation.regions,
        shape(mesh, &segmentation)
    );
    segmentation
}

/// Areas relative to the mean and roundness, 4 pi area / perimeter² (1 is a flat disk; a hexagon's edge path gives about 0.7).
fn shape(mesh: &ManifoldMesh, segmentation: &Segmentation) -> String {
    let regions = segmentation.regions as usize;
    let (mut areas, mut perimeters) = (vec![0.0; regions], vec![0.0; regions]);
    let mut degrees = vec![std::collections::BTreeSet::new(); regions];
    for (i, t) in mesh.triangles.iter().enumerate() {
        let p = t.map(|v| mesh.positions[v as usize]);
        let area = (p[1] - p[0]).cross(p[2] - p[0]).length() / 6.0;
        let labels = t.map(|v| segmentation.labels[v as usize] as usize);
        let crossing = |k: usize| {
            let (a, b) = (p[k], p[(k + 1) % 3]);
            a + (b - a) * f64::from(segmentation.crossings[3 * i + k])
        };
        let mixed: Vec<usize> = (0..3)
            .filter(|&k| labels[k] != labels[(k + 1) % 3])
            .collect();
        let centre = (p[0] + p[1] + p[2]) / 3.0;
        for &k in &mixed {
            let (a, b) = (labels[k], labels[(k + 1) % 3]);
            degrees[a].insert(b);
            degrees[b].insert(a);
            // Two crossings share the segment between them; three meet in the middle.
            let length = match mixed[..] {
                [j, l] => crossing(j).distance(crossing(l)) / 2.0,
                _ => crossing(k).distance(centre),
            };
            perimeters[a] += length;
            perimeters[b] += length;
        }
        for (k, &label) in labels.iter().enumerate() {
            areas[label] += area;
            if mesh.twins[3 * i + k] == crate::mesh::NONE {
                perimeters[label] += p[k].distance(p[(k + 1) % 3]) * 0.5;
                perimeters[labels[(k + 1) % 3]] += p[k].distance(p[(k + 1) % 3]) * 0.5;
            }
        }
    }
    let mean = areas.iter().sum::<f64>() / regions as f64;
    let mut round: Vec<f64> = areas
        .iter()
        .zip(&perimeters)
        .map(|(area, length)| 4.0 * std::f64::consts::PI * area / (length * length))
        .collect();
    let weighted = areas
        .iter()
        .zip(&round)
        .map(|(area, round)| area * round)
        .sum::<f64>()
        / areas.iter().sum::<f64>();
    let ragged = areas
        .iter()
        .zip(&round)
        .filter(|(_, round)| **round < 0.2)
        .map(|(area, _)| area)
        .sum::<f64>();
    let ragged = ragged / areas.iter().sum::<f64>();
    round.sort_by(f64::total_cmp);
    areas.sort_by(f64::total_cmp);
    let small = areas.iter().filter(|&&area| area < mean / 10.0).count();
    format!(
        "area {:.2}–{:.2} of mean, {small} below 0.1; roundness min {:.2}, p10 {:.2}, median {:.2}, by area {weighted:.2} ({:.0} % of it below 0.2); degree {}–{}",
        areas[0] / mean,
        areas[regions - 1] / mean,
        round[0],
        round[regions / 10],
        round[regions / 2],
        ragged * 100.0,
        degrees
            .iter()
            .map(std::collections::BTreeSet::len)
            .min()
            .unwrap(),
        degrees
            .iter()
            .map(std::collections::BTreeSet::len)
            .max()
            .unwrap(),
    )
}

fn triangle() -> Soup {
    Soup {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
    }
}

#[test]
fn smallest_surfaces_are_their_own_dual() {
    let triangle = triangle();
    assert_eq!(check("triangle", &triangle.manifold(), 30).regions, 3);
    assert_eq!(
        check("tetrahedron", &Soup::tetrahedron().manifold(), 1).regions,
        4
    );
    let mut two = triangle.clone();
    two.positions.push(DVec3::new(1.0, 1.0, 0.0));
    two.triangles.push([2, 1, 3]);
    assert_eq!(check("two triangles", &two.manifold(), 1).regions, 3);
    let mut soup = Soup::default();
    for i in 0..100 {
        soup.append(
            &triangle,
            DVec3::new(f64::from(i) * 1.5, 0.0, f64::from(i % 7)),
        );
    }
    assert_eq!(check("soup", &soup.manifold(), 10).regions, 300);
}

#[test]
fn pillow_is_refused_by_the_verifier() {
    let mut pillow = triangle();
    pillow.triangles.push([0, 2, 1]);
    let mesh = pillow.manifold();
    assert!(verify(&mesh, &segment(&mesh, 3)).is_err());
}

#[test]
fn empty_mesh_has_no_regions() {
    assert_eq!(segment(&ManifoldMesh::default(), 30).regions, 0);
}

#[test]
fn grids_give_about_the_target() {
    let disk = check("disk", &Soup::disk(60, 60).manifold(), 30);
    assert!((20..=45).contains(&disk.regions));
    let torus = check("torus", &Soup::torus(80, 40, 0.4).manifold(), 30);
    assert!((20..=45).contains(&torus.regions));
    let sphere = check("sphere", &Soup::sphere(60, 40).manifold(), 30);
    assert!((20..=45).contains(&sphere.regions));
    let strip = check("strip", &Soup::disk(600, 4).manifold(), 30);
    assert!((20..=60).contains(&strip.regions));
    check("ladder", &Soup::disk(300, 2).manifold(), 30);
    check("thin torus", &Soup::torus(400, 3, 0.01).manifold(), 30);
}

#[test]
fn tube_has_three_regions_around() {
    check(
        "closed tube",
        &Soup::tube(24, 230, 60.0, true).manifold(),
        30,
    );
    check(
        "open tube",
        &Soup::tube(24, 230, 60.0, false).manifold(),
        30,
    );
    check("prism", &Soup::tube(3, 100, 60.0, false).manifold(), 4);
}

#[test]
fn pole_of_high_valence_is_segmented() {
    check("pole", &Soup::tube(10_000, 3, 1.0, true).manifold(), 30);
}

#[test]
fn extreme_scales_and_slivers_are_segmented() {
    for scale in [1e20, 1e-20] {
        let mut soup = Soup::torus(30, 20, 0.4);
        for p in &mut soup.positions {
            *p = *p * scale + DVec3::splat(scale * 1e7);
        }
        check("far torus", &soup.manifold(), 20);
    }
    let mut needle = Soup::disk(40, 40);
    for p in &mut needle.positions {
        p.x *= 1e6;
    }
    check("needle", &needle.manifold(), 20);
    let mut point = Soup::sphere(20, 20);
    for p in &mut point.positions {
        *p = DVec3::ONE;
    }
    check("all in one point", &point.manifold(), 20);
}

#[test]
fn verifier_sees_broken_labels() {
    let mesh = Soup::disk(30, 30).manifold();
    let good = segment(&mesh, 12);
    let mut bad = good.clone();
    // An island in the middle of a region is a second piece of its region.
    let island = (0..900).find(|&v| {
        mesh.triangles
            .iter()
            .filter(|t| t.contains(&v))
            .flatten()
            .all(|&w| good.labels[w as usize] == good.labels[v as usize])
    });
    bad.labels[island.unwrap() as usize] =
        (good.labels[island.unwrap() as usize] + 1) % good.regions;
    assert!(matches!(
        verify(&mesh, &bad),
        Err(Violation::Pieces { pieces: 2, .. })
    ));
    let half = Segmentation {
        labels: mesh.origin.iter().map(|v| u32::from(v % 30 < 15)).collect(),
        regions: 2,
        ..good.clone()
    };
    assert!(matches!(
        verify(&mesh, &half),
        Err(Violation::Triple { .. })
    ));
    let mut crossing = good.clone();
    let h = crossing
        .crossings
        .iter()
        .position(|f| f.to_bits() != 0.5_f32.to_bits())
        .unwrap();
    crossing.crossings[h] = 1.0;
    assert!(matches!(
        verify(&mesh, &crossing),
        Err(Violation::Crossing { .. })
    ));
    let ring = Soup::torus(30, 10, 0.3).manifold();
    let rings = Segmentation {
        labels: ring.origin.iter().map(|v| v % 30 / 8).collect(),
        regions: 4,
        crossings: vec![0.5; ring.triangles.len() * 3],
    };
    assert!(matches!(
        verify(&ring, &rings),
        Err(Violation::NotADisk {
            characteristic: 0,
            ..
        })
    ));
    let mut short = good;
    short.labels.pop();
    assert!(matches!(verify(&mesh, &short), Err(Violation::Size { .. })));
}

#[test]
fn same_mesh_gives_same_labels() {
    let mesh = Soup::torus(60, 40, 0.5)
        .noisy(&mut Random::new(3), 0.01)
        .manifold();
    let (a, b) = (segment(&mesh, 30), segment(&mesh, 30));
    assert!(a.labels == b.labels && a.crossings == b.crossings);
}

#[test]
fn scans_are_segmented() {
    for (name, target, most) in [
        ("armadillo_86k.obj.gz", 30, 45),
        ("bun_zipper.ply", 30, 60),
        ("difficult/cgal_elephant-with-holes.off", 30, 1000),
        ("difficult/cgal_cheese.off", 60, 2000),
        ("difficult/cgal_turbine.off", 30, 1000),
    ] {
        let Some(mesh) = scan(name) else { continue };
        let regions = check(name, &mesh, target).regions;
        assert!(regions <= most, "{name}: {regions} regions");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "a minute without optimisation")]
fn dragon_is_segmented() {
    let Some(mesh) = scan("dragon_vrip.ply") else {
        return;
    };
    check("dragon", &mesh, 120);
    check("dragon", &mesh, 250);
}

#[test]
fn any_surface_is_segmented() {
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let size = 6 + random.below(18) as u32;
        let soup = match seed % 4 {
            0 => Soup::sphere(size, size),
            1 => Soup::torus(size * 2, size, 0.4),
            2 => Soup::disk(size, size),
            _ => Soup::tube(size, size, 10.0, false),
        };
        let (flips, holes, noise) = (
            random.below(4),
            random.below(30),
            random.below(3) as f64 * 0.03,
        );
        let soup = soup
            .flipped(&mut random, flips)
            .pierced(&mut random, holes)
            .noisy(&mut random, noise);
        let target = 1 + random.below(60) as u32;
        check(&format!("surface {seed}"), &soup.manifold(), target);
    }
}
