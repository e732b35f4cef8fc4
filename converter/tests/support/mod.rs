//! Small meshes, and converting them.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]
#![allow(dead_code, reason = "each test uses some of it")]

use glam::DVec3;
use marquetry_converter::pipeline::{ConvertError, Options, Progress, convert};
use marquetry_converter::report::Report;
use marquetry_format::source::FileSource;
use marquetry_format::verify::verify;
use std::f64::consts::TAU;
use std::path::Path;

/// A triangle mesh.
#[derive(Debug, Clone, Default)]
pub(crate) struct Model {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Model {
    pub(crate) fn map(&self, f: impl Fn(DVec3) -> DVec3) -> Self {
        Self {
            positions: self.positions.iter().map(|&p| f(p)).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Binary PLY with coordinates of 64 bits.
    pub(crate) fn ply(&self) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles.len()
        )
        .into_bytes();
        for p in &self.positions {
            bytes.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        for t in &self.triangles {
            bytes.push(3);
            bytes.extend(t.iter().flat_map(|i| i.to_le_bytes()));
        }
        bytes
    }
}

/// A dented torus around z: closed, of one handle.
pub(crate) fn torus(around: u32, along: u32) -> Model {
    let at = |i: u32, j: u32| i % around + j % along * around;
    let mut model = Model::default();
    for j in 0..along {
        for i in 0..around {
            let u = TAU * f64::from(i) / f64::from(around);
            let v = TAU * f64::from(j) / f64::from(along);
            let tube = 0.4 + 0.05 * (3.0 * u).sin() * (2.0 * v).cos();
            let ring = 1.0 + tube * v.cos();
            model
                .positions
                .push(DVec3::new(ring * u.cos(), ring * u.sin(), tube * v.sin()));
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            model.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    model
}

/// An open sheet of `n` by `n` cells over the unit square, at the height that `height` gives.
pub(crate) fn sheet(n: u32, height: impl Fn(f64, f64) -> f64) -> Model {
    let mut model = Model::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            model.positions.push(DVec3::new(x, y, height(x, y)));
        }
    }
    let at = |i: u32, j: u32| i + j * (n + 1);
    for j in 0..n {
        for i in 0..n {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            model.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    model
}

struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str) {}
    fn fraction(&self, _: f64) {}
}

/// Converts the bytes of a mesh file; what comes out is verified, and nothing but it is left in the folder.
pub(crate) fn convert_bytes(
    name: &str,
    bytes: &[u8],
    options: &Options,
) -> Result<Report, ConvertError> {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join(name);
    std::fs::write(&input, bytes).unwrap();
    let output = folder.path().join("out.marq");
    let result = convert(&input, &output, options, &Silent);
    let files = folder.path().read_dir().unwrap().count();
    assert_eq!(
        files,
        1 + usize::from(result.is_ok()),
        "strays in the folder"
    );
    if let Ok(report) = &result {
        assert_verifies(&output);
        assert!(
            report.error.hausdorff_rel <= report.error.max_rel,
            "{report:?}"
        );
        assert!(report.lost.triangles == 0 || !report.lost.reason.is_empty());
        if !options.allow_worse {
            assert!(
                report.error.rms_rel <= report.error.target_rel,
                "{report:?}"
            );
        }
    }
    result
}

pub(crate) fn convert_model(model: &Model, options: &Options) -> Result<Report, ConvertError> {
    convert_bytes("model.ply", &model.ply(), options)
}

fn assert_verifies(file: &Path) {
    let report = verify(&FileSource::open(file).unwrap()).unwrap();
    let failed: Vec<_> = report.checks.iter().filter(|c| !c.ok).collect();
    assert!(report.ok, "{failed:?}");
}
