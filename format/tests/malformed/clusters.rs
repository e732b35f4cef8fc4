//! Faults of the cluster sections.

use super::support::assemble::Part;
use super::support::{clusters, without_charts};
use super::{Case, changed};
use marquetry_format::Error;

mod groups;

pub(super) use groups::file as grouped_file;

/// Nodes of the tree, bytes before the checksums and before the packed facts.
const NODES: usize = 7;
const HEAD: usize = 36;
const PACKED: usize = HEAD + 4 * NODES;

/// A file of clusters alone.
pub(super) fn file() -> Vec<u8> {
    let model = without_charts(10, true);
    model.write_with(&clusters(10, true)).unwrap()
}

/// The file with another tree section.
fn with_tree(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    changed(&file(), |parts| change(parts.body(17)))
}

/// The file with other facts, raw: planes of children, lengths (3), vertices, triangles, errors (2), shifts, minima (9),
/// sizes (3).
fn with_facts(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    with_tree(|tree| change_facts(tree, 21, change))
}

/// Changes the facts in a tree section, `planes` bytes a node.
fn change_facts(tree: &mut Vec<u8>, planes: usize, change: impl FnOnce(&mut Vec<u8>)) {
    let word = |at: usize| u32::from_le_bytes(tree[at..at + 4].try_into().unwrap()) as usize;
    let (nodes, length) = (word(0), word(4));
    let start = HEAD + 4 * nodes;
    let packed = &tree[start..start + length];
    let mut facts = match tree[32] {
        1 => packed.to_vec(),
        2 => {
            let frame = [&[0x28, 0xb5, 0x2f, 0xfd], packed].concat();
            zstd::bulk::decompress(&frame, planes * nodes).unwrap()
        }
        method => panic!("method {method}"),
    };
    assert_eq!(facts.len(), planes * nodes);
    change(&mut facts);
    tree[32] = 1;
    tree[4..8].copy_from_slice(&(facts.len() as u32).to_le_bytes());
    tree.splice(start..start + length, facts);
}

/// The file with another mesh of the root, whose checksum is right.
fn with_root(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    changed(&file(), |parts| {
        let tree = parts.body(17).clone();
        let start = PACKED + u32::from_le_bytes(tree[4..8].try_into().unwrap()) as usize;
        let mut root = tree[start..].to_vec();
        let before = root.len();
        change(&mut root);
        let checksum = (parts.checksum(&root) as u32).to_le_bytes();
        let body = parts.body(17);
        body.truncate(start);
        // What the root has more or less of, the geometry has.
        let geometry = u64::from_le_bytes(body[8..16].try_into().unwrap());
        let geometry = geometry + root.len() as u64 - before as u64;
        body[8..16].copy_from_slice(&geometry.to_le_bytes());
        body[HEAD..HEAD + 4].copy_from_slice(&checksum);
        body.extend(root);
    })
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = sections();
    cases.extend(tree());
    cases.extend(root());
    cases.extend(groups::cases());
    cases
}

fn sections() -> Vec<Case> {
    vec![
        (
            "neither_charts_nor_clusters",
            changed(&file(), |parts| {
                parts
                    .sections
                    .retain(|part| part.kind != 17 && part.kind != 22);
            }),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "number of charts",
                        found: 0
                    }
                )
            },
        ),
        (
            "clusters_without_their_pages",
            changed(&file(), |parts| {
                parts.sections.retain(|part| part.kind != 22);
            }),
            |e| matches!(e, Error::MissingSection { kind: 22 }),
        ),
        (
            "cluster_pages_without_a_tree",
            changed(&file(), |parts| {
                parts.sections.retain(|part| part.kind != 17);
            }),
            |e| matches!(e, Error::MissingSection { kind: 17 }),
        ),
        (
            "clusters_behind_the_front",
            changed(&file(), |parts| {
                let tree = parts.sections.remove(3);
                parts.sections.push(tree);
            }),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        kind: 17,
                        fault: "does not lie in the front",
                        ..
                    }
                )
            },
        ),
        (
            "clusters_twice",
            changed(&file(), |parts| {
                parts.sections.push(Part {
                    kind: 22,
                    flags: 1,
                    body: Vec::new(),
                });
            }),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        kind: 22,
                        fault: "is there twice",
                        ..
                    }
                )
            },
        ),
    ]
}

fn value(e: &Error, expected: &str) -> bool {
    matches!(e, Error::Value { what, .. } if *what == expected)
}

