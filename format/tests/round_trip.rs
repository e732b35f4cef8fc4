//! What is written is what is read, for every kind of glue.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::too_many_lines,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::verify::verify;
use marquetry_format::writer::{ChartInput, NodeInput, write_atlas};
use marquetry_format::*;
use proptest::prelude::*;
use support::*;

/// The nodes of `charts` in page order.
fn in_page_order(charts: &[ChartInput]) -> Vec<&NodeInput> {
    let mut nodes: Vec<&NodeInput> = charts.iter().map(|chart| &chart.root).collect();
    let mut next = 0;
    while let Some(node) = nodes.get(next) {
        nodes.extend(node.children.iter().flat_map(|children| children.iter()));
        next += 1;
    }
    nodes
}

/// Writes, verifies, reads and compares; gives the file.
fn check(model: &Model<'_>) -> Vec<u8> {
    let bytes = model.write().unwrap();
    let report = verify(&SliceSource(&bytes)).unwrap();
    for check in &report.checks {
        assert!(check.ok, "{}: {:#?}", check.name, check.failures);
        let between_nodes = [
            "glue both ways",
            "shared borders bit-equal",
            "balance across borders",
        ];
        let needed = model.glue.iter().flatten().any(Option::is_some)
            || !between_nodes.contains(&&*check.name);
        assert!(check.count > 0 || !needed, "{} checked nothing", check.name);
    }
    assert!(report.ok);

    let document = open(&bytes);
    assert_eq!(document.metadata, model.metadata());
    let charts = model.charts();
    let nodes = in_page_order(&charts);
    let pages = decode_all(&document, &SliceSource(&bytes));
    assert_eq!(pages.len(), nodes.len());
    for (page, (decoded, node)) in (0u32..).map(PageId).zip(pages.iter().zip(&nodes)) {
        assert_eq!(decoded.resolution, node.samples.resolution);
        assert_eq!(decoded.positions, node.samples.positions);
        assert_eq!(decoded.normals, node.samples.normals);
        assert_eq!(decoded.colours, node.samples.colours);
        assert_eq!(decoded.position_targets.len(), decoded.positions.len());
        assert_eq!(decoded.normal_targets.len(), decoded.normals.len());
        assert_eq!(decoded.colour_targets.len(), decoded.colours.len());
        let entry = document.page(page).unwrap();
        assert_eq!(entry.has_children, node.children.is_some());
        for (coded, given) in entry.errors.iter().zip(&node.errors) {
            assert!(coded >= given && *coded <= given * 1.001);
        }
        let id = document.node_of_page(page).unwrap();
        assert_eq!(document.page_of_node(id), Some(page));
    }
    for (chart, (given, read)) in charts.iter().zip(&document.charts).enumerate() {
        assert_eq!(given.glue, read.glue);
        assert_eq!(given.root.samples.resolution, read.resolution);
        let root = &document.page(PageId(chart as u32)).unwrap().errors;
        assert!(root.starts_with(&read.base_errors));
        assert_eq!(
            read.base_errors.len(),
            usize::from(read.resolution.min(document.base_resolution)) + 1
        );
        let base = &document.base[chart];
        let step = 1 << (read.resolution - base.resolution);
        for j in 0..base.side() {
            for i in 0..base.side() {
                let fine = j * step * given.root.samples.side() + i * step;
                assert_eq!(
                    base.positions[j * base.side() + i],
                    given.root.samples.positions[fine]
                );
                assert_eq!(
                    base.normals[j * base.side() + i],
                    given.root.samples.normals[fine]
                );
            }
        }
    }
    let parts = document.bytes_by_part();
    assert_eq!(parts.total, bytes.len() as u64);
    bytes
}

#[test]
fn cube_sphere_at_mixed_levels_survives() {
    // Chart 0 two levels deep, its neighbours one, chart 2 across from it none.
    let split =
        |node: NodeId| node.level == 0 && node.chart.0 != 2 || node.level == 1 && node.chart.0 == 0;
    for (shift, has_colours) in [(0, false), (5, true)] {
        let model = Model {
            glue: cube_glue(),
            surface: &cube_sphere,
            resolution: &|_| 5,
            split: &split,
            shift,
            has_colours,
        };
        check(&model);
    }
}

#[test]
fn cube_glue_uses_many_pairs_of_sides() {
    let mut pairs: Vec<(u8, u8)> = Vec::new();
    for glue in cube_glue() {
        pairs.extend(
            (0u8..)
                .zip(glue)
                .map(|(side, glue)| (side, glue.unwrap().side.0)),
        );
    }
    pairs.sort_unstable();
    pairs.dedup();
    assert!(pairs.len() >= 8, "{pairs:?}");
}

