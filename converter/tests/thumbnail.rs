//! The picture of the model that a conversion puts into its file.

#![expect(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod support;

use marquetry_converter::pipeline::{Options, Progress, convert};
use marquetry_format::header::SectionKind;
use marquetry_format::verify::verify;
use marquetry_format::{ByteSource, Document, FileSource, Limits, thumbnail};
use support::torus;

struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str) {}
    fn fraction(&self, _: f64) {}
}

/// The bytes of a torus's file.
fn converted(options: &Options) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.ply"), folder.path().join("out.marq"));
    std::fs::write(&input, torus(60, 30).ply()).unwrap();
    let report = convert(&input, &output, options, &Silent).unwrap();
    let stages: Vec<_> = report.stages.iter().map(|stage| stage.name).collect();
    assert_eq!(stages.contains(&"thumbnail"), options.thumbnail);
    let source = FileSource::open(&output).unwrap();
    let verified = verify(&source).unwrap();
    assert!(verified.ok, "{verified:?}");
    let is_picture = |name: &str| name == "thumbnail";
    let checked = verified.checks.iter().any(|check| is_picture(&check.name));
    assert_eq!(checked, options.thumbnail);
    source.read(0..source.length().unwrap()).unwrap()
}

#[test]
fn a_file_has_a_picture_unless_it_is_asked_for_none() {
    let options = Options {
        error_rel: 1e-3,
        ..Options::default()
    };
    let with = converted(&Options {
        threads: Some(1),
        ..options.clone()
    });
    let again = converted(&Options {
        threads: Some(3),
        ..options.clone()
    });
    assert!(with == again, "bytes differ with the number of threads");
    let document = Document::open(&with, Limits::default()).unwrap();
    let section = document.header().section(SectionKind::Thumbnail).unwrap();
    assert_eq!(section.range.end, with.len() as u64);
    let start = usize::try_from(section.range.start).unwrap();
    let picture = thumbnail::decode(&with[start..]).unwrap();
    // A ring of which 0.8 is seen: a third of the picture, and nothing of its corners.
    let covered = picture.pixels.chunks(4).filter(|pixel| pixel[3] == 255);
    let part = covered.count() as f64 / f64::from(picture.width * picture.height);
    assert!((0.2..0.5).contains(&part), "{part}");
    assert_eq!(picture.pixels.get(3), Some(&0));

    let without = converted(&Options {
        thumbnail: false,
        ..options
    });
    let picture_bytes = with.len() - start;
    assert_eq!(without.len(), with.len() - picture_bytes - 32);
    assert!(picture_bytes < 6000, "{picture_bytes}");
    let plain = Document::open(&without, Limits::default()).unwrap();
    assert!(plain.header().section(SectionKind::Thumbnail).is_err());
}
