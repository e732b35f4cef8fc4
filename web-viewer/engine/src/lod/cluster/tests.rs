use super::*;
use crate::testing::{Random, Wall, clustered};
use std::collections::BTreeSet;

#[test]
fn restricted_cuts_cover_every_leaf_once() {
    let (document, _) = clustered(300).unwrap();
    let tree = document.clusters.as_ref().unwrap();
    let mut random = Random::new(21);
    for _ in 0..40 {
        let mut cut = Cut::coarsest(document.charts.len());
        refine(&document, &mut cut, |_, _, _| random.below(4) > 0);
        let pages: Vec<PageId> = needed(&document, &cut).iter().map(|n| n.page).collect();
        let there: BTreeSet<PageId> = pages
            .iter()
            .copied()
            .filter(|_| random.below(8) > 0)
            .collect();
        let wanted = cut.clone();
        restrict(&document, &mut cut, |page| there.contains(&page));
        let mut covered = vec![0; tree.nodes.len()];
        for id in drawn(&document, &cut) {
            assert!(
                document
                    .page_of_cluster(id)
                    .is_none_or(|page| there.contains(&page))
            );
            let mut below = vec![id.0];
            while let Some(node) = below.pop() {
                let children = tree.nodes[node as usize].children.clone();
                covered[node as usize] += i32::from(children.is_empty());
                below.extend(children);
            }
        }
        for (node, covered) in tree.nodes.iter().zip(covered) {
            assert_eq!(covered, i32::from(node.children.is_empty()));
        }
        assert!(triangles(&document, &cut) <= triangles(&document, &wanted));
        let everywhere = |_| true;
        let mut again = wanted.clone();
        restrict(&document, &mut again, everywhere);
        assert_eq!(again, wanted);
    }
}

#[test]
fn parents_come_before_children() {
    let (document, _) = clustered(300).unwrap();
    let mut cut = Cut::coarsest(document.charts.len());
    refine(&document, &mut cut, |_, _, _| true);
    let mut seen = BTreeSet::new();
    for needed in needed(&document, &cut) {
        assert!(needed.parent.is_none_or(|parent| seen.contains(&parent)));
        seen.insert(needed.page);
    }
    let below_root = document.clusters.as_ref().unwrap().nodes.len() - 1;
    assert_eq!(seen.len(), below_root);
}

#[test]
fn finest_mesh_holds_the_triangles_of_all_leaves() {
    let (document, source) = clustered(70).unwrap();
    let mut cut = Cut::coarsest(document.charts.len());
    refine(&document, &mut cut, |_, _, _| true);
    let mut builder = MeshBuilder::new(false);
    append(&document, &source, &Drawn::of(cut), &mut builder).unwrap();
    let leaves = document.clusters.as_ref().unwrap().leaf_triangles();
    assert_eq!(builder.finish().triangles.len() as u64, leaves);
    assert_eq!(leaves, 4 * 70);
}

/// Groups whose members are children of different groups.
fn mixed(document: &Document) -> usize {
    let clusters = document.clusters.as_ref().unwrap();
    let is_mixed = |group: &&ClusterGroup| {
        let parents = group
            .members
            .iter()
            .map(|id| clusters.node(*id).unwrap().parent);
        parents.collect::<BTreeSet<_>>().len() > 1
    };
    clusters.groups.iter().filter(is_mixed).count()
}

/// Clusters whose groups `cut` splits.
fn split(document: &Document, cut: &Cut) -> BTreeSet<ClusterId> {
    let all = (0..document.clusters.as_ref().unwrap().count()).map(ClusterId);
    all.filter(|id| cut.is_cluster_split(*id)).collect()
}

/// What holds of every cut: of a group all members are split, and reached, or none.
fn check(wall: &Wall, cut: &Cut) {
    let document = &wall.document;
    let clusters = document.clusters.as_ref().unwrap();
    let split = split(document, cut);
    for group in &clusters.groups {
        let members = group.members.iter();
        let count = members.clone().filter(|id| split.contains(id)).count();
        assert!(count == 0 || count == group.members.len());
        for id in members.filter(|_| count > 0) {
            let parent = clusters.node(*id).unwrap().parent;
            assert!(parent.is_none_or(|parent| split.contains(&parent)));
        }
    }
    wall.assert_whole(cut);
    let drawn: BTreeSet<ClusterId> = drawn(document, cut).into_iter().collect();
    assert!(drawn.is_disjoint(&split));
}

#[test]
fn cuts_through_groups_are_whole_whatever_is_asked_for() {
    let mut random = Random::new(31);
    let mut sizes = BTreeSet::new();
    for columns in [2, 3, 5, 16, 61, 128] {
        let wall = Wall::new(columns, None).unwrap();
        assert!(columns < 16 || mixed(&wall.document) > columns as usize / 32);
        for likely in [2, 3, 8, 40] {
            for _ in 0..12 {
                let mut cut = Cut::coarsest(wall.document.charts.len());
                refine(&wall.document, &mut cut, |_, _, _| random.below(likely) > 0);
                check(&wall, &cut);
                sizes.insert(drawn(&wall.document, &cut).len());
            }
        }
    }
    assert!(sizes.len() > 20);
}

