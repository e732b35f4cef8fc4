//! Clusters that are replaced together: what is written is read, whatever the order it is given in, and broken rules are refused.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::verify::verify;
use marquetry_format::writer::ClusterInput;
use marquetry_format::*;
use support::*;

fn written(nodes: &[ClusterInput]) -> Result<Vec<u8>, Error> {
    without_charts(10, true).write_with(nodes)
}

/// Numbers that look random (xorshift64*).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % limit
    }
}

/// The nodes, all but the root in another order.
fn shuffled(nodes: &[ClusterInput], random: &mut Random) -> Vec<ClusterInput> {
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    for last in (2..order.len()).rev() {
        order.swap(last, 1 + random.below(last));
    }
    let mut places = vec![0; nodes.len()];
    for (place, &node) in (0u32..).zip(&order) {
        places[node] = place;
    }
    let moved = |&node: &usize| {
        let mut node = nodes[node].clone();
        for child in &mut node.children {
            *child = places[*child as usize];
        }
        node
    };
    order.iter().map(moved).collect()
}

/// Nodes in groups of one to three, which have two to five children, taken from anywhere above; the error says which node it is.
fn random_groups(random: &mut Random, groups: usize) -> Vec<ClusterInput> {
    let leaf = clusters(10, true)[6].clone();
    let mut nodes = vec![leaf.clone()];
    let mut leaves = vec![0];
    for group in 0..groups {
        let mut members: Vec<usize> = Vec::new();
        for _ in 0..=random.below(3) {
            if !leaves.is_empty() {
                members.push(leaves.swap_remove(random.below(leaves.len())));
            }
        }
        let start = nodes.len();
        let end = start + 2 + random.below(4);
        for member in members {
            nodes[member].children = (start as u32..end as u32).collect();
            nodes[member].error = 8e6 / (group + 1) as f32;
        }
        nodes.resize(end, leaf.clone());
        leaves.extend(start..end);
    }
    nodes
}

#[test]
fn groups_survive() {
    let nodes = grouped_clusters(10, true);
    let file = written(&nodes).unwrap();
    let report = verify(&SliceSource(&file)).unwrap();
    assert!(report.ok, "{report:#?}");
    let document = open(&file);
    let clusters = document.clusters.as_ref().unwrap();
    let members = |group: usize| clusters.groups[group].members.iter().map(|id| id.0);
    let children = |group: usize| clusters.groups[group].children.clone();
    let groups: Vec<(Vec<u32>, _)> = (0..clusters.groups.len())
        .map(|group| (members(group).collect(), children(group)))
        .collect();
    assert_eq!(
        groups,
        [
            (vec![0], 1..5),
            (vec![1, 4], 7..9),
            (vec![2, 3], 5..7),
            (vec![5], 9..11),
            (vec![6, 7], 11..13),
        ]
    );
    let levels: Vec<u8> = clusters.nodes.iter().map(|node| node.level).collect();
    assert_eq!(levels, [0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]);
    let parents: Vec<u32> = clusters.nodes[1..]
        .iter()
        .map(|node| node.parent.unwrap().0)
        .collect();
    assert_eq!(parents, [0, 0, 0, 0, 2, 2, 1, 1, 5, 5, 6, 6]);
    let meshes = decode_clusters(&document, &SliceSource(&file));
    for ((given, read), node) in nodes.iter().zip(&meshes).zip(&clusters.nodes) {
        let positions = |mesh: &ClusterMesh| triangles_of(mesh, |v| mesh.positions[v]);
        assert_eq!(positions(&given.mesh), positions(read));
        assert_eq!(node.children.len(), given.children.len());
        for child in clusters
            .nodes
            .iter()
            .enumerate()
            .filter_map(|(index, child)| node.children.contains(&(index as u32)).then_some(child))
        {
            let inside = |axis: usize| {
                node.bounds.min[axis] <= child.bounds.min[axis]
                    && child.bounds.max[axis] <= node.bounds.max[axis]
            };
            assert!((0..3).all(inside) && child.error <= node.error);
            assert!(child.level > node.level);
        }
    }
    assert_eq!(clusters.leaf_triangles(), 5 * 5 * 4);
    assert!(clusters.groups.iter().all(|group| group.is_nearer));
}

