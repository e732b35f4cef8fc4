//! Files with colour tiles: what is written is read, and what is damaged is refused.
//!
//! Malformed files are in `tests/data/malformed_colour`; `MARQUETRY_BLESS=1 cargo test -p marquetry-format --test colour_tiles`
//! writes them anew.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::colour::decode_vp8;
use marquetry_format::verify::verify;
use marquetry_format::writer::{ChartTiles, Content, TileInput, write};
use marquetry_format::*;
use std::path::PathBuf;
use support::assemble::Parts;
use support::*;

/// A key frame of 12 × 12 pixels.
const FRAME: &[u8] = include_bytes!("data/tile_12x12.vp8");
const SIZE: TexelSize = TexelSize {
    width: 8,
    height: 8,
};

fn tile(children: [Option<TileInput>; 4]) -> TileInput {
    TileInput {
        bytes: FRAME.to_vec(),
        children: children.map(|child| child.map(Box::new)),
    }
}

fn leaf() -> TileInput {
    tile([const { None }; 4])
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "the writer takes charts that may have none"
)]
fn chart(size: TexelSize, root: TileInput) -> Option<ChartTiles> {
    Some(ChartTiles { size, root })
}

/// A cube of which charts 1 and 3 have texels.
fn written(colour: &Vec<Option<ChartTiles>>) -> Result<Vec<u8>, Error> {
    let cube = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|_| 2,
        split: &never,
        shift: 10,
        has_colours: true,
    };
    let mut out = Vec::new();
    let content = Content {
        charts: &cube.charts(),
        colour: Some(colour),
        ..Content::default()
    };
    write(&cube.metadata(), &cube.lattice(), &content, &mut out)?;
    Ok(out)
}

fn file() -> Vec<u8> {
    let deep = tile([None, Some(leaf()), None, Some(leaf())]);
    let mut colour = vec![None; 6];
    colour[1] = chart(SIZE, tile([Some(deep), None, Some(leaf()), None]));
    colour[3] = chart(SIZE, leaf());
    written(&colour).unwrap()
}

fn index(file: &Vec<u8>) -> Result<ColourIndex, Error> {
    let document = Document::open(file, Limits::default())?;
    let mut index = ColourIndex::of(&document, Limits::default())?.expect("tiles");
    index.load(file)?;
    Ok(index)
}

#[test]
fn tiles_are_found_by_chart_and_quadrant() {
    let file = file();
    let index = index(&file).unwrap();
    assert_eq!(index.tile_count(), 6);
    assert_eq!(index.root(ChartId(0)), None);
    assert_eq!(index.root(ChartId(3)), Some(TileId(1)));
    let root = index.root(ChartId(1)).unwrap();
    let child = |tile, q| index.child(tile, Quadrant(q));
    assert_eq!(
        [0, 1, 2, 3].map(|q| child(root, q)),
        [Some(TileId(2)), None, Some(TileId(3)), None]
    );
    assert_eq!(child(TileId(2), 1), Some(TileId(4)));
    assert_eq!(child(TileId(2), 3), Some(TileId(5)));
    for tile in (0..6).map(TileId) {
        let range = index.tile_range(tile).unwrap();
        let bytes =
            &file[usize::try_from(range.start).unwrap()..usize::try_from(range.end).unwrap()];
        assert_eq!(bytes, FRAME);
        let texels = index.decode(ChartId(1), tile, bytes).unwrap();
        assert_eq!(
            (texels.width, texels.height, texels.rgb.len()),
            (12, 12, 432)
        );
    }
}

#[test]
fn a_file_with_tiles_verifies_and_counts_their_bytes() {
    let file = file();
    let report = verify(&file).unwrap();
    assert!(report.ok, "{report:?}");
    let check = report
        .checks
        .iter()
        .find(|c| c.name == "colour tile checksums and decoding");
    assert_eq!(check.unwrap().count, 6);
    let document = Document::open(&file, Limits::default()).unwrap();
    let parts = document.bytes_by_part();
    assert!(parts.colour >= index(&file).unwrap().bytes());
    assert_eq!(parts.total, file.len() as u64);
}

/// Every byte of the two sections matters: a change of any is refused by the reader of tiles or by `verify`.
#[test]
fn no_byte_of_the_tiles_can_change_unseen() {
    let file = file();
    let document = Document::open(&file, Limits::default()).unwrap();
    let range = ColourIndex::of(&document, Limits::default())
        .unwrap()
        .unwrap()
        .directory_range();
    let mut unseen = Vec::new();
    for at in usize::try_from(range.start).unwrap()..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 0x10;
        let report = verify(&damaged);
        let refused = index(&damaged).is_err();
        if report.is_ok_and(|report| report.ok)
            || (at < usize::try_from(range.end).unwrap() && !refused)
        {
            unseen.push(at);
        }
    }
    assert_eq!(unseen, [0; 0]);
}

