//! Files of format version 1.0 decode to what they always did.
//!
//! `MARQUETRY_BLESS=1 cargo test -p marquetry-format --test golden` writes the files that are missing; files of
//! a released version are never written anew. Beside each file is what a reader must get from it; `SPEC.md`
//! says how the digest is computed.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::verify::verify;
use marquetry_format::*;
use std::path::PathBuf;
use support::*;

const NAMES: [&str; 11] = [
    "clusters_in_groups",
    "clusters_without_charts",
    "coloured_strip_with_clusters",
    "coloured_strip",
    "cube_of_mixed_resolutions",
    "moebius",
    "ranged_clusters",
    "ranked_clusters",
    "torus_with_children",
    "twinned_clusters",
    "walked_clusters",
];

fn model(name: &str) -> Vec<u8> {
    let plain = Model {
        glue: strip_glue(),
        surface: &strip,
        resolution: &|_| 2,
        split: &never,
        shift: 10,
        has_colours: true,
    };
    match name {
        "clusters_without_charts" => {
            let model = Model {
                glue: Vec::new(),
                has_colours: false,
                ..plain
            };
            return model.write_with(&clusters(10, false)).unwrap();
        }
        "clusters_in_groups" => {
            return plain.write_with(&grouped_clusters(10, true)).unwrap();
        }
        "ranked_clusters" => {
            return plain
                .write_with(&ranked(grouped_clusters(10, true)))
                .unwrap();
        }
        "twinned_clusters" => {
            return plain
                .write_with(&cut_apart(ranked(grouped_clusters(10, true))))
                .unwrap();
        }
        "walked_clusters" | "ranged_clusters" | "coloured_strip_with_clusters" => {
            return plain.write_with(&clusters(10, true)).unwrap();
        }
        "coloured_strip" => plain,
        "cube_of_mixed_resolutions" => Model {
            glue: cube_glue(),
            surface: &cube_sphere,
            resolution: &|chart| 2 + (chart as u8 & 1),
            has_colours: false,
            ..plain
        },
        "moebius" => Model {
            glue: moebius_glue(),
            surface: &moebius,
            resolution: &|_| 3,
            has_colours: false,
            ..plain
        },
        _ => Model {
            glue: torus_glue(),
            surface: &torus,
            resolution: &|_| 5,
            split: &|node| node.level == 0,
            shift: 13,
            has_colours: false,
        },
    }
    .write()
    .unwrap()
}

fn data(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "data", "v1", name]
        .iter()
        .collect()
}

/// What a reader must get, in words.
fn digest(bytes: &[u8]) -> String {
    let document = open(bytes);
    let mut hasher = blake3::Hasher::new();
    for page in decode_all(&document, &SliceSource(bytes)) {
        hasher.update(&[page.resolution]);
        for points in [&page.positions, &page.position_targets] {
            for coordinate in points.iter().flatten() {
                hasher.update(&coordinate.to_le_bytes());
            }
        }
        for normals in [&page.normals, &page.normal_targets] {
            hasher.update(normals.as_flattened());
        }
        for colours in [&page.colours, &page.colour_targets] {
            hasher.update(colours.as_flattened());
        }
    }
    // Files without clusters have the digests of before there were any.
    let clusters = document.clusters.as_ref().map_or_else(String::new, |tree| {
        format!("clusters {}\n", tree.nodes.len())
    });
    for mesh in decode_clusters(&document, &SliceSource(bytes)) {
        for coordinate in mesh.positions.iter().flatten() {
            hasher.update(&coordinate.to_le_bytes());
        }
        hasher.update(mesh.normals.as_flattened());
        hasher.update(mesh.colours.as_flattened());
        hasher.update(mesh.triangles.as_flattened());
        hasher.update(&mesh.ranks);
    }
    format!(
        "content id {}\ncharts {}\nbase resolution {}\npages {}\n{clusters}digest {}\n",
        document.content_id_hex(),
        document.charts.len(),
        document.base_resolution,
        document.page_count(),
        hasher.finalize().to_hex()
    )
}

#[test]
fn files_of_version_1_decode_as_ever() {
    for name in NAMES {
        let (file, expected) = (data(&format!("{name}.marq")), data(&format!("{name}.txt")));
        if std::env::var_os("MARQUETRY_BLESS").is_some() && !file.exists() {
            std::fs::create_dir_all(data("")).unwrap();
            let bytes = model(name);
            std::fs::write(&expected, digest(&bytes)).unwrap();
            std::fs::write(&file, bytes).unwrap();
        }
        let bytes = std::fs::read(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(
            digest(&bytes),
            std::fs::read_to_string(&expected).unwrap(),
            "{name}"
        );
        let report = verify(&SliceSource(&bytes)).unwrap();
        assert!(report.ok, "{name}: {report:#?}");
    }
}

#[test]
fn files_are_read_from_disk_as_from_memory() {
    let path = data("torus_with_children.marq");
    let file = FileSource::open(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(file.length().unwrap(), bytes.len() as u64);
    let mut document = Document::open(&file, Limits::default()).unwrap();
    document.load_index(&file).unwrap();
    assert_eq!(
        decode_all(&document, &file),
        decode_all(&open(&bytes), &SliceSource(&bytes))
    );
    let end = bytes.len() as u64;
    assert!(matches!(
        file.read(end - 1..end + 1),
        Err(SourceError::OutOfRange { .. })
    ));
    assert!(matches!(
        SliceSource(&bytes).read(end..end + 1),
        Err(SourceError::OutOfRange { .. })
    ));
}

#[test]
fn adjacent_pages_are_one_request() {
    let document = open(&std::fs::read(data("torus_with_children.marq")).unwrap());
    let pages = [4, 1, 2, 2, 99].map(PageId);
    let runs = document.coalesce(&pages, 0);
    let members: Vec<&[PageId]> = runs.iter().map(|(_, pages)| pages.as_slice()).collect();
    assert_eq!(members, [&[PageId(1), PageId(2)][..], &[PageId(4)]]);
    assert_eq!(
        runs[0].0,
        document.page_range_bytes(PageId(1), PageId(2)).unwrap()
    );
    assert_eq!(document.coalesce(&pages, 1 << 20).len(), 1);
}