#[test]
fn roots_may_stop_at_different_resolutions() {
    let model = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|chart| if chart % 2 == 0 { 3 } else { 4 },
        split: &never,
        shift: 3,
        has_colours: true,
    };
    check(&model);
    for resolution in 0..=5 {
        check(&Model {
            resolution: &|_| resolution,
            glue: cube_glue(),
            ..model
        });
    }
}

#[test]
fn torus_glued_to_itself_survives() {
    let split = |node: NodeId| node.level < 2;
    check(&Model {
        glue: torus_glue(),
        surface: &torus,
        resolution: &|_| 5,
        split: &split,
        shift: 4,
        has_colours: false,
    });
}

#[test]
fn moebius_strip_survives() {
    let split = |node: NodeId| node.level < 1;
    check(&Model {
        glue: moebius_glue(),
        surface: &moebius,
        resolution: &|_| 5,
        split: &split,
        shift: 6,
        has_colours: true,
    });
}

#[test]
fn open_borders_survive() {
    let split = |node: NodeId| node.level == 0 && node.chart.0 == 1;
    check(&Model {
        glue: strip_glue(),
        surface: &strip,
        resolution: &|_| 5,
        split: &split,
        shift: 7,
        has_colours: false,
    });
}

#[test]
fn many_pages_fill_several_index_blocks() {
    // 4^5 · 4 / 3 pages: blocks 0 and 1; children of block 0's parents lie in both.
    let flat = |_, u: f64, v: f64| ([u, v, 0.5], [0.0, 0.0, 1.0], [0; 3]);
    let split = |node: NodeId| node.level < 5;
    let bytes = check(&Model {
        glue: vec![[None; 4]],
        surface: &flat,
        resolution: &|_| 5,
        split: &split,
        shift: 8,
        has_colours: false,
    });
    let document = open(&bytes);
    assert_eq!(document.page_count(), 1365);
    assert_eq!(document.index_block_count(), 2);
    let index = document.bytes_by_part().index;
    assert!(index <= 24 * 1365, "{index} bytes of index");
}

#[test]
fn front_fits_the_first_image() {
    // 600 charts: too many for resolution 5, few enough for a lower one.
    let glue = vec![[None; 4]; 600];
    let rough = |chart: usize, u: f64, v: f64| {
        let z = 0.5 + 0.4 * (311.0 * u + chart as f64).sin() * (277.0 * v).cos();
        let (x, y) = ((chart % 25) as f64, (chart / 25) as f64);
        (
            [(x + u) / 25.0, (y + v) / 25.0, z],
            [u as f32, v as f32, 1.0],
            [0; 3],
        )
    };
    let model = Model {
        glue,
        surface: &rough,
        resolution: &|_| 5,
        split: &never,
        shift: 5,
        has_colours: false,
    };
    let bytes = model.write().unwrap();
    let document = open(&bytes);
    assert!((1..5).contains(&document.base_resolution));
    assert!(document.front_bytes() <= 256 * 1024);
    assert!(verify(&SliceSource(&bytes)).unwrap().ok);

    let (opening, range) = Opening::new(Limits::default());
    assert_eq!(range, 0..65_536);
    let Step::Need(opening, range) = opening.feed(&bytes[..65_536]).unwrap() else {
        panic!("the front is longer than the first read")
    };
    assert_eq!(range, 65_536..document.front_bytes());
    let rest = &bytes[65_536..document.front_bytes() as usize];
    let Step::Done(opened) = opening.feed(rest).unwrap() else {
        panic!("a third read was asked for")
    };
    assert_eq!(opened.base, document.base);
}

#[test]
fn same_bytes_for_any_thread_count() {
    let model = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|_| 5,
        split: &|node| node.level == 0,
        shift: 4,
        has_colours: true,
    };
    let (metadata, lattice, charts) = (model.metadata(), model.lattice(), model.charts());
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut out = Vec::new();
            write_atlas(&metadata, &lattice, &charts, &mut out).unwrap();
            out
        })
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn smooth_pages_are_small() {
    let bytes = check(&Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|_| 5,
        split: &|node| node.level < 2,
        shift: 8,
        has_colours: false,
    });
    let document = open(&bytes);
    let samples = 800.0 * f64::from(document.page_count());
    let parts = document.bytes_by_part();
    let (geometry, normals) = (
        parts.geometry as f64 / samples,
        parts.normals as f64 / samples,
    );
    println!("{geometry:.3} bytes of geometry and {normals:.3} of normals a new sample");
    assert!(geometry < 1.5 && normals < 1.5, "{geometry} and {normals}");
}