fn tree() -> Vec<Case> {
    vec![
        ("no_clusters", with_tree(|t| t[..4].fill(0)), |e| {
            value(e, "number of clusters")
        }),
        ("too_many_clusters", with_tree(|t| t[..4].fill(0xff)), |e| {
            matches!(
                e,
                Error::Limit {
                    what: "clusters",
                    found: 0xffff_ffff,
                    ..
                }
            )
        }),
        ("clusters_reserved", with_tree(|t| t[34] = 1), |e| {
            matches!(
                e,
                Error::Reserved {
                    what: "clusters",
                    value: 0x100
                }
            )
        }),
        ("clusters_planes_8", with_tree(|t| t[33] = 8), |e| {
            matches!(
                e,
                Error::Reserved {
                    what: "clusters",
                    value: 8
                }
            )
        }),
        ("clusters_method_3", with_tree(|t| t[32] = 3), |e| {
            value(e, "clusters")
        }),
        ("clusters_cut_short", with_tree(|t| t.truncate(50)), |e| {
            matches!(
                e,
                Error::Truncated {
                    what: "clusters",
                    ..
                }
            )
        }),
        (
            "cluster_facts_cut_short",
            with_facts(|f| f.truncate(f.len() - 1)),
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
            "cluster_parts_do_not_add_up",
            with_tree(|t| t[8] ^= 1),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "bytes of all clusters",
                        ..
                    }
                )
            },
        ),
        ("cluster_with_one_child", with_facts(|f| f[6] = 1), |e| {
            value(e, "children of a cluster")
        }),
        (
            "cluster_children_beyond_the_last",
            with_facts(|f| f[6] = 2),
            |e| value(e, "children of a cluster"),
        ),
        ("cluster_without_a_parent", with_facts(|f| f[0] = 0), |e| {
            value(e, "cluster without a parent")
        }),
        (
            "cluster_children_left_over",
            with_facts(|f| f[2] = 0),
            |e| value(e, "cluster without a parent"),
        ),
        (
            "cluster_of_two_vertices",
            with_facts(|f| f[4 * NODES + 3] = 1),
            |e| value(e, "vertices of a cluster"),
        ),
        (
            "cluster_error_above_its_parents",
            // The first child's difference to the root.
            with_facts(|f| {
                f[6 * NODES + 1] = 2;
                f[7 * NODES + 1] = 0;
            }),
            |e| value(e, "cluster whose error is above its parent's"),
        ),
        (
            "cluster_bounds_shift_21",
            with_facts(|f| f[8 * NODES + 2] = 21),
            |e| value(e, "bounds shift of a cluster"),
        ),
        (
            "cluster_bounds_below_zero",
            with_facts(|f| {
                f[9 * NODES] = 1;
                f[12 * NODES] = 0;
                f[15 * NODES] = 0;
            }),
            |e| value(e, "bounds of a cluster"),
        ),
        (
            "cluster_bounds_leave_its_parents",
            with_facts(|f| f[20 * NODES] = 0),
            |e| value(e, "cluster whose bounds leave its parent's"),
        ),
        (
            "cluster_pages_do_not_add_up",
            with_facts(|f| f[NODES + 6] ^= 1),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "end of the clusters",
                        ..
                    }
                )
            },
        ),
        (
            "cluster_page_too_long",
            with_facts(|f| f[3 * NODES + 6] = 0xff),
            |e| {
                matches!(
                    e,
                    Error::Limit {
                        what: "bytes of a cluster",
                        ..
                    }
                )
            },
        ),
        (
            "cluster_root_in_the_pages",
            with_facts(|f| f[NODES] = 1),
            |e| value(e, "length of the root cluster"),
        ),
    ]
}

fn root() -> Vec<Case> {
    /// The first bytes of a key frame of 256 x 256 texels, which is all that a mesh looks at.
    const FRAME: [u8; 11] = [0, 0, 0, 0x9d, 0x01, 0x2a, 0, 1, 0, 1, 7];
    vec![
        (
            "cluster_checksum",
            changed(&file(), |parts| *parts.body(17).last_mut().unwrap() ^= 1),
            |e| {
                matches!(
                    e,
                    Error::Checksum {
                        what: "cluster",
                        ..
                    }
                )
            },
        ),
        ("cluster_reserved_bits", with_root(|r| r[0] |= 32), |e| {
            matches!(
                e,
                Error::Reserved {
                    what: "cluster",
                    ..
                }
            )
        }),
        (
            "cluster_texture_unannounced",
            with_root(|r| {
                let length = r.len() - 1;
                assert!(length < 128);
                r[0] |= 4;
                r.insert(1, length as u8);
                // Places are whatever comes after the last byte.
                r.extend(FRAME);
            }),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "texture of a cluster",
                        found: 1
                    }
                )
            },
        ),
        ("cluster_trailing_byte", with_root(|r| r.push(0)), |e| {
            matches!(
                e,
                Error::TrailingBytes {
                    what: "cluster",
                    ..
                }
            )
        }),
    ]
}