#[test]
fn groups_know_whether_their_children_are_nearer() {
    let mut nodes = grouped_clusters(10, true);
    // Leaves as far as what they are below: the same again below 5, finer below 6 and 7.
    for (leaf, member) in [(9, 5), (12, 6)] {
        nodes[leaf].error = nodes[member].error;
    }
    nodes[9].mesh = nodes[5].mesh.clone();
    nodes[10].mesh = nodes[1].mesh.clone();
    nodes[5].mesh = nodes[8].mesh.clone();
    // As far as the root, with leaves below.
    for inner in [1, 4] {
        nodes[inner].error = nodes[0].error;
    }
    let file = written(&nodes).unwrap();
    let report = verify(&SliceSource(&file)).unwrap();
    assert!(report.ok, "{report:#?}");
    let clusters = open(&file).clusters.unwrap();
    let are_nearer: Vec<bool> = clusters.groups.iter().map(|g| g.is_nearer).collect();
    assert_eq!(are_nearer, [true, true, true, false, true]);
}

#[test]
fn ranks_survive_and_verify_looks_at_them() {
    let nodes = ranked(grouped_clusters(10, true));
    let read = |nodes: &[ClusterInput]| {
        let file = written(nodes).unwrap();
        let report = verify(&SliceSource(&file)).unwrap();
        let said = report
            .checks
            .iter()
            .find(|check| check.name.contains("become"))
            .cloned();
        (
            decode_clusters(&open(&file), &SliceSource(&file)),
            report.ok,
            said,
        )
    };
    let (meshes, ok, said) = read(&nodes);
    assert!(ok, "{said:?}");
    assert_eq!(said.unwrap().count, 12);
    let of = |mesh: &ClusterMesh| -> Vec<([u32; 3], u8)> {
        let mut of: Vec<_> = mesh
            .positions
            .iter()
            .copied()
            .zip(mesh.ranks.iter().copied())
            .collect();
        of.sort_unstable();
        of
    };
    for (given, read) in nodes.iter().zip(&meshes) {
        assert_eq!(of(&given.mesh), of(read));
        assert_eq!(read.ranks.is_empty(), given.mesh.ranks.is_empty());
    }
    // Two children of one group that disagree; a rank beyond the last place; one rank too few.
    let mut torn = nodes.clone();
    torn[5].mesh.ranks[0] = 2;
    torn[6].mesh.positions[0] = torn[5].mesh.positions[0];
    torn[6].mesh.ranks[0] = 1;
    let mut beyond = nodes.clone();
    beyond[9].mesh.ranks[3] = 254;
    for (broken, child) in [(torn, "cluster 6"), (beyond, "cluster 9")] {
        let (_, ok, said) = read(&broken);
        let said = said.unwrap();
        assert!(!ok && !said.ok && said.failures.len() == 1, "{said:?}");
        assert!(said.failures[0].contains(child), "{said:?}");
    }
    let mut few = nodes;
    few[3].mesh.ranks.pop();
    assert!(written(&few).unwrap_err().to_string().contains("ranks"));
}

#[test]
fn the_order_that_they_are_given_in_makes_no_difference() {
    let nodes = grouped_clusters(10, true);
    let file = written(&nodes).unwrap();
    let mut random = Random(5);
    for _ in 0..20 {
        assert_eq!(written(&shuffled(&nodes, &mut random)).unwrap(), file);
    }
}

