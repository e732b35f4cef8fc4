//! Targets that nothing reaches: the conversion ends all the same, and says what was reached.

mod support;

use marquetry_converter::pipeline::{ConvertError, Options};
use support::{convert_model, sheet, torus};

/// What costs nothing is left out of clusters whatever the target is, so that there is always less to leave out is no reason to go on.
#[test]
fn a_target_finer_than_the_lattice() {
    for model in [
        torus(96, 48),
        sheet(64, |x, y| 0.1 * (5.0 * x).sin() * y.max(0.5)),
    ] {
        let options = Options {
            error_rel: 1e-12,
            ..Options::default()
        };
        let refused = convert_model(&model, &options).unwrap_err();
        assert!(matches!(refused, ConvertError::AboveTarget { .. }));
        let allowed = Options {
            allow_worse: true,
            ..options
        };
        let report = convert_model(&model, &allowed).unwrap();
        assert!(report.error.rms_rel > 1e-12 && report.error.rms_rel < 1e-6);
    }
}
