//! Every malformed file is refused, with the error that its name says; no damage goes unnoticed.
//!
//! The files are in `tests/data/malformed`. `MARQUETRY_BLESS=1 cargo test -p marquetry-format --test malformed`
//! writes them anew; the recipe of each is here.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::too_many_lines,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

#[path = "malformed/clusters.rs"]
mod clusters;
mod support;

use marquetry_format::verify::verify;
use marquetry_format::*;
use std::path::PathBuf;
use support::assemble::{Part, Parts};
use support::{Model, decode_all, glued, never, open, strip, strip_glue};

/// A name, the bytes, and whether an error is the expected one.
type Case = (&'static str, Vec<u8>, fn(&Error) -> bool);

/// A small file with children: a flat square.
fn small() -> Vec<u8> {
    square(0.0)
}

/// A square with children and bumps of height `bump`; one side is folded onto itself.
fn square(bump: f64) -> Vec<u8> {
    let surface = |_: usize, u: f64, v: f64| {
        let v = if u == 1.0 && v > 0.5 { 1.0 - v } else { v };
        (
            [u, v, 0.5 + bump * (40.0 * u).sin() * (50.0 * v).cos()],
            [0.0, 0.0, 1.0],
            [0; 3],
        )
    };
    let model = Model {
        glue: vec![[None, glued(0, 1, true), None, None]],
        surface: &surface,
        resolution: &|_| 5,
        split: &|node| node.level == 0,
        shift: 12,
        has_colours: false,
    };
    model.write().unwrap()
}

/// A tiny file: one chart, all of it in the base.
fn tiny() -> Vec<u8> {
    let model = Model {
        glue: strip_glue(),
        surface: &strip,
        resolution: &|_| 2,
        split: &never,
        shift: 12,
        has_colours: true,
    };
    model.write().unwrap()
}

fn changed(file: &[u8], change: impl FnOnce(&mut Parts)) -> Vec<u8> {
    let mut parts = Parts::of(file);
    change(&mut parts);
    parts.file()
}

/// Replaces the only index block, with its checksum in the directory.
fn with_block(file: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    changed(file, |parts| {
        change(parts.body(5));
        let block = parts.body(5).clone();
        let checksum = parts.checksum(&block).to_le_bytes();
        parts.body(2)[40..48].copy_from_slice(&checksum);
        parts.body(2)[48..52].copy_from_slice(&(block.len() as u32).to_le_bytes());
        place_pages(parts);
    })
}

/// States in the directory where the pages are after other parts have changed their lengths.
fn place_pages(parts: &mut Parts) {
    let before: usize = parts
        .sections
        .iter()
        .take_while(|part| part.kind != 6)
        .map(|part| part.body.len())
        .sum();
    let pages = (64 + 32 * parts.sections.len() + before) as u64;
    parts.body(2)[32..40].copy_from_slice(&pages.to_le_bytes());
}

/// The facts of the small file's index block, raw, changed.
fn with_facts(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    with_block(&small(), |block| {
        let checksums = 4 * 5;
        // 5 pages, 10 errors.
        let mut facts = match block[checksums] {
            1 => block[checksums + 1..].to_vec(),
            2 => zstd::bulk::decompress(
                &[&[0x28, 0xb5, 0x2f, 0xfd], &block[checksums + 1..]].concat(),
                1 + 95 + 20,
            )
            .unwrap(),
            method => panic!("method {method}"),
        };
        assert_eq!(facts.len(), 1 + 95 + 20);
        change(&mut facts);
        block.truncate(checksums);
        block.push(1);
        block.extend(facts);
    })
}

fn framing() -> Vec<Case> {
    let tiny = tiny();
    let mut text_mode = tiny.clone();
    text_mode.remove(5);
    let mut flipped = tiny.clone();
    flipped[16] ^= 1;
    let mut long = tiny.clone();
    long.push(0);
    let mut version = tiny.clone();
    version[8] = 2;
    vec![
        ("empty", Vec::new(), |e| {
            matches!(
                e,
                Error::Truncated {
                    what: "header",
                    expected: 8,
                    found: 0
                }
            )
        }),
        ("cut_in_header", tiny[..40].to_vec(), |e| {
            matches!(
                e,
                Error::Truncated {
                    what: "header",
                    found: 40,
                    ..
                }
            )
        }),
        ("cut_in_section_table", tiny[..100].to_vec(), |e| {
            matches!(
                e,
                Error::Truncated {
                    what: "header",
                    expected: 256,
                    found: 100
                }
            )
        }),
        ("cut_at_the_end", tiny[..tiny.len() - 1].to_vec(), |e| {
            matches!(e, Error::Truncated { what: "file", .. })
        }),
        ("byte_after_the_end", long, |e| {
            matches!(e, Error::TrailingBytes { what: "file", .. })
        }),
        ("text_mode_transfer", text_mode, |e| {
            matches!(e, Error::NotMarq { .. })
        }),
        ("png", b"\x89PNG\r\n\x1a\n0123456789".to_vec(), |e| {
            matches!(e, Error::NotMarq { .. })
        }),
        ("major_version_2", version, |e| {
            matches!(e, Error::UnsupportedVersion { major: 2, minor: 0 })
        }),
        ("header_checksum", flipped, |e| {
            matches!(
                e,
                Error::Checksum {
                    what: "header",
                    offset: 0,
                    ..
                }
            )
        }),
        (
            "header_flags",
            changed(&tiny, |parts| parts.flags = 4),
            |e| {
                matches!(
                    e,
                    Error::Reserved {
                        what: "header flags",
                        value: 4
                    }
                )
            },
        ),
        (
            "section_flags",
            changed(&tiny, |parts| parts.sections[2].flags = 3),
            |e| {
                matches!(
                    e,
                    Error::Reserved {
                        what: "section flags",
                        value: 3
                    }
                )
            },
        ),
        (
            "unknown_section",
            changed(&tiny, |parts| {
                parts.sections.push(Part {
                    kind: 99,
                    flags: 1,
                    body: vec![1],
                });
            }),
            |e| matches!(e, Error::UnknownSection { index: 6, kind: 99 }),
        ),
        (
            "terrain_must_be_understood",
            changed(&tiny, |parts| {
                parts.sections.push(Part {
                    kind: 16,
                    flags: 1,
                    body: vec![],
                });
            }),
            |e| matches!(e, Error::UnknownSection { index: 6, kind: 16 }),
        ),
        (
            "no_pages_section",
            changed(&tiny, |parts| drop(parts.sections.remove(5))),
            |e| matches!(e, Error::MissingSection { kind: 6 }),
        ),
        (
            "sections_out_of_order",
            changed(&tiny, |parts| parts.sections.swap(0, 1)),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        index: 0,
                        kind: 2,
                        ..
                    }
                )
            },
        ),
        (
            "section_twice",
            changed(&tiny, |parts| {
                parts.sections.insert(1, parts.sections[0].clone());
            }),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        index: 1,
                        kind: 1,
                        ..
                    }
                )
            },
        ),
        (
            "gap_between_sections",
            Parts::of(&tiny).file_with(|table| table[32 + 8] += 1),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        index: 1,
                        kind: 2,
                        ..
                    }
                )
            },
        ),
        (
            "section_beyond_any_file",
            Parts::of(&tiny).file_with(|table| table[5 * 32 + 16..][..8].fill(0xff)),
            |e| {
                matches!(
                    e,
                    Error::Section {
                        index: 5,
                        kind: 6,
                        ..
                    }
                )
            },
        ),
        (
            "section_checksum",
            Parts::of(&tiny).file_with(|table| table[2 * 32 + 24] ^= 1),
            |e| matches!(e, Error::Checksum { what: "charts", .. }),
        ),
        (
            "too_many_sections",
            changed(&tiny, |parts| {
                parts.sections.extend(vec![
                    Part {
                        kind: 21,
                        flags: 0,
                        body: vec![]
                    };
                    60
                ]);
            }),
            |e| {
                matches!(
                    e,
                    Error::Limit {
                        what: "sections",
                        limit: 64,
                        found: 66
                    }
                )
            },
        ),
    ]
}

