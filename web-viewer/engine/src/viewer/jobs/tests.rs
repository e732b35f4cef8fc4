//! Decoding elsewhere: out of order, late, failed, for what nobody wants any more.

use super::super::tests::{Network, VIEWPORT, check};
use super::*;
use crate::numbers::NumberSet;
use crate::residency::page_table::Budget;
use crate::testing::{Random, Shape, clustered_with};
use crate::{Camera, ViewerOptions};

/// Somebody who works on a few jobs at a time, and finishes them in any order.
struct Workshop {
    jobs: Vec<DecodeJob>,
    random: Random,
    /// One in this many fails; 0 for none.
    faulty_one_in: u32,
    most: usize,
}

impl Workshop {
    fn new(seed: u64) -> Self {
        Self {
            jobs: Vec::new(),
            random: Random::new(seed),
            faulty_one_in: 0,
            most: 12,
        }
    }

    /// Takes jobs and finishes some.
    fn work(&mut self, viewer: &mut Viewer) {
        for kind in [JobKind::Image, JobKind::Mesh] {
            let most = self.most.saturating_sub(self.jobs.len());
            self.jobs.extend(viewer.take_jobs(kind, most));
        }
        for _ in 0..self.random.below(6) {
            self.finish_one(viewer);
        }
    }

    fn finish_one(&mut self, viewer: &mut Viewer) {
        if self.jobs.is_empty() {
            return;
        }
        let index = self.random.below(u32::try_from(self.jobs.len()).unwrap());
        let job = self.jobs.swap_remove(usize::try_from(index).unwrap());
        let fails = self.faulty_one_in > 0 && self.random.below(self.faulty_one_in) == 0;
        let result = if fails {
            job.fail("out of paper".to_owned())
        } else {
            job.run()
        };
        viewer.finish(result);
    }

    fn settle(&mut self, network: &mut Network, viewer: &mut Viewer) {
        for _ in 0..5000 {
            network.frame(viewer, 0.05);
            self.work(viewer);
            check(viewer);
            check_jobs(viewer);
            if viewer.is_settled() {
                return;
            }
        }
        panic!("does not settle: {:?}", viewer.stats());
    }
}

/// What is under way is bounded and known.
fn check_jobs(viewer: &Viewer) {
    let jobs = &viewer.jobs;
    for kind in [JobKind::Mesh, JobKind::Image] {
        let own = jobs
            .running
            .values()
            .filter(|job| job.subject.kind() == kind);
        assert_eq!(own.clone().count(), jobs.counts[kind as usize]);
        let bytes: u64 = own.map(|job| job.bytes).sum();
        assert_eq!(bytes, jobs.bytes[kind as usize]);
        assert!(bytes < MOST_BYTES_A_KIND + TEXTURE_BYTES);
    }
    assert!(jobs.finished.len() <= jobs.running.len());
}

fn elsewhere(network: &Network, cache_bytes: u64) -> Viewer {
    let mut viewer = network.viewer(ViewerOptions {
        cache_bytes,
        ..ViewerOptions::default()
    });
    viewer.set_decoding(Decoding::Elsewhere);
    viewer
}

fn standard(viewer: &Viewer, index: usize, radii: f64) -> Camera {
    Camera::standard(&viewer.document.metadata, index, radii).unwrap()
}

fn networks() -> [Network; 3] {
    let frame = include_bytes!("../../../../../format/tests/data/texture_16x24.vp8");
    [
        Network::new(Shape::Cube, 21),
        Network::textured(Shape::Cube, 22),
        Network::of(clustered_with(600, Some(frame)).unwrap().1, 23),
    ]
}

#[test]
fn settles_as_inline_does_whatever_the_order_and_the_faults() {
    for mut network in networks() {
        for cache_bytes in [300_000, 24 << 20] {
            let mut viewer = elsewhere(&network, cache_bytes);
            let mut workshop = Workshop::new(cache_bytes);
            workshop.faulty_one_in = 5;
            let mut here = network.viewer(viewer.options().clone());
            for (index, radii) in [(0, 1.0), (9, 0.7)] {
                let camera = standard(&viewer, index, radii);
                viewer.set_camera(camera);
                network.open.clear();
                workshop.settle(&mut network, &mut viewer);
                here.set_camera(camera);
                network.open.clear();
                network.settle(&mut here);
                assert_eq!(viewer.drawn().cut, here.drawn().cut);
            }
            assert!(!viewer.needs_update() && viewer.jobs_under_way() == 0);
            let [now, then] = [viewer.stats(), here.stats()];
            assert_eq!(now.pages.missing + now.tiles.missing, 0);
            assert!(cache_bytes < 1 << 20 || now.failures > then.failures);
        }
    }
}

#[test]
fn wandering_about_leaves_no_job_room_or_part_behind() {
    for mut network in networks() {
        let mut viewer = elsewhere(&network, 6 << 20);
        let mut workshop = Workshop::new(5);
        let mut dropped = false;
        for round in 0..21 {
            let camera = standard(&viewer, round % 26, 0.6 + 0.3 * (round % 5) as f64);
            viewer.set_camera(camera);
            for _ in 0..round % 7 {
                network.frame(&mut viewer, 0.016);
                workshop.work(&mut viewer);
                check(&viewer);
                check_jobs(&viewer);
            }
            dropped |= viewer.jobs.running.values().any(|job| match job.subject {
                Subject::Page(page) => viewer.needed_index.get(page.0).is_none(),
                Subject::Tile(_) | Subject::Texture(_) => false,
            });
        }
        // Far away nothing is wanted; what is under way comes back and is dropped.
        viewer.set_camera(standard(&viewer, 0, 5000.0));
        network.open.clear();
        workshop.settle(&mut network, &mut viewer);
        while !workshop.jobs.is_empty() {
            workshop.finish_one(&mut viewer);
        }
        viewer.update(0.05, VIEWPORT);
        assert_eq!(viewer.jobs_under_way(), 0);
        check_jobs(&viewer);
        viewer.set_camera(standard(&viewer, 0, 1.0));
        network.open.clear();
        workshop.settle(&mut network, &mut viewer);
        assert!(viewer.stats().pages.fetched > 0);
        assert!(dropped || viewer.stats().pages.fetched < 200);
    }
}