/// A model whose input breaks a rule after `damage`; gives the rule.
fn refused(damage: impl FnOnce(&mut Vec<ChartInput>)) -> &'static str {
    let split = |node: NodeId| node.level == 0 && node.chart.0 == 0;
    let model = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|_| 5,
        split: &split,
        shift: 4,
        has_colours: true,
    };
    let mut charts = model.charts();
    damage(&mut charts);
    let mut out = Vec::new();
    let written = write_atlas(&model.metadata(), &model.lattice(), &charts, &mut out);
    assert!(out.is_empty(), "something was written");
    match written {
        Err(Error::Input { rule, .. }) => rule,
        other => panic!("{other:?}"),
    }
}

#[test]
fn writer_refuses_broken_input() {
    assert_eq!(refused(Vec::clear), "a file has a chart or a cluster");
    assert_eq!(
        refused(|c| c[1].glue[0] = glued(9, 0, true)),
        "glue names a side of a chart of the file"
    );
    assert_eq!(refused(|c| c[1].glue[2] = None), "glue goes both ways");
    assert_eq!(
        refused(|c| c[1].root.samples.positions[40][0] |= 1),
        "positions are multiples of 2^shift below 2^21"
    );
    assert_eq!(
        refused(|c| c[1].root.samples.positions[40][0] = 1 << 21),
        "positions are multiples of 2^shift below 2^21"
    );
    assert_eq!(
        refused(|c| c[2].root.samples.positions[3][0] ^= 16),
        "shared borders are equal on both sides"
    );
    assert_eq!(
        refused(|c| c[2].root.samples.normals[0][0] ^= 1),
        "shared borders are equal on both sides"
    );
    assert_eq!(
        refused(|c| c[2].root.samples.colours[5][2] ^= 1),
        "shared borders are equal on both sides"
    );
    assert_eq!(
        refused(|c| c[0].root.children.as_mut().unwrap()[1].samples.positions[2][1] ^= 16),
        "a child repeats its parent's positions"
    );
    assert_eq!(
        refused(|c| c[0].root.children.as_mut().unwrap()[1].errors[0] = 1e9),
        "errors never grow on the way down"
    );
    assert_eq!(
        refused(|c| c[3].root.errors[2] = 1e9),
        "errors never grow on the way down"
    );
    assert_eq!(
        refused(|c| c[3].root.errors[5] = f32::NAN),
        "an error is a finite length, not below zero"
    );
    assert_eq!(
        refused(|c| c[3].root.errors.push(0.0)),
        "a root has an error a resolution, every other node one"
    );
    assert_eq!(
        refused(|c| c[3].root.samples.colours.truncate(7)),
        "a node has (2^resolution + 1)^2 samples"
    );
    assert_eq!(
        refused(|c| c[0].root.samples.resolution = 6),
        "only nodes at resolution 5 above the deepest level have children"
    );
}

#[test]
fn writer_refuses_unbalanced_trees() {
    let model = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|chart| if chart == 4 { 3 } else { 5 },
        split: &never,
        shift: 4,
        has_colours: false,
    };
    let refused = |model: &Model<'_>| match model.write() {
        Err(Error::Input { rule, .. }) => rule,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(&model), "the trees are balanced across borders");
    let split = |node: NodeId| node.chart.0 == 4 && node.level < 2;
    let model = Model {
        resolution: &|_| 5,
        split: &split,
        ..model
    };
    assert_eq!(refused(&model), "the trees are balanced across borders");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_samples_survive(
        resolution in 0u8..=5, shift in 0u8..=15, noise in any::<u64>(), split: bool, has_colours: bool
    ) {
        // Values that no prediction fits.
        let surface = |_: usize, u: f64, v: f64| {
            let hash = |k: u64| {
                let mut h = noise ^ u.to_bits().rotate_left(17) ^ v.to_bits().wrapping_mul(k);
                h = (h ^ h >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11
            };
            let unit = |k| hash(k) as f64 / (1u64 << 53) as f64;
            let normal = [unit(3) as f32 - 0.5, unit(5) as f32 - 0.5, unit(7) as f32 - 0.5];
            ([unit(9), unit(11), unit(13)], normal, [hash(15) as u8, hash(17) as u8, hash(19) as u8])
        };
        check(&Model {
            glue: vec![[None; 4]],
            surface: &surface,
            resolution: &|_| resolution,
            split: &|node| split && resolution == 5 && node.level == 0,
            shift,
            has_colours,
        });
    }
}