fn front() -> Vec<Case> {
    let (tiny, small) = (tiny(), small());
    let tiny = &tiny;
    // Kind, origin 24, step 8, shift 1, bounds 48, up, colours, errors 24, then numbers and texts.
    let with = |file: &[u8], kind, change: &dyn Fn(&mut Vec<u8>)| {
        changed(file, |parts| {
            change(parts.body(kind));
            place_pages(parts);
        })
    };
    let metadata = |change: &dyn Fn(&mut Vec<u8>)| with(tiny, 1, change);
    let directory = |change: &dyn Fn(&mut Vec<u8>)| with(&small, 2, change);
    let charts = |change: &dyn Fn(&mut Vec<u8>)| with(tiny, 3, change);
    let base = |change: &dyn Fn(&mut Vec<u8>)| with(tiny, 4, change);
    vec![
        ("metadata_kind", metadata(&|m| m[0] = 7), |e| {
            matches!(e, Error::Metadata(_))
        }),
        (
            "metadata_step_zero",
            metadata(&|m| m[25..33].fill(0)),
            |e| matches!(e, Error::Metadata(_)),
        ),
        ("metadata_shift_16", metadata(&|m| m[33] = 16), |e| {
            matches!(e, Error::Metadata(_))
        }),
        (
            "metadata_name_without_end",
            metadata(&|m| m.truncate(m.len() - 3)),
            |e| matches!(e, Error::Metadata(_)),
        ),
        ("metadata_trailing_byte", metadata(&|m| m.push(0)), |e| {
            matches!(
                e,
                Error::TrailingBytes {
                    what: "metadata",
                    ..
                }
            )
        }),
        ("no_charts", charts(&|c| c[..4].fill(0)), |e| {
            matches!(
                e,
                Error::Value {
                    what: "number of charts",
                    ..
                }
            )
        }),
        ("too_many_charts", charts(&|c| c[..4].fill(0xff)), |e| {
            matches!(
                e,
                Error::Limit {
                    what: "charts",
                    found: 0xffff_ffff,
                    ..
                }
            )
        }),
        ("base_resolution_6", charts(&|c| c[4] = 6), |e| {
            matches!(
                e,
                Error::Value {
                    what: "base resolution",
                    found: 6
                }
            )
        }),
        ("charts_reserved", charts(&|c| c[6] = 1), |e| {
            matches!(e, Error::Reserved { what: "charts", .. })
        }),
        ("charts_other_count", charts(&|c| c[0] = 1), |e| {
            matches!(
                e,
                Error::Mismatch { what: "charts", .. }
                    | Error::TrailingBytes { what: "charts", .. }
            )
        }),
        ("page_count_not_of_trees", directory(&|d| d[0] += 1), |e| {
            matches!(
                e,
                Error::Value {
                    what: "number of pages",
                    found: 6
                }
            )
        }),
        (
            "too_many_pages",
            directory(&|d| d[..4].copy_from_slice(&[0xfd, 0xff, 0xff, 0xff])),
            |e| matches!(e, Error::Limit { what: "pages", .. }),
        ),
        ("index_block_missing", directory(&|d| d[4] = 0), |e| {
            matches!(
                e,
                Error::Mismatch {
                    what: "index blocks",
                    expected: 1,
                    found: 0
                }
            )
        }),
        ("directory_trailing_byte", directory(&|d| d.push(0)), |e| {
            matches!(
                e,
                Error::TrailingBytes {
                    what: "directory",
                    ..
                }
            )
        }),
        ("part_bytes_do_not_add_up", directory(&|d| d[8] ^= 1), |e| {
            matches!(
                e,
                Error::Mismatch {
                    what: "bytes of all pages",
                    ..
                }
            )
        }),
        (
            "first_child_of_the_wrong_block",
            directory(&|d| d[52] += 4),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "first child of an index block",
                        found: 5
                    }
                )
            },
        ),
        ("index_block_too_long", directory(&|d| d[48] ^= 1), |e| {
            matches!(
                e,
                Error::Mismatch {
                    what: "end of the index blocks",
                    ..
                }
            )
        }),
        ("base_trailing_byte", base(&|b| b.push(0)), |e| {
            matches!(
                e,
                Error::TrailingBytes { what: "base", .. } | Error::Compression { what: "base", .. }
            )
        }),
        ("base_cut_short", base(&|b| b.truncate(b.len() - 1)), |e| {
            matches!(e, Error::Truncated { what: "base", .. })
        }),
        ("base_method_3", base(&|b| b[0] |= 3), |e| {
            matches!(
                e,
                Error::Value {
                    what: "base",
                    found: 3
                }
            )
        }),
        ("base_with_4_planes", base(&|b| b[1] |= 3), |e| {
            matches!(
                e,
                Error::Value {
                    what: "base",
                    found: 4
                }
            )
        }),
        ("base_prediction_3", base(&|b| b[1] |= 0b1100), |e| {
            matches!(
                e,
                Error::Value {
                    what: "base",
                    found: 3
                }
            )
        }),
        ("base_reserved_bits", base(&|b| b[1] |= 0b1_0000), |e| {
            matches!(e, Error::Reserved { what: "base", .. })
        }),
        (
            "base_outside_the_lattice",
            // All raw: 50 samples, the first x far below zero.
            base(&|b| {
                *b = vec![1, 2, 0xc2, 0x03, 0];
                b.resize(5 + 450, 0);
                b[5] = 1;
            }),
            |e| matches!(e, Error::Value { what: "base", .. }),
        ),
        (
            "base_window_of_16_mib",
            base(&|b| *b = vec![2, 0, 7, 0, 0x40, 14 << 3, 0xff, 0xff, 1, 0, 0]),
            |e| {
                matches!(
                    e,
                    Error::Limit {
                        what: "zstd window",
                        found: 0x0100_0000,
                        ..
                    }
                )
            },
        ),
        (
            "base_frame_of_another_size",
            // One segment of 65 535 + 256 bytes in place of 150.
            base(&|b| *b = vec![2, 0, 7, 0, 0x60, 0xff, 0xff, 0xfb, 0xff, 0x07, 0]),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "base",
                        expected: 150,
                        found: 65_791
                    }
                )
            },
        ),
    ]
}

