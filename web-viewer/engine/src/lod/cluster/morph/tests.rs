use super::*;
use crate::lod::animate::Drawn;
use crate::lod::cluster::target::{GroupSurface, Targets};
use crate::lod::cluster::{drawn, refine, triangles};
use crate::testing::{Random, Wall, clustered};
use marquetry_format::{ByteSource, ClusterMesh};
use std::collections::BTreeSet;
use std::sync::Arc;

/// All meshes of a file, and what each moves to.
struct Meshes {
    meshes: Vec<Arc<ClusterMesh>>,
    targets: Vec<Targets>,
}

impl Meshes {
    fn new(document: &Document, source: &dyn ByteSource) -> Self {
        let clusters = document.clusters.as_ref().unwrap();
        let meshes: Vec<Arc<ClusterMesh>> = (0..clusters.count())
            .map(ClusterId)
            .map(|id| {
                let bytes = source.read(clusters.node(id).unwrap().range.clone());
                Arc::new(document.decode_cluster(id, &bytes.unwrap()).unwrap())
            })
            .collect();
        let mut targets = vec![Targets::default(); meshes.len()];
        for group in &clusters.groups {
            let members = group
                .members
                .iter()
                .map(|id| Arc::clone(&meshes[id.0 as usize]));
            let surface = GroupSurface::new(members.collect());
            for child in group.children.clone() {
                targets[child as usize] = surface.targets(&meshes[child as usize]);
            }
        }
        Self { meshes, targets }
    }

    /// The corners of everything drawn, where the shader puts them.
    fn triangles(&self, document: &Document, drawn_now: &Drawn) -> Vec<[[u32; 3]; 3]> {
        let clusters = document.clusters.as_ref().unwrap();
        let mut all = Vec::new();
        for id in drawn(document, &drawn_now.cut) {
            let morph = drawn_now.cluster_morph(clusters, id);
            let (mesh, targets) = (&self.meshes[id.0 as usize], &self.targets[id.0 as usize]);
            let moved = |corner: u8| {
                let vertex = usize::from(corner);
                let own = mesh.positions[vertex];
                let target = targets.positions.get(vertex).copied().unwrap_or(own);
                [0, 1, 2].map(|axis: usize| {
                    let (own, target) = (own[axis] as f32, target[axis] as f32);
                    (own + morph * (target - own)).to_bits()
                })
            };
            all.extend(mesh.triangles.iter().map(|triangle| triangle.map(moved)));
        }
        all
    }

    /// Every edge is met the other way round, but for those on the outline of the wall.
    fn assert_closed(&self, wall: &Wall, drawn_now: &Drawn) {
        let mut edges: BTreeMap<([u32; 3], [u32; 3]), i32> = BTreeMap::new();
        for [a, b, c] in self.triangles(&wall.document, drawn_now) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if from != to {
                    *edges.entry((from.min(to), from.max(to))).or_default() +=
                        if from < to { 1 } else { -1 };
                }
            }
        }
        for ((from, to), _) in edges.into_iter().filter(|(_, balance)| *balance != 0) {
            let ends = [from, to].map(|end| end.map(f32::from_bits));
            assert!(wall.is_outline(ends), "a crack at {ends:?}");
        }
    }
}

/// What [`advance`] promises of every state.
fn check(document: &Document, drawn_now: &Drawn) {
    let clusters = document.clusters.as_ref().unwrap();
    let mut reached = BTreeSet::from([ClusterId(0)]);
    for group in &clusters.groups {
        if !drawn_now.cut.is_group_split(group) {
            continue;
        }
        let id = clusters.node(group.members[0]).unwrap().group.unwrap();
        let moves = drawn_now.group_morphs.get(&id).copied().unwrap_or(0.0);
        assert!((0.0..=1.0).contains(&moves));
        for child in group.children.clone().map(ClusterId) {
            assert!(moves == 0.0 || !drawn_now.cut.is_cluster_split(child));
            reached.insert(child);
        }
        for member in &group.members {
            assert!(drawn_now.cluster_morph(clusters, *member) == 0.0);
            assert!(reached.contains(member));
        }
    }
    for id in drawn_now.group_morphs.keys() {
        assert!(drawn_now.cut.is_group_split(clusters.group(*id).unwrap()));
    }
}

/// Half of what may be on its way at rest is.
fn random_target(document: &Document, random: &mut Random) -> Drawn {
    let mut cut = Cut::coarsest(document.charts.len());
    let one_in = [1, 2, 4, 12, 60][random.below(5) as usize];
    refine(document, &mut cut, |_, _, _| random.below(one_in) > 0);
    let clusters = document.clusters.as_ref().unwrap();
    let mut target = Drawn::of(cut);
    for id in split_groups(clusters, &target.cut) {
        let group = clusters.group(id).unwrap();
        let mut children = group.children.clone().map(ClusterId);
        if !children.any(|id| target.cut.is_cluster_split(id)) && random.below(2) == 0 {
            let morph = (1 + random.below(8)) as f32 / 8.0;
            target.group_morphs.insert(id, morph);
        }
    }
    target
}