#[test]
fn frames_of_another_size_are_refused_before_decoding() {
    let wider = TexelSize {
        width: 16,
        height: 8,
    };
    assert!(matches!(
        decode_vp8(wider, FRAME),
        Err(Error::Mismatch { .. })
    ));
    assert!(decode_vp8(SIZE, &FRAME[..9]).is_err());
    assert!(decode_vp8(SIZE, b"").is_err());
    let mut inter_frame = FRAME.to_vec();
    inter_frame[0] |= 1;
    assert!(decode_vp8(SIZE, &inter_frame).is_err());
}

/// Damaged frames may decode to something, since a codec has no checksum, but only to the right number of texels.
#[test]
fn damaged_frames_never_give_another_size() {
    let check = |bytes: &[u8]| {
        if let Ok(texels) = decode_vp8(SIZE, bytes) {
            assert_eq!(texels.rgb.len(), 3 * 12 * 12);
        }
    };
    for end in 0..FRAME.len() {
        check(&FRAME[..end]);
    }
    for bit in 0..8 * FRAME.len() {
        let mut damaged = FRAME.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        check(&damaged);
    }
}

#[test]
fn input_that_breaks_a_rule_is_not_written() {
    let is_input = |error: Error| matches!(error, Error::Input { .. });
    assert!(is_input(written(&vec![None; 7]).unwrap_err()));
    let mut colour = vec![None; 6];
    let size = TexelSize {
        width: 16,
        height: 16,
    };
    colour[0] = chart(size, leaf());
    assert!(written(&colour).is_err());
}