/// Faults that only the index or a page shows.
fn index() -> Vec<Case> {
    let small = small();
    vec![
        (
            "index_block_checksum",
            {
                let mut parts = Parts::of(&small);
                parts.body(5)[0] ^= 1;
                parts.file()
            },
            |e| {
                matches!(
                    e,
                    Error::Checksum {
                        what: "index block",
                        ..
                    }
                )
            },
        ),
        (
            "index_block_cut_short",
            with_block(&small, |block| block.truncate(18)),
            |e| {
                matches!(
                    e,
                    Error::Truncated {
                        what: "index block",
                        expected: 20,
                        found: 18
                    }
                )
            },
        ),
        (
            "index_facts_cut_short",
            with_facts(|facts| facts.truncate(90)),
            |e| {
                matches!(
                    e,
                    Error::Truncated {
                        what: "index block",
                        expected: 116,
                        found: 90
                    }
                )
            },
        ),
        (
            "children_bits_reserved",
            with_facts(|facts| facts[0] |= 0x80),
            |e| {
                matches!(
                    e,
                    Error::Reserved {
                        what: "index block",
                        ..
                    }
                )
            },
        ),
        // Page 4 with children 1..5 would be its own ancestor.
        (
            "page_is_its_own_ancestor",
            with_facts(|facts| facts[0] = 0x10),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "page with children",
                        found: 4
                    }
                )
            },
        ),
        (
            "children_left_over",
            with_facts(|facts| facts[0] = 0),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "end of a block's children",
                        ..
                    }
                )
            },
        ),
        (
            "page_lengths_do_not_add_up",
            with_facts(|facts| facts[1] ^= 1),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "end of a block's pages",
                        ..
                    }
                )
            },
        ),
        (
            "page_too_long",
            with_facts(|facts| facts[1 + 10] = 0xff),
            |e| {
                matches!(
                    e,
                    Error::Limit {
                        what: "bytes of a page",
                        ..
                    }
                )
            },
        ),
        (
            "bounds_shift_21",
            with_facts(|facts| facts[1 + 15 + 20 + 15] = 21),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "bounds of a page",
                        ..
                    }
                )
            },
        ),
        (
            "bounds_below_zero",
            with_facts(|facts| facts[1 + 15 + 20 + 15 + 5] = 1),
            |e| {
                matches!(
                    e,
                    Error::Value {
                        what: "bounds of a page",
                        ..
                    }
                )
            },
        ),
    ]
}