#[test]
fn every_step_towards_any_target_is_whole() {
    let mut random = Random::new(41);
    let mut moving = 0;
    for columns in [2, 5, 40, 100] {
        let wall = Wall::new(columns, None).unwrap();
        let document = &wall.document;
        let meshes = Meshes::new(document, &wall.file);
        let mut state = Drawn::of(Cut::coarsest(document.charts.len()));
        for _ in 0..25 {
            let target = random_target(document, &mut random);
            for _ in 0..random.below(9) {
                state.advance_clusters(&target, document, |_| 0.3);
                check(document, &state);
                wall.assert_whole(&state.cut);
                meshes.assert_closed(&wall, &state);
                moving += usize::from(!state.group_morphs.is_empty());
            }
        }
    }
    assert!(moving > 100, "{moving}");
}

#[test]
fn every_target_is_reached() {
    let mut random = Random::new(42);
    let wall = Wall::new(120, None).unwrap();
    let (tree, _) = clustered(300).unwrap();
    for document in [&wall.document, &tree] {
        let mut state = Drawn::of(Cut::coarsest(document.charts.len()));
        for round in 0..30 {
            let target = random_target(document, &mut random);
            let step = [0.2, 0.5, 1.0][round % 3];
            let mut steps = 0;
            while state != target {
                state.advance_clusters(&target, document, |_| step);
                check(document, &state);
                steps += 1;
                assert!(steps < 300, "stuck");
            }
        }
    }
}

#[test]
fn children_appear_a_step_from_the_surface_of_their_group() {
    let wall = Wall::new(64, None).unwrap();
    let document = &wall.document;
    let clusters = document.clusters.as_ref().unwrap();
    let meshes = Meshes::new(document, &wall.file);
    let mut target = Drawn::of(Cut::coarsest(document.charts.len()));
    let mut state = target.clone();
    target.cut.split_group(&clusters.groups[0]);
    assert!(state.advance_clusters(&target, document, |_| 0.25));
    assert_eq!(
        state.group_morphs.values().copied().collect::<Vec<_>>(),
        [0.75]
    );
    let root = &meshes.meshes[0];
    let (mut off, mut moved) = (0.0f64, 0);
    for child in clusters.groups[0].children.clone() {
        let (mesh, targets) = (
            &meshes.meshes[child as usize],
            &meshes.targets[child as usize],
        );
        for (own, target) in mesh.positions.iter().zip(&targets.positions) {
            moved += usize::from(own != target);
            let p = glam::DVec3::from_array(target.map(f64::from));
            let distance = root.triangles.iter().map(|corners| {
                let [a, b, c] = corners.map(|c| {
                    glam::DVec3::from_array(root.positions[usize::from(c)].map(f64::from))
                });
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let inside = [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|(from, to)| (*to - *from).cross(p - *from).dot(normal) > -1e7);
                if inside {
                    (p - a).dot(normal).abs()
                } else {
                    f64::INFINITY
                }
            });
            off = off.max(distance.fold(f64::INFINITY, f64::min));
        }
    }
    assert!(moved > 0 && off < 2.0, "{moved} {off}");
    for expected in [0.5, 0.25] {
        assert!(!state.advance_clusters(&target, document, |_| 0.25));
        assert_eq!(
            state.group_morphs.values().copied().collect::<Vec<_>>(),
            [expected]
        );
    }
    state.advance_clusters(&target, document, |_| 0.25);
    assert_eq!(state, target);
    assert!(triangles(document, &state.cut) > 0);
}

#[test]
fn what_moves_stays_within_the_bounds_that_it_is_culled_by() {
    let wall = Wall::new(60, None).unwrap();
    let document = &wall.document;
    let clusters = document.clusters.as_ref().unwrap();
    let meshes = Meshes::new(document, &wall.file);
    assert_eq!(bounds(clusters, ClusterId(0)), None);
    let is_in = |bounds: &Bounds, place: &[u32; 3]| {
        (0..3).all(|k| bounds.min[k] <= place[k] && place[k] <= bounds.max[k])
    };
    let mut beyond = 0;
    for id in (1..clusters.count()).map(ClusterId) {
        let (mesh, targets) = (
            &meshes.meshes[id.0 as usize],
            &meshes.targets[id.0 as usize],
        );
        let of_group = bounds(clusters, id).unwrap();
        let own = clusters.node(id).unwrap().bounds;
        for place in mesh.positions.iter().chain(&targets.positions) {
            assert!(is_in(&of_group, place));
        }
        beyond += usize::from(!targets.positions.iter().all(|place| is_in(&own, place)));
    }
    assert!(beyond > 20, "{beyond} clusters leave their own bounds");
}