#[test]
fn random_groups_survive() {
    let mut random = Random(77);
    let mut largest = 0;
    for round in 0..60 {
        let groups = 1 + random.below(30);
        let given = random_groups(&mut random, groups);
        let file = match written(&shuffled(&given, &mut random)) {
            Ok(file) => file,
            Err(Error::Input { rule, .. }) => {
                assert_eq!(rule, "clusters are in at most 32 levels");
                continue;
            }
            Err(error) => panic!("{error}"),
        };
        assert!(verify(&SliceSource(&file)).unwrap().ok);
        let document = open(&file);
        let clusters = document.clusters.as_ref().unwrap();
        assert_eq!(clusters.nodes.len(), given.len());
        // From the root down, groups in the file against lists that are given.
        let mut given_of = vec![0; given.len()];
        let mut groups: Vec<&ClusterGroup> = clusters.groups.iter().collect();
        groups.sort_by_key(|group| group.children.start);
        for group in groups {
            let first = &given[given_of[group.members[0].0 as usize]];
            assert_eq!(group.children.len(), first.children.len());
            for member in &group.members {
                let node = &given[given_of[member.0 as usize]];
                assert_eq!(node.children, first.children);
            }
            let with = given.iter().filter(|node| node.children == first.children);
            assert_eq!(with.count(), group.members.len());
            for (child, &of) in group.children.clone().zip(&first.children) {
                given_of[child as usize] = of as usize;
            }
            largest = largest.max(group.members.len());
        }
        given_of.sort_unstable();
        assert!(given_of.into_iter().eq(0..given.len()), "round {round}");
    }
    assert!(largest > 2);
}

#[test]
fn trees_say_nothing_of_groups() {
    let byte_33 = |nodes: &[ClusterInput]| {
        let file = written(nodes).unwrap();
        let parts = assemble::Parts::of(&file);
        let section = parts.sections.iter().find(|part| part.kind == 17);
        section.unwrap().body[33]
    };
    assert_eq!(byte_33(&clusters(10, true)), 0);
    assert_eq!(byte_33(&grouped_clusters(10, true)), 4);
}

#[test]
fn broken_rules_are_refused() {
    fn refused(change: impl FnOnce(&mut Vec<ClusterInput>)) -> &'static str {
        let mut nodes = grouped_clusters(10, true);
        change(&mut nodes);
        match written(&nodes) {
            Err(Error::Input { rule, .. }) => rule,
            other => panic!("{other:?}"),
        }
    }
    let lists = "the children of two clusters are the same, in the same order, or all different";
    assert_eq!(refused(|n| n[1].children = vec![7, 6]), lists);
    assert_eq!(refused(|n| n[1].children = vec![8, 7]), lists);
    assert_eq!(refused(|n| n[1].children = vec![7, 8, 9]), lists);
    assert_eq!(refused(|n| n[5].children = vec![9, 9]), lists);
    let others = "children are clusters of the file other than the root";
    assert_eq!(refused(|n| n[5].children = vec![9, 13]), others);
    assert_eq!(refused(|n| n[5].children = vec![9, 0]), others);
    assert_eq!(refused(|n| n[5].children = vec![9, u32::MAX]), others);
    let number = "a cluster has no child or 2 to 65 535";
    assert_eq!(refused(|n| n[5].children = vec![9]), number);
    assert_eq!(
        refused(|n| n[5].children.clear()),
        "every cluster but the root is a child"
    );
    assert_eq!(
        refused(|n| n[4].error = 41_000.0),
        "clusters with the same children have the same error"
    );
    assert_eq!(
        refused(|n| n[7].error = f32::NAN),
        "clusters with the same children have the same error"
    );
    assert_eq!(
        refused(|n| n[8].error = 40_001.0),
        "errors never grow on the way down"
    );
    // 9 joins the group of 5, which it is a child of.
    assert_eq!(
        refused(|n| {
            n[9].children = n[5].children.clone();
            n[9].error = n[5].error;
        }),
        "no cluster is below itself"
    );
    let leaf = clusters(10, true)[6].clone();
    let deep = |levels: usize| {
        let mut nodes = vec![leaf.clone(); 2 * levels - 1];
        for level in 0..levels - 1 {
            let first = 2 * level as u32 + 1;
            nodes[2 * level].children = vec![first, first + 1];
        }
        written(&nodes)
    };
    assert!(verify(&SliceSource(&deep(32).unwrap())).unwrap().ok);
    assert!(matches!(
        deep(33),
        Err(Error::Input {
            rule: "clusters are in at most 32 levels",
            ..
        })
    ));
}
