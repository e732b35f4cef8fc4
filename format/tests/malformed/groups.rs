//! Faults of groups of clusters that have several members.

use super::super::support::{clusters, grouped_clusters, without_charts};
use super::super::{Case, changed};
use super::{change_facts, value};
use marquetry_format::Error;

/// Nodes of the file.
const NODES: usize = 13;
/// Places of the planes that say how many groups back, of the errors and of the sizes along x.
const BACK: usize = 21 * NODES;
const ERRORS: usize = 6 * NODES;
const SIZES: usize = 18 * NODES;

/// A file of clusters alone: of the groups {1, 4}, {2, 3}, {5} and {6, 7}, in this order.
pub(in super::super) fn file() -> Vec<u8> {
    let model = without_charts(10, true);
    model.write_with(&grouped_clusters(10, true)).unwrap()
}

fn with_facts(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    changed(&file(), |parts| {
        change_facts(parts.body(17), 24, change);
    })
}

/// 67 equal nodes, with two children each from the root on as far as they last: 33 levels.
fn too_deep() -> Vec<u8> {
    let mut nodes = vec![clusters(10, false)[6].clone(); 67];
    nodes[0].children = (1..67).collect();
    let model = without_charts(10, false);
    changed(&model.write_with(&nodes).unwrap(), |parts| {
        change_facts(parts.body(17), 21, |facts| {
            for (node, children) in facts.iter_mut().take(66).enumerate() {
                *children = if node == 0 || node % 2 == 1 { 2 } else { 0 };
            }
        });
    })
}

pub(super) fn cases() -> Vec<Case> {
    vec![
        (
            "cluster_group_too_far_back",
            with_facts(|f| f[BACK + 4] = 3),
            |e| value(e, "group of a cluster"),
        ),
        (
            "cluster_group_very_far_back",
            with_facts(|f| f[BACK + 2 * NODES + 4] = 0xff),
            |e| value(e, "group of a cluster"),
        ),
        (
            "cluster_joins_before_any_group",
            with_facts(|f| f[0] = 1),
            |e| value(e, "group of a cluster"),
        ),
        (
            "cluster_joins_the_root",
            with_facts(|f| f[BACK + 4] = 2),
            |e| value(e, "cluster without a parent"),
        ),
        (
            "cluster_leaf_with_a_group",
            with_facts(|f| f[BACK + 8] = 1),
            |e| value(e, "group of a cluster"),
        ),
        (
            "cluster_begins_a_group_far_back",
            with_facts(|f| f[BACK + NODES + 5] = 1),
            |e| value(e, "group of a cluster"),
        ),
        (
            "cluster_groups_without_their_planes",
            changed(&super::file(), |parts| {
                change_facts(parts.body(17), 21, |_| ());
                parts.body(17)[33] |= 4;
            }),
            |e| {
                matches!(
                    e,
                    Error::Truncated {
                        what: "clusters",
                        ..
                    }
                )
            },
        ),
        (
            "cluster_planes_of_groups_left_over",
            changed(&file(), |parts| {
                change_facts(parts.body(17), 24, |_| ());
                parts.body(17)[33] &= !4;
            }),
            |e| {
                matches!(
                    e,
                    Error::TrailingBytes {
                        what: "clusters",
                        ..
                    }
                )
            },
        ),
        (
            "cluster_below_itself",
            // 11, a child of 6 and 7, joins their group.
            with_facts(|f| f[11] = 1),
            |e| value(e, "cluster without a parent"),
        ),
        (
            "cluster_group_of_too_many_children",
            with_facts(|f| f[1] = 200),
            |e| value(e, "children of a cluster"),
        ),
        (
            "cluster_error_is_not_its_groups",
            with_facts(|f| f[ERRORS + 4] ^= 2),
            |e| value(e, "cluster whose error is not its group's"),
        ),
        (
            "cluster_bounds_leave_a_second_members",
            with_facts(|f| f[SIZES + 3] = 0),
            |e| value(e, "cluster whose bounds leave its parent's"),
        ),
        ("clusters_in_33_levels", too_deep(), |e| {
            value(e, "level of a cluster")
        }),
    ]
}
