//! What a frame costs on the processor while everything is in memory and the camera moves: `cargo bench -p marquetry-engine --bench update`.
//!
//! Some 16 000 made-up clusters are visited, unless `MARQUETRY_BENCH_FILE` names a file, which is seen from 1.2 radii.

#![allow(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]
#![expect(clippy::unwrap_used, reason = "a bench that cannot go on ends here")]

use criterion::{Criterion, criterion_group, criterion_main};
use marquetry_engine::testing::clustered;
use marquetry_engine::{Camera, Transition, Viewer, ViewerOptions, Viewport};
use marquetry_format::{ByteSource, Document, Limits};
use std::hint::black_box;

/// Makes 16 002 nodes: devices have room for a few more.
const TETRAHEDRA: u32 = 120_000;
const VIEWPORT: Viewport = Viewport {
    width: 1280,
    height: 720,
};
/// Of the distance, from frame to frame.
const STEP: f64 = 1e-4;
/// The same where levels of a file change in more of the frames.
const FAST: f64 = 1e-2;

fn open() -> (Document, Vec<u8>, f64, f64) {
    if let Some(path) = std::env::var_os("MARQUETRY_BENCH_FILE") {
        let bytes = std::fs::read(path).unwrap();
        let mut document = Document::open(&bytes, Limits::default()).unwrap();
        document.load_index(&bytes).unwrap();
        return (document, bytes, 1.2, 1.0);
    }
    let (document, bytes) = clustered(TETRAHEDRA).unwrap();
    // Fine enough for every leaf.
    (document, bytes, 2.5, 0.01)
}

/// A viewer that has all it wants.
fn settled(transition: Transition) -> (Viewer, f64) {
    let (document, bytes, radii, error_px) = open();
    let options = ViewerOptions {
        error_px,
        transition,
        cache_bytes: 4 << 30,
        ..ViewerOptions::default()
    };
    let mut viewer = Viewer::new(document, options).unwrap();
    let camera = Camera::standard(&viewer.document().metadata, 0, radii).unwrap();
    viewer.set_camera(camera);
    while !viewer.is_settled() {
        for request in viewer.update(0.1, VIEWPORT) {
            let answer = bytes.read(request.range.clone()).unwrap();
            viewer.deliver(request.id, Ok(answer));
        }
    }
    (viewer, radii)
}

fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(20);
    for transition in [Transition::None, Transition::Geomorph] {
        for (what, step) in [("moving", STEP), ("fast", FAST)] {
            let (mut viewer, radii) = settled(transition);
            let stats = viewer.stats();
            let visited = viewer.document().clusters.as_ref().unwrap().nodes.len();
            eprintln!(
                "{visited} nodes, of which {} are drawn with {} triangles",
                stats.nodes, stats.triangles
            );
            let metadata = viewer.document().metadata.clone();
            let (mut frame, mut changes) = (0u32, 0u32);
            let mut drawn = stats.nodes;
            group.bench_function(format!("{what}, {}", transition.name()), |bencher| {
                bencher.iter(|| {
                    frame += 1;
                    // There and back, so that it stays where it is.
                    let phase = f64::from(frame % 200);
                    let away = 1.0 + step * phase.min(200.0 - phase);
                    let camera = Camera::standard(&metadata, 0, radii * away).unwrap();
                    viewer.set_camera(camera);
                    black_box(viewer.update(1.0 / 60.0, VIEWPORT).len());
                    let before = std::mem::replace(&mut drawn, viewer.stats().nodes);
                    changes += u32::from(drawn != before);
                });
            });
            eprintln!("{changes} of {frame} frames drew more or fewer nodes than the one before");
        }
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