/// A name, the bytes, and whether an error is the expected one.
type Case = (&'static str, Vec<u8>, fn(&Error) -> bool);

fn changed(change: impl FnOnce(&mut Parts)) -> Vec<u8> {
    let mut parts = Parts::of(&file());
    change(&mut parts);
    parts.file()
}

/// The directory with one byte set; its packed stream is 12 bytes after one record.
fn directory(at: usize, byte: u8) -> Vec<u8> {
    changed(|parts| parts.body(23)[at] = byte)
}

/// The facts of the only block, raw, changed.
fn facts(change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    changed(|parts| {
        let length = u32::from_le_bytes(parts.body(23)[32..36].try_into().unwrap()) as usize;
        let block = parts.body(18)[..length].to_vec();
        let mut raw = match block[24] {
            1 => block[25..].to_vec(),
            2 => zstd::bulk::decompress(&[&[0x28, 0xb5, 0x2f, 0xfd], &block[25..]].concat(), 24)
                .unwrap(),
            method => panic!("method {method}"),
        };
        change(&mut raw);
        let new = [&block[..24], &[1], &raw].concat();
        let checksum = parts.checksum(&new).to_le_bytes();
        let grown = (new.len() - length) as u64;
        parts.body(18).splice(..length, new.iter().copied());
        let directory = parts.body(23);
        let offset = u64::from_le_bytes(directory[16..24].try_into().unwrap()) + grown;
        directory[16..24].copy_from_slice(&offset.to_le_bytes());
        directory[24..32].copy_from_slice(&checksum);
        directory[32..36].copy_from_slice(&(new.len() as u32).to_le_bytes());
    })
}

#[expect(clippy::too_many_lines, reason = "a table")]
fn cases() -> Vec<Case> {
    // Another type in its place, so that everything else lies where it did.
    let without = |kind: u32| {
        changed(|parts| {
            for part in parts.sections.iter_mut().filter(|part| part.kind == kind) {
                part.kind = 99;
            }
        })
    };
    vec![
        ("tiles_without_a_directory", without(23), |e| {
            matches!(e, Error::MissingSection { kind: 23 })
        }),
        ("directory_without_tiles", without(18), |e| {
            matches!(e, Error::MissingSection { kind: 18 })
        }),
        (
            "directory_cut_short",
            changed(|parts| parts.body(23).truncate(15)),
            |e| matches!(e, Error::Truncated { .. }),
        ),
        (
            "directory_trailing_byte",
            changed(|parts| parts.body(23).push(0)),
            |e| matches!(e, Error::TrailingBytes { .. }),
        ),
        ("too_many_tiles", directory(3, 0xff), |e| {
            matches!(e, Error::Limit { .. })
        }),
        ("fewer_tiles_than_roots", directory(0, 1), |e| {
            matches!(
                e,
                Error::Mismatch {
                    what: "root tiles",
                    ..
                }
            )
        }),
        ("other_number_of_blocks", directory(4, 2), |e| {
            matches!(e, Error::Mismatch { .. })
        }),
        ("codec_2", directory(8, 2), |e| {
            matches!(e, Error::Value { found: 2, .. })
        }),
        ("directory_method_3", directory(9, 3), |e| {
            matches!(e, Error::Value { found: 3, .. })
        }),
        ("directory_reserved", directory(10, 1), |e| {
            matches!(e, Error::Reserved { value: 1, .. })
        }),
        ("first_child_before_the_roots", directory(36, 1), |e| {
            matches!(e, Error::Value { found: 1, .. })
        }),
        ("tiles_before_their_index", directory(16, 0), |e| {
            matches!(e, Error::Value { .. } | Error::Mismatch { .. })
        }),
        ("block_checksum", directory(24, 0), |e| {
            matches!(e, Error::Checksum { .. })
        }),
        ("chart_of_136_texels", sizes(1, 17), |e| {
            matches!(e, Error::Value { found: 136, .. })
        }),
        ("chart_of_no_height", sizes(6 + 1, 0), |e| {
            matches!(e, Error::Value { .. })
        }),
        ("more_roots_than_stated", sizes_both(0), |e| {
            matches!(e, Error::Value { .. } | Error::Mismatch { .. })
        }),
        ("tile_too_long", facts(|facts| facts[12] = 0xff), |e| {
            matches!(e, Error::Limit { .. })
        }),
        (
            "tile_lengths_do_not_add_up",
            facts(|facts| facts[0] -= 1),
            |e| matches!(e, Error::Mismatch { .. }),
        ),
        (
            "tile_children_reserved",
            facts(|facts| facts[18] |= 16),
            |e| matches!(e, Error::Reserved { .. }),
        ),
        (
            "tile_children_left_over",
            facts(|facts| facts[18] = 1),
            |e| matches!(e, Error::Mismatch { .. }),
        ),
        (
            "tile_is_its_own_child",
            facts(|facts| facts[18..24].copy_from_slice(&[0, 0, 15, 0, 0, 0])),
            |e| matches!(e, Error::Value { found: 2, .. }),
        ),
        (
            "block_cut_short",
            changed(|parts| parts.body(23)[32] = 3),
            |e| matches!(e, Error::Mismatch { .. } | Error::Checksum { .. }),
        ),
        (
            "tile_of_another_size",
            changed(|parts| {
                let end = parts.body(18).len();
                let start = end - FRAME.len();
                // Width of the last tile, and its checksum.
                parts.body(18)[start + 6] = 13;
                reseal_last_tile(parts, FRAME.len());
            }),
            |e| {
                matches!(
                    e,
                    Error::Mismatch {
                        what: "size of a tile",
                        ..
                    }
                )
            },
        ),
    ]
}

/// The packed stream of sizes, raw, with one byte set.
fn sizes(at: usize, code: u8) -> Vec<u8> {
    changed(|parts| set_sizes(parts, &[(at, code)]))
}

/// The same with width and height of a chart of 8 × 8 texels.
fn sizes_both(chart: usize) -> Vec<u8> {
    changed(|parts| set_sizes(parts, &[(chart, 1), (6 + chart, 1)]))
}

fn set_sizes(parts: &mut Parts, changes: &[(usize, u8)]) {
    let mut codes = vec![0, 1, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0];
    for &(at, code) in changes {
        codes[at] = code;
    }
    let old = parts.body(23).len();
    let directory = parts.body(23);
    directory.truncate(40);
    directory.extend(&codes);
    directory[9] = 1;
    directory[12..16].copy_from_slice(&12u32.to_le_bytes());
    let offset = u64::from_le_bytes(directory[16..24].try_into().unwrap());
    let offset = offset + directory.len() as u64 - old as u64;
    directory[16..24].copy_from_slice(&offset.to_le_bytes());
}

/// Makes the checksums of the last tile, and of the index block, those of what is there.
fn reseal_last_tile(parts: &mut Parts, bytes: usize) {
    let length = u32::from_le_bytes(parts.body(23)[32..36].try_into().unwrap()) as usize;
    let end = parts.body(18).len();
    let tile = parts.body(18)[end - bytes..].to_vec();
    let checksum = parts.checksum(&tile) as u32;
    parts.body(18)[20..24].copy_from_slice(&checksum.to_le_bytes());
    let block = parts.body(18)[..length].to_vec();
    let checksum = parts.checksum(&block).to_le_bytes();
    parts.body(23)[24..32].copy_from_slice(&checksum);
}

fn data(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/malformed_colour");
    folder.join(format!("{name}.marq"))
}

fn open_fully(file: &[u8]) -> Result<(), Error> {
    let file = file.to_vec();
    let index = index(&file)?;
    let mut charts: Vec<(ChartId, TileId)> = (0..6)
        .map(ChartId)
        .filter_map(|chart| Some((chart, index.root(chart)?)))
        .collect();
    while let Some((chart, tile)) = charts.pop() {
        let range = index.tile_range(tile).unwrap();
        index.decode(chart, tile, &file.read(range)?)?;
        charts.extend((0..4).filter_map(|q| Some((chart, index.child(tile, Quadrant(q))?))));
    }
    Ok(())
}

#[test]
fn malformed_files_are_refused() {
    let cases = cases();
    open_fully(&file()).unwrap();
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
            Ok(()) => panic!("{name} was opened"),
        }
        let verified = verify(&SliceSource(&bytes));
        assert!(
            verified.is_err() || !verified.unwrap().ok,
            "{name} verifies"
        );
    }
    for entry in std::fs::read_dir(data("x").parent().unwrap()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(
            cases.iter().any(|case| case.0 == name),
            "{name} is not tested"
        );
    }
}
