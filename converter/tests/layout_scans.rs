//! What the layout of a whole scan comes to.

use marquetry_converter::pipeline::{Charts, Options, Progress, convert};
use std::path::{Path, PathBuf};

struct Quiet;

impl Progress for Quiet {
    fn stage(&self, _name: &'static str) {}
    fn fraction(&self, _done: f64) {}
}

/// A scan of `../shared/data`; where it is absent says so.
fn scan(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("ignored: {} is not there", path.display());
    None
}

#[test]
#[cfg_attr(debug_assertions, ignore = "minutes without optimisation")]
fn the_dragons_handles_are_cut_and_no_protrusion_is_lost() {
    let Some(input) = scan("dragon_vrip.ply") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("dragon.marq");
    let options = Options {
        charts: Charts::Always,
        ..Options::default()
    };
    let report = convert(&input, &output, &options, &Quiet).unwrap();
    let (layout, error) = (&report.layout, &report.error);
    println!(
        "{layout:?}\n{error:?}\n{:?}\n{:?}",
        report.output, report.stages
    );
    // They were 1 270 before handles were cut.
    assert!(layout.regions <= 120, "{} regions", layout.regions);
    assert!(layout.fingers_cut >= 8, "{} fingers", layout.fingers_cut);
    assert!(layout.handles_cut >= 50, "{} handles", layout.handles_cut);
    assert!(error.rms_rel <= 1e-4, "{error:?}");
    assert!(error.hausdorff_rel <= error.max_rel, "{error:?}");
    assert!(error.hausdorff_rel <= 3e-3, "{error:?}");
    // Caps are within the stated bound, and no part of the input.
    assert!(layout.cap_distance_rel <= error.max_rel, "{layout:?}");
    assert_eq!(report.input.triangles, 871_414);
    assert_eq!(report.lost.triangles, 108);
}