#[test]
fn clusters_survive_with_and_without_charts() {
    for (charts, has_colours, shift) in [(2, true, 3), (0, true, 10), (0, false, 0), (2, false, 9)]
    {
        let model = Model {
            glue: strip_glue().into_iter().take(charts).collect(),
            surface: &strip,
            resolution: &|_| 5,
            split: &|node| node.level == 0,
            shift,
            has_colours,
        };
        let nodes = clusters(shift, has_colours);
        let file = model.write_with(&nodes).unwrap();
        let source = SliceSource(&file);
        let report = verify(&source).unwrap();
        assert!(report.ok, "{report:#?}");
        let document = open(&file);
        assert_eq!(document.charts.len(), charts);
        let tree = document.clusters.as_ref().unwrap();
        assert_eq!(tree.leaf_triangles(), 4 * 5 * 4);
        let meshes = decode_clusters(&document, &source);
        assert_eq!(tree.root, meshes[0]);
        assert_eq!(meshes.len(), nodes.len());
        for ((given, read), (id, node)) in nodes.iter().zip(&meshes).zip((0..).zip(&tree.nodes)) {
            let triangles = |mesh: &ClusterMesh| {
                let colour = |v: usize| mesh.colours.get(v).copied();
                triangles_of(mesh, |v| (mesh.positions[v], mesh.normals[v], colour(v)))
            };
            assert_eq!(triangles(&given.mesh), triangles(read));
            assert!(node.error >= given.error && node.error <= given.error * 1.001);
            assert_eq!(node.children.len(), given.children.len());
            for child in node.children.clone() {
                assert_eq!(tree.nodes[child as usize].parent, Some(ClusterId(id)));
            }
            // A cluster's page is fetched as any other; the root's mesh is in the front.
            let page = document.page_of_cluster(ClusterId(id));
            assert_eq!(page.is_none(), id == 0);
            if let Some(page) = page {
                assert_eq!(document.cluster_of_page(page), Some(ClusterId(id)));
                assert_eq!(document.page_range(page), Some(node.range.clone()));
                let bytes = source.read(node.range.clone()).unwrap();
                document.check_page(page, &bytes).unwrap();
            } else {
                assert!(node.range.end <= document.front_bytes());
            }
        }
        let (first, last) = (document.page_count(), document.stored_page_count() - 1);
        let all = document
            .page_range_bytes(PageId(first), PageId(last))
            .unwrap();
        assert_eq!(all.end, file.len() as u64);
        if let Some(before) = first.checked_sub(1) {
            // Side by side with the last page of the atlas.
            let both = document
                .page_range_bytes(PageId(before), PageId(first))
                .unwrap();
            assert_eq!(both.end, tree.nodes[1].range.end);
        }
        assert!(document.page_range(PageId(last + 1)).is_none());
    }
}

#[test]
fn a_cluster_of_many_children_survives() {
    let tree = clusters(4, false);
    for count in [255u16, 256, 1000] {
        let mut nodes = vec![tree[6].clone(); usize::from(count) + 1];
        nodes[0] = tree[0].clone();
        nodes[0].children = (1..=u32::from(count)).collect();
        let model = without_charts(4, false);
        let file = model.write_with(&nodes).unwrap();
        assert!(verify(&SliceSource(&file)).unwrap().ok);
        let document = open(&file);
        let tree = document.clusters.as_ref().unwrap();
        assert_eq!(tree.nodes[0].children.len(), usize::from(count));
        assert_eq!(
            decode_clusters(&document, &SliceSource(&file)).len(),
            nodes.len()
        );
    }
}

#[test]
fn clusters_that_break_a_rule_are_not_written() {
    let model = without_charts(4, false);
    let refused = |change: &dyn Fn(&mut Vec<writer::ClusterInput>)| {
        let mut nodes = clusters(4, false);
        change(&mut nodes);
        matches!(model.write_with(&nodes), Err(Error::Input { .. }))
    };
    assert!(!refused(&|_| ()));
    assert!(refused(&|nodes| nodes[0].error = 1.0));
    assert!(refused(&|nodes| nodes[0].error = f32::NAN));
    assert!(refused(&|nodes| nodes[0].children.truncate(1)));
    assert!(refused(&|nodes| nodes[0].mesh.positions[3][1] += 1));
    assert!(refused(&|nodes| nodes[0].mesh.triangles[0] = [1, 1, 2]));
    assert!(refused(&|nodes| nodes[0].mesh.triangles[0] = [1, 2, 200]));
    assert!(refused(&|nodes| nodes[0].mesh.triangles.clear()));
    assert!(refused(
        &|nodes| nodes[0].mesh.triangles = vec![[0, 1, 2]; 257]
    ));
    assert!(refused(&|nodes| nodes[0].mesh.normals.truncate(3)));
    assert!(matches!(model.write(), Err(Error::Input { .. })));
}