fn data(name: &str) -> PathBuf {
    [
        env!("CARGO_MANIFEST_DIR"),
        "tests",
        "data",
        "malformed",
        &format!("{name}.marq"),
    ]
    .iter()
    .collect()
}

fn open_fully(bytes: &[u8]) -> Result<Document, Error> {
    let mut document = Document::open(&SliceSource(bytes), Limits::default())?;
    document.load_index(&SliceSource(bytes))?;
    Ok(document)
}

#[test]
fn every_malformed_file_is_refused_for_its_fault() {
    let cases: Vec<Case> = [framing(), front(), index(), clusters::cases()]
        .into_iter()
        .flatten()
        .collect();
    if std::env::var_os("MARQUETRY_BLESS").is_some() {
        std::fs::create_dir_all(data("x").parent().unwrap()).unwrap();
        for (name, bytes, _) in &cases {
            std::fs::write(data(name), bytes).unwrap();
        }
    }
    for (name, _, expected) in &cases {
        let bytes = std::fs::read(data(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        match open_fully(&bytes) {
            Err(error) => assert!(expected(&error), "{name}: {error:?}"),
            Ok(_) => panic!("{name} was opened"),
        }
        let verified = verify(&SliceSource(&bytes));
        assert!(
            verified.is_err() || !verified.unwrap().ok,
            "{name} verifies"
        );
    }
}

#[test]
fn every_malformed_file_has_a_case() {
    let known: Vec<&str> = [framing(), front(), index(), clusters::cases()]
        .concat()
        .iter()
        .map(|case| case.0)
        .collect();
    for entry in std::fs::read_dir(data("x").parent().unwrap()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(known.contains(&name), "{name} is not tested");
    }
}

#[test]
fn every_flipped_bit_is_noticed() {
    let mut file = tiny();
    assert!(verify(&SliceSource(&file)).unwrap().ok);
    for bit in 0..8 * file.len() {
        file[bit / 8] ^= 1 << (bit % 8);
        if let Ok(report) = verify(&SliceSource(&file)) {
            assert!(
                !report.ok,
                "bit {} of byte {} went unnoticed",
                bit % 8,
                bit / 8
            );
        }
        file[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn flipped_bits_in_pages_are_noticed() {
    let mut file = square(0.1);
    assert!(verify(&SliceSource(&file)).unwrap().ok);
    for byte in (0..file.len()).step_by(7) {
        let bit = byte % 8;
        file[byte] ^= 1 << bit;
        if let Ok(report) = verify(&SliceSource(&file)) {
            assert!(!report.ok, "bit {bit} of byte {byte} went unnoticed");
        }
        file[byte] ^= 1 << bit;
    }
}

#[test]
fn flipped_bits_in_clusters_are_noticed() {
    for mut file in [clusters::file(), clusters::grouped_file()] {
        assert!(verify(&SliceSource(&file)).unwrap().ok);
        for bit in 0..8 * file.len() {
            file[bit / 8] ^= 1 << (bit % 8);
            if let Ok(report) = verify(&SliceSource(&file)) {
                assert!(!report.ok, "bit {bit} went unnoticed");
            }
            file[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[test]
fn every_cut_is_noticed() {
    for file in [
        tiny(),
        square(0.1),
        clusters::file(),
        clusters::grouped_file(),
    ] {
        let step = 1 + file.len() / 2000;
        for length in (0..file.len()).step_by(step) {
            let cut = verify(&SliceSource(&file[..length]));
            assert!(
                matches!(cut, Err(Error::Truncated { .. })),
                "cut at {length}: {cut:?}"
            );
            // An async caller sees a short answer in place of a short source.
            let (opening, _) = Opening::new(Limits::default());
            assert!(matches!(
                opening.feed(&file[..length]),
                Err(Error::Truncated { .. })
            ));
        }
    }
}

#[test]
fn ignorable_sections_are_skipped_but_checked() {
    let file = changed(&tiny(), |parts| {
        parts.sections.push(Part {
            kind: 20,
            flags: 0,
            body: b"proxy".to_vec(),
        });
        parts.sections.insert(
            3,
            Part {
                kind: 4000,
                flags: 0,
                body: b"in the front".to_vec(),
            },
        );
        place_pages(parts);
    });
    assert!(verify(&SliceSource(&file)).unwrap().ok);
    let mut damaged = file.clone();
    *damaged.last_mut().unwrap() ^= 1;
    assert!(!verify(&SliceSource(&damaged)).unwrap().ok);
}

#[test]
fn decoding_checks_what_it_is_given() {
    let file = small();
    let source = SliceSource(&file);
    let document = open(&file);
    let pages = decode_all(&document, &source);
    let bytes = |page| {
        source
            .read(document.page_range(PageId(page)).unwrap())
            .unwrap()
    };
    let decode = |page, quadrant, parent: &PageSamples, bytes: &[u8]| {
        document
            .decode_child(PageId(page), Quadrant(quadrant), parent, bytes)
            .unwrap_err()
    };
    let mut damaged = bytes(2);
    damaged[0] ^= 4;
    assert!(matches!(
        decode(2, 1, &pages[0], &damaged),
        Error::Checksum { what: "page", .. }
    ));
    assert!(matches!(
        decode(2, 1, &pages[0], &damaged[1..]),
        Error::Truncated { what: "page", .. }
    ));
    assert!(matches!(
        decode(2, 0, &pages[0], &bytes(2)),
        Error::Mismatch {
            expected: 1,
            found: 0,
            ..
        }
    ));
    assert!(matches!(
        decode(99, 0, &pages[0], &bytes(2)),
        Error::NoSuch {
            what: "page",
            number: 99
        }
    ));
    assert!(matches!(
        decode(2, 1, &PageSamples::default(), &bytes(2)),
        Error::WrongParent {
            page: 2,
            resolution: 0
        }
    ));
    assert!(matches!(
        document.decode_root(ChartId(1), &[]),
        Err(Error::NoSuch {
            what: "chart",
            number: 1
        })
    ));
    let unloaded = Document::open(&source, Limits::default()).unwrap();
    assert!(matches!(
        unloaded.decode_child(PageId(2), Quadrant(1), &pages[0], &bytes(2)),
        Err(Error::IndexNotLoaded { block: 0 })
    ));
}

#[test]
fn limits_are_kept() {
    let file = small();
    let refused = |limits| Document::open(&SliceSource(&file), limits).unwrap_err();
    let limits = Limits::default();
    assert!(matches!(
        refused(Limits {
            charts: 0,
            ..limits
        }),
        Error::Limit { what: "charts", .. }
    ));
    assert!(matches!(
        refused(Limits { pages: 4, ..limits }),
        Error::Limit {
            what: "pages",
            found: 5,
            ..
        }
    ));
    assert!(matches!(
        refused(Limits {
            metadata_bytes: 10,
            ..limits
        }),
        Error::Limit { limit: 10, .. }
    ));
    assert!(matches!(
        refused(Limits {
            section_bytes: 100,
            ..limits
        }),
        Error::Limit { limit: 100, .. }
    ));
    let mut document = Document::open(
        &SliceSource(&file),
        Limits {
            page_bytes: 3,
            ..limits
        },
    )
    .unwrap();
    assert!(matches!(
        document.load_index(&SliceSource(&file)),
        Err(Error::Limit {
            what: "bytes of a page",
            limit: 3,
            ..
        })
    ));
}
