//! Files with a picture of the model: what is written is read, and what is damaged is found.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "test data are small, borders are exact, and a failed unwrap fails the test"
)]

mod support;

use marquetry_format::header::SectionKind;
use marquetry_format::verify::{Report, verify};
use marquetry_format::writer::{BytesByPart, ChartTiles, Content, TileInput, write};
use marquetry_format::*;
use support::assemble::{Part, Parts};
use support::*;

/// A lossy WebP file with transparent pixels, as the converter makes them.
const PICTURE: &[u8] = include_bytes!("data/thumbnail_16x12.webp");
const KIND: u32 = SectionKind::Thumbnail as u32;

/// A cube with one colour tile and that picture.
fn written(thumbnail: Option<&[u8]>) -> Result<(Vec<u8>, BytesByPart), Error> {
    let cube = Model {
        glue: cube_glue(),
        surface: &cube_sphere,
        resolution: &|_| 2,
        split: &never,
        shift: 10,
        has_colours: false,
    };
    let tile = TileInput {
        bytes: include_bytes!("data/tile_12x12.vp8").to_vec(),
        children: [const { None }; 4],
    };
    let (width, height) = (8, 8);
    let size = TexelSize { width, height };
    let mut colour = vec![None; 6];
    colour[2] = Some(ChartTiles { size, root: tile });
    let mut out = Vec::new();
    let content = Content {
        charts: &cube.charts(),
        colour: Some(&colour),
        thumbnail,
        ..Content::default()
    };
    let parts = write(&cube.metadata(), &cube.lattice(), &content, &mut out)?;
    Ok((out, parts))
}

fn file() -> Vec<u8> {
    written(Some(PICTURE)).unwrap().0
}

/// The failures of the check of that name; `None` where it was not made.
fn failures(report: &Report, name: &str) -> Option<Vec<String>> {
    let check = report.checks.iter().find(|check| check.name == name)?;
    Some(check.failures.clone())
}

#[test]
fn the_picture_is_last_and_every_reader_may_skip_it() {
    let (with, parts) = written(Some(PICTURE)).unwrap();
    let (without, _) = written(None).unwrap();
    let document = open(&with);
    let section = document.header().sections.last().unwrap();
    assert_eq!((section.kind, section.flags), (KIND, 0));
    assert!(with.ends_with(PICTURE));
    assert_eq!(with.len(), without.len() + 32 + PICTURE.len());
    assert_eq!(document.front_bytes(), open(&without).front_bytes() + 32);
    assert_eq!(parts, document.bytes_by_part());
    assert_eq!(parts.thumbnail, PICTURE.len() as u64);
    let sum = parts.header + parts.index + parts.geometry + parts.normals + parts.colour;
    assert_eq!(parts.total, sum + parts.thumbnail);
    let picture = thumbnail::decode(PICTURE).unwrap();
    assert_eq!((picture.width, picture.height), (16, 12));
    assert!(picture.has_alpha && picture.pixels.len() == 4 * 16 * 12);
}

#[test]
fn files_with_and_without_a_picture_verify() {
    let (with, _) = written(Some(PICTURE)).unwrap();
    let (without, parts) = written(None).unwrap();
    let report = verify(&with).unwrap();
    assert!(report.ok, "{report:?}");
    assert_eq!(failures(&report, "thumbnail"), Some(Vec::new()));
    let report = verify(&without).unwrap();
    assert!(report.ok, "{report:?}");
    assert_eq!((failures(&report, "thumbnail"), parts.thumbnail), (None, 0));
}

/// An address with the content id in it may be kept for ever, and so may what is told apart by it.
#[test]
fn another_picture_is_another_content() {
    let (without, _) = written(None).unwrap();
    let mut other = PICTURE.to_vec();
    // The last byte pads a chunk.
    other.extend([b'X', b'Y', b'Z', b' ', 2, 0, 0, 0, 1, 2]);
    let riff = (other.len() as u32 - 8).to_le_bytes();
    other[4..8].copy_from_slice(&riff);
    let (other, _) = written(Some(&other)).unwrap();
    assert!(verify(&other).unwrap().ok);
    let ids = [&file(), &other, &without].map(|file| open(file).content_id);
    assert!(ids[0] != ids[1] && ids[1] != ids[2] && ids[2] != ids[0]);
}

#[test]
fn no_byte_of_the_picture_can_change_unseen() {
    let file = file();
    let mut unseen = Vec::new();
    for at in file.len() - PICTURE.len()..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 0x10;
        if verify(&damaged).unwrap().ok {
            unseen.push(at);
        }
    }
    assert_eq!(unseen, [0; 0]);
}

/// What a failure says, and what brings it about.
type Case<'a> = (&'static str, &'a dyn Fn(&mut Parts));

#[test]
fn what_is_no_picture_is_found_whatever_its_checksum() {
    let changed = |change: &dyn Fn(&mut Parts)| {
        let mut parts = Parts::of(&file());
        change(&mut parts);
        let report = verify(&parts.file()).unwrap();
        let failures = failures(&report, "thumbnail").unwrap();
        (report.ok, failures.join("; "))
    };
    let cases: [Case<'_>; 4] = [
        ("thumbnail", &|parts| parts.body(KIND).truncate(40)),
        ("1048576", &|parts| {
            parts.body(KIND).resize((1 << 20) + 1, 0);
        }),
        ("more than one", &|parts| {
            // Nobody must understand tiles either.
            for part in parts.sections.iter_mut().filter(|part| part.flags == 0) {
                part.kind = KIND;
            }
        }),
        ("front", &|parts| {
            // Empty, so that all else lies where it did.
            parts.sections.pop();
            let (kind, flags, body) = (KIND, 0, Vec::new());
            parts.sections.insert(1, Part { kind, flags, body });
        }),
    ];
    for (words, change) in cases {
        let (ok, failures) = changed(change);
        assert!(!ok && failures.contains(words), "{words}: {failures}");
    }
}

#[test]
fn what_is_no_picture_is_not_written() {
    for bytes in [
        &b""[..],
        b"\x89PNG\r\n\x1a\n",
        &PICTURE[..PICTURE.len() - 9],
    ] {
        assert!(matches!(
            written(Some(bytes)),
            Err(Error::Compression { .. })
        ));
    }
    let long = vec![0; (1 << 20) + 1];
    assert!(matches!(written(Some(&long)), Err(Error::Limit { .. })));
}
