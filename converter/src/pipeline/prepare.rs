//! From a file to the surface to convert: imported, welded, without triangles that there are too many of, and manifold.

use super::frame::{self, Frame};
use super::measure::MEASURED_SAMPLES;
use super::{Conversion, ConvertError};
use crate::atlas::{build, quantize};
use crate::cluster;
use crate::import::{self, ImportReport};
use crate::memory;
use crate::mesh::account::Account;
use crate::mesh::bounds;
use crate::mesh::decimate::{self, Aimed, Goal};
use crate::mesh::{self, ImportedMesh, ManifoldMesh, WeldedMesh, normals};
use crate::report::{ErrorReport, LayoutReport};
use crate::texture::stage::Textures;
use glam::DVec3;
use marquetry_evaluation::distance;
use marquetry_format::writer::ColourInput;
use std::borrow::Cow;

/// An import, ready to be converted.
pub(super) struct Prepared<'a> {
    pub(super) mesh: ManifoldMesh,
    pub(super) account: Account,
    pub(super) frame: Frame,
    pub(super) origin: Origin<'a>,
    /// Whether charts are of no use, or not wanted.
    pub(super) without_charts: bool,
}

/// What the result is to be measured against.
pub(super) enum Origin<'a> {
    /// The mesh before it was decimated.
    Kept(&'a WeldedMesh),
    /// The mesh that is converted, and points of the one before it was decimated.
    Gone(Vec<DVec3>),
}

/// What was made of a surface.
pub(super) struct Built {
    pub(super) account: Account,
    pub(super) frame: Frame,
    pub(super) atlas: build::Atlas,
    pub(super) colour: Option<ColourInput>,
    pub(super) layout: LayoutReport,
    pub(super) clusters: Option<cluster::Layer>,
    pub(super) error: ErrorReport,
}

/// Part of the target that decimation and rounding to the lattice together are to take.
const AIM: f64 = 0.965;
/// The same where the source is not kept: there is no second attempt.
const AIM_NOT_KEPT: f64 = 0.93;
/// At least so much closer the next attempt is after one above the target.
const STEP: f64 = 0.95;
/// An attempt that is to keep less than this part of the target leaves all triangles.
const LEAST: f64 = 0.5;