#[test]
fn finer_thresholds_split_more_groups() {
    let wall = Wall::new(100, None).unwrap();
    let document = &wall.document;
    let nodes = &document.clusters.as_ref().unwrap().nodes;
    let mut errors: Vec<f32> = nodes.iter().map(|node| node.error).collect();
    errors.sort_by(f32::total_cmp);
    let mut before: Option<(BTreeSet<ClusterId>, u64)> = None;
    for threshold in errors.into_iter().rev().chain([-1.0]) {
        let mut cut = Cut::coarsest(document.charts.len());
        refine(document, &mut cut, |_, node, _| node.error > threshold);
        check(&wall, &cut);
        let is_leaf = |id: ClusterId| nodes[id.0 as usize].children.is_empty();
        for id in drawn(document, &cut) {
            // No group is held up by another.
            assert!(nodes[id.0 as usize].error <= threshold || is_leaf(id));
        }
        let now = (split(document, &cut), triangles(document, &cut));
        if let Some(before) = &before {
            assert!(before.0.is_subset(&now.0) && before.1 <= now.1);
        }
        before = Some(now);
    }
    assert_eq!(
        before.unwrap().1,
        document.clusters.as_ref().unwrap().leaf_triangles()
    );
}

#[test]
fn restricted_cuts_through_groups_use_what_is_there() {
    let mut random = Random::new(32);
    let (mut restricted, mut whole) = (0, 0);
    for round in 0..150 {
        let wall = Wall::new(20 + round, None).unwrap();
        let document = &wall.document;
        let mut wanted = Cut::coarsest(document.charts.len());
        refine(document, &mut wanted, |_, _, _| random.below(8) > 0);
        let pages: BTreeSet<PageId> = needed(document, &wanted).iter().map(|n| n.page).collect();
        let one_in = 2 + random.below(60);
        let there: BTreeSet<PageId> = pages
            .iter()
            .copied()
            .filter(|_| random.below(one_in) > 0)
            .collect();
        let mut cut = wanted.clone();
        restrict(document, &mut cut, |page| there.contains(&page));
        check(&wall, &cut);
        assert!(
            needed(document, &cut)
                .iter()
                .all(|n| there.contains(&n.page))
        );
        assert!(split(document, &cut).is_subset(&split(document, &wanted)));
        restricted += usize::from(cut != wanted);
        // With more that is there, no group is split less.
        let mut more = there.clone();
        more.extend(pages.iter().filter(|_| random.below(2) > 0));
        let mut finer = wanted.clone();
        restrict(document, &mut finer, |page| more.contains(&page));
        check(&wall, &finer);
        assert!(split(document, &cut).is_subset(&split(document, &finer)));
        whole += usize::from(finer == wanted);
        let mut again = wanted.clone();
        restrict(document, &mut again, |_| true);
        assert_eq!(again, wanted);
    }
    assert!(restricted > 50 && whole > 5, "{restricted}, {whole}");
}

#[test]
fn children_of_several_are_needed_once_and_after_all_of_these() {
    let wall = Wall::new(90, None).unwrap();
    let document = &wall.document;
    let clusters = document.clusters.as_ref().unwrap();
    let mut cut = Cut::coarsest(document.charts.len());
    refine(document, &mut cut, |_, _, _| true);
    let mut seen = BTreeSet::new();
    for needed in needed(document, &cut) {
        let id = document.cluster_of_page(needed.page).unwrap();
        assert_eq!(clusters.node(id).unwrap().parent, Some(needed.above));
        assert_eq!(needed.parent, document.page_of_cluster(needed.above));
        let group = clusters.node(needed.above).unwrap().group.unwrap();
        for &member in &clusters.group(group).unwrap().members {
            let page = document.page_of_cluster(member);
            assert!(page.is_none_or(|page| seen.contains(&page)));
        }
        assert!(seen.insert(needed.page));
    }
    assert_eq!(seen.len(), clusters.nodes.len() - 1);
}

#[test]
fn splits_of_groups_that_are_not_reached_are_not_drawn() {
    let wall = Wall::new(40, None).unwrap();
    let document = &wall.document;
    let clusters = document.clusters.as_ref().unwrap();
    for group in clusters.groups.iter().skip(1) {
        let mut cut = Cut::coarsest(document.charts.len());
        cut.split_group(group);
        assert_eq!(drawn(document, &cut), [ClusterId(0)]);
        cut.split_group(&clusters.groups[0]);
        wall.assert_whole(&cut);
    }
}

#[test]
fn budget_leaves_no_group_unsplit_that_fits() {
    use crate::lod::uniform::{Fineness, cut_triangles, uniform_cut};
    let wall = Wall::new(12, None).unwrap();
    let document = &wall.document;
    let of = |fineness| uniform_cut(document, fineness).unwrap();
    let all = cut_triangles(document, &of(Fineness::Finest));
    let mut with_rest = 0;
    for budget in 1..all {
        let cut = of(Fineness::Triangles(budget));
        wall.assert_whole(&cut);
        let drawn = cut_triangles(document, &cut);
        for group in splittable(document, &cut) {
            let mut finer = cut.clone();
            finer.split_group(group);
            assert!(cut_triangles(document, &finer) > budget);
        }
        let equal = of(Fineness::Error(error(document, &cut)));
        with_rest += usize::from(cut_triangles(document, &equal) < drawn);
    }
    assert!(with_rest > 0, "no budget had anything left over");
}