/// Streams until there is a job for a page with a parent: the viewer, the job, the page and its parent.
fn child_job(mut network: Network) -> Option<(Viewer, DecodeJob, PageId, PageId)> {
    let mut viewer = elsewhere(&network, 1 << 30);
    viewer.set_camera(Camera {
        eye: glam::DVec3::new(0.0, 0.0, 0.8),
        target: glam::DVec3::ZERO,
        up: glam::DVec3::Y,
    });
    for _ in 0..500 {
        network.frame(&mut viewer, 0.05);
        for job in viewer.take_jobs(JobKind::Mesh, 4) {
            let Some(Subject::Page(page)) = viewer.jobs.running.get(&job.id()).map(|j| j.subject)
            else {
                panic!("a mesh is a page");
            };
            let needed = viewer.needed_page(page).unwrap();
            match needed.parent {
                Some(parent) => return Some((viewer, job, page, parent)),
                None => viewer.finish(job.run()),
            }
        }
    }
    None
}

#[test]
fn a_parent_stays_while_its_child_is_decoded() {
    let mut found = 0;
    for network in networks() {
        let Some((mut viewer, job, page, parent)) = child_job(network) else {
            continue;
        };
        found += 1;
        // Whatever can go has to go, and that is not enough.
        let (used, nothing) = (viewer.table.used_bytes(), NumberSet::default());
        let budget = Budget {
            capacity_bytes: used,
            pinned: &nothing,
        };
        let other = PageId(u32::MAX);
        assert!(!viewer.table.reserve_samples(other, None, 0, used, budget));
        assert!(viewer.table.contains(parent) && !viewer.table.contains(page));
        viewer.finish(job.run());
        viewer.finish(job.run());
        viewer.take_in_finished();
        assert!(viewer.table.contains(page));
        assert!(viewer.table.used_bytes() <= used);
    }
    assert!(found > 0);
}

#[test]
fn unknown_results_are_ignored_and_uploads_are_bounded() {
    let mut network = Network::new(Shape::Cube, 25);
    let mut viewer = elsewhere(&network, 1 << 30);
    let limit = 50_000;
    viewer
        .set_options(ViewerOptions {
            upload_bytes_per_update: limit,
            ..viewer.options().clone()
        })
        .unwrap();
    let mut other = elsewhere(&network, 1 << 30);
    let mut workshop = Workshop::new(7);
    workshop.most = usize::MAX;
    let mut stranger = u64::MAX - 10_000;
    let mut uploads = 0;
    for _ in 0..200 {
        network.frame(&mut viewer, 0.05);
        let bytes: usize = viewer
            .table
            .take_uploads()
            .iter()
            .map(|upload| 16 * upload.positions.len() + 4 * upload.normals.len())
            .sum();
        if viewer.clock > 0.06 {
            // The base comes with the first.
            assert!((bytes as u64) < limit + 40_000, "{bytes}");
            uploads += bytes;
        }
        workshop.work(&mut viewer);
        for job in &workshop.jobs {
            other.finish(job.run());
            stranger += 1;
            let id = JobId(stranger);
            viewer.finish(DecodeJob { id, ..job.clone() }.run());
        }
        while !workshop.jobs.is_empty() {
            workshop.finish_one(&mut viewer);
        }
    }
    assert!(uploads > 300_000, "{uploads}");
    assert_eq!(other.stats().pages.fetched, 0);
    assert!(other.jobs.finished.is_empty());
}

#[test]
fn failures_of_what_nobody_wants_any_more_are_not_tried_again() {
    let mut network = Network::textured(Shape::Cube, 26);
    let mut viewer = elsewhere(&network, 24 << 20);
    let mut workshop = Workshop::new(8);
    let mut images = Vec::new();
    for index in [0, 9, 0, 9] {
        let camera = standard(&viewer, index, 0.4);
        viewer.set_camera(camera);
        for frame in 0..20 {
            network.frame(&mut viewer, 0.05);
            // A few of the finer ones are kept.
            let most = if frame < 10 { 0 } else { 40 };
            images.extend(viewer.take_jobs(JobKind::Image, most - images.len().min(most)));
            workshop.jobs.extend(viewer.take_jobs(JobKind::Image, 4));
            workshop.jobs.extend(viewer.take_jobs(JobKind::Mesh, 4));
            while !workshop.jobs.is_empty() {
                workshop.finish_one(&mut viewer);
            }
        }
    }
    assert!(images.len() > 10, "{}", images.len());
    let camera = standard(&viewer, 1, 60.0);
    viewer.set_camera(camera);
    workshop.settle(&mut network, &mut viewer);
    for job in images {
        viewer.finish(job.fail("out of paper".to_owned()));
    }
    // Nothing is planned anew.
    for _ in 0..3 {
        network.frame(&mut viewer, 0.05);
    }
    assert!(viewer.is_settled() && !viewer.colour_needs_update());
}