impl Conversion<'_> {
    /// Makes what will be written of an import; with more triangles, where that is above the target.
    pub(super) fn built(
        &mut self,
        imported: ImportedMesh,
        textures: &Textures,
    ) -> Result<Built, ConvertError> {
        let has_colours = !imported.colours.is_empty();
        self.begin("weld")?;
        let (mut welded, mut account) = mesh::weld(imported).map_err(|e| e.in_file(self.input))?;
        let has_images = textures.has_images();
        let is_plain = !has_colours && !has_images;
        let mut without_charts = !self.options.charts.of(has_colours && !has_images);
        let mut gone = Vec::new();
        if is_plain {
            let is_torn = decimate::is_torn(&welded);
            without_charts = without_charts || is_torn;
            let most = self.options.decimate_above;
            if without_charts && self.may_keep(&welded) {
                return self.built_of((&welded, is_torn), &account, textures, AIM);
            } else if without_charts {
                self.begin("decimate")?;
                gone = distance::samples(welded.surface(), MEASURED_SAMPLES)
                    .map_err(|source| self.unmeasured(source))?;
                let wanted = self.decimated_rms(&welded, AIM_NOT_KEPT);
                let aimed = decimate::aimed(Cow::Owned(welded), wanted, is_torn);
                (welded, account.decimated) = (aimed.mesh, aimed.decimated);
            } else if welded.triangles.len() > most {
                self.begin("decimate")?;
                let goal = Goal::for_charts(self.target(&welded), most / 2);
                (account.decimated, gone) = decimate::decimate(&mut welded, goal);
            }
        }
        let prepared = self.oriented(
            welded,
            account,
            has_colours,
            Origin::Gone(gone),
            without_charts,
        )?;
        self.build(prepared, textures)
    }

    /// What will be written of `source`, which may be torn, as clusters, decimated for the part `aim` of the target; for less where that comes out above the target.
    fn built_of(
        &mut self,
        (source, is_torn): (&WeldedMesh, bool),
        account: &Account,
        textures: &Textures,
        mut aim: f64,
    ) -> Result<Built, ConvertError> {
        loop {
            self.begin("decimate")?;
            let mut account = account.clone();
            let wanted = self.decimated_rms(source, aim);
            let Aimed {
                mesh,
                normals,
                decimated,
            } = if aim < LEAST || wanted <= 0.0 {
                Aimed::whole(source.clone())
            } else {
                decimate::aimed(Cow::Borrowed(source), wanted, is_torn)
            };
            account.decimated = decimated;
            let has_less = decimated.triangles > 0;
            let found = (!normals.is_empty()).then(|| (mesh.positions.clone(), normals));
            let mut prepared = self.oriented(mesh, account, false, Origin::Kept(source), true)?;
            if let Some((places, normals)) = found {
                normals::take_over(&mut prepared.mesh, &places, &normals);
            }
            let built = self.build(prepared, textures)?;
            let over = built.error.rms_rel / built.error.target_rel;
            if over <= 1.0 || !has_less {
                return Ok(built);
            }
            aim *= STEP / over;
        }
    }

    /// Whether there is room for a mesh beside what is made of it.
    fn may_keep(&self, mesh: &WeldedMesh) -> bool {
        let triangles = mesh.triangles.len();
        let fits = memory::of_kept(triangles as u64) <= self.options.memory_bytes;
        triangles <= self.options.keep_up_to && fits
    }

    /// RMS distance that decimation may take, a length, where `aim` is the part of the target for it and for rounding to the lattice.
    fn decimated_rms(&self, source: &WeldedMesh, aim: f64) -> f64 {
        let target = self.target(source);
        let (min, max) = bounds(&source.positions);
        let rounding = frame::rounding(&quantize::lattice(min, max, target));
        ((aim * target).powi(2) - rounding.powi(2)).max(0.0).sqrt()
    }

    /// RMS error wanted, a length.
    fn target(&self, mesh: &WeldedMesh) -> f64 {
        let (min, max) = bounds(&mesh.positions);
        self.options.error_rel * (max - min).length()
    }

    fn oriented<'a>(
        &mut self,
        welded: WeldedMesh,
        mut account: Account,
        has_colours: bool,
        origin: Origin<'a>,
        without_charts: bool,
    ) -> Result<Prepared<'a>, ConvertError> {
        self.begin("manifold")?;
        let mesh = mesh::orient(welded, &mut account);
        let frame = Frame::of(
            &mesh,
            self.options.error_rel,
            has_colours,
            account.decimated,
            without_charts,
        );
        Ok(Prepared {
            without_charts: without_charts && !frame.is_thread(&mesh),
            mesh,
            account,
            frame,
            origin,
        })
    }

    pub(super) fn import(&mut self) -> Result<(ImportedMesh, ImportReport), ConvertError> {
        if let Some(triangles) = import::announced_triangles(self.input) {
            self.refuse_too_large(triangles)?;
        }
        self.begin("import")?;
        let (mesh, report) = import::import(self.input)?;
        self.refuse_too_large(report.triangles)?;
        self.refuse_non_finite(&mesh)?;
        Ok((mesh, report))
    }

    /// Refuses what is known not to fit before memory is taken for it.
    fn refuse_too_large(&self, triangles: u64) -> Result<(), ConvertError> {
        let (needed, allowed) = (memory::estimate(triangles), self.options.memory_bytes);
        if needed <= allowed {
            return Ok(());
        }
        Err(ConvertError::TooLarge {
            path: self.input.to_owned(),
            triangles,
            needed,
            allowed,
        })
    }

    fn refuse_non_finite(&self, mesh: &ImportedMesh) -> Result<(), ConvertError> {
        let mut bad = (0..mesh.positions.len()).filter(|&v| !mesh::is_place(mesh.positions[v]));
        match bad.next() {
            Some(first) if !self.options.allow_worse => Err(ConvertError::NotFinite {
                path: self.input.to_owned(),
                first,
                count: 1 + bad.count(),
            }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Charts, Options, Progress, Stages};
    use super::*;
    use std::path::Path;

    struct Quiet;

    impl Progress for Quiet {
        fn stage(&self, _: &'static str) {}
        fn fraction(&self, _: f64) {}
    }

    /// A square with waves, of two triangles for each of `cells`² cells.
    fn waves(cells: u32) -> ImportedMesh {
        let side = cells + 1;
        let mut mesh = ImportedMesh::default();
        for k in 0..side * side {
            let [x, y] = [k % side, k / side].map(|n| f64::from(n) / f64::from(cells));
            let height = 0.03 * (20.0 * x).sin() * (14.0 * y).cos();
            mesh.positions.push(DVec3::new(x, y, height));
        }
        for k in 0..cells * cells {
            let a = k / cells * side + k % cells;
            mesh.triangles
                .extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
        }
        mesh
    }

    fn conversion(options: &Options) -> Conversion<'_> {
        Conversion {
            input: Path::new("waves"),
            output: Path::new("waves.marq"),
            options,
            stages: Stages::new(&Quiet),
            threads: 1,
        }
    }

    #[test]
    fn what_is_not_kept_is_measured_all_the_same() {
        let kept = Options {
            error_rel: 2e-4,
            charts: Charts::Never,
            ..Options::default()
        };
        let lean = Options {
            memory_bytes: memory::of_kept(2 * 150 * 150) - 1,
            ..kept.clone()
        };
        let few = Options {
            keep_up_to: 2 * 150 * 150 - 1,
            ..kept.clone()
        };
        for (options, is_kept) in [(kept, true), (lean, false), (few, false)] {
            let mut conversion = conversion(&options);
            let mut imported = waves(150);
            let source = imported.clone();
            let textures = Textures::take(&mut imported, 1 << 30).unwrap();
            let (welded, _) = mesh::weld(imported.clone()).unwrap();
            assert_eq!(conversion.may_keep(&welded), is_kept);
            if options.memory_bytes < Options::default().memory_bytes {
                // The ceiling is one of the process, which other tests share.
                continue;
            }
            let built = conversion.built(imported, &textures).unwrap();
            assert!(built.account.decimated.triangles > 30_000);
            let error = built.error;
            assert!(error.rms_rel <= error.target_rel, "{error:?}");
            assert!(error.rms_rel >= 0.75 * error.target_rel, "{error:?}");
            assert!(error.max_rel >= error.hausdorff_rel);
            // What is said is so: the finest surface against the source itself.
            let layer = built.clusters.unwrap();
            let (mut positions, mut triangles) = (Vec::new(), Vec::new());
            let lattice = &built.frame.lattice;
            cluster::append_finest(&layer.nodes, lattice, &mut positions, &mut triangles);
            let of = |positions, triangles| distance::Mesh {
                positions,
                triangles,
            };
            let source = of(&source.positions, &source.triangles);
            let found = distance::measure(of(&positions, &triangles), source, 50_000).unwrap();
            let diagonal = built.frame.diagonal;
            assert!(found.rms() <= 1.03 * error.rms_rel * diagonal, "{found:?}");
            assert!(found.hausdorff() <= error.max_rel * diagonal);
        }
    }

    #[test]
    fn what_comes_out_too_coarse_is_made_anew_with_more() {
        let options = Options {
            error_rel: 2e-4,
            charts: Charts::Never,
            ..Options::default()
        };
        let mut imported = waves(150);
        let textures = Textures::take(&mut imported, 1 << 30).unwrap();
        let (welded, account) = mesh::weld(imported).unwrap();
        for (aim, again) in [(AIM, false), (2.0, true)] {
            let mut conversion = conversion(&options);
            let built = conversion
                .built_of((&welded, false), &account, &textures, aim)
                .unwrap();
            let error = built.error;
            assert!(error.rms_rel <= error.target_rel, "{error:?}");
            assert!(error.rms_rel >= 0.8 * error.target_rel, "{error:?}");
            assert!(error.max_rel >= error.hausdorff_rel);
            assert!(error.max_rel <= 2.6 * error.hausdorff_rel, "{error:?}");
            let stages = conversion.stages.reports.iter();
            let attempts = stages.filter(|stage| stage.name == "decimate").count();
            assert_eq!(attempts > 1, again, "{attempts} attempts");
        }
    }
}
