//! The whole way from a mesh file to a `.marq` file.

use crate::atlas::patch::Patch;
use crate::atlas::{build, chart_graph, quantize};
use crate::cluster::{self, select::Selection};
use crate::error::ImportError;
use crate::import::{self, ImportReport};
use crate::memory;
use crate::mesh::{self, ImportedMesh, ManifoldMesh, NONE};
use crate::output::PendingFile;
use crate::parameterize::{self, Parametrization};
use crate::process;
use crate::quadrangulate::{self, Layout, QuadrangulateError};
use crate::report::{
    AreaReport, ErrorReport, FitReport, InputReport, LayoutReport, Lost, Merged, OutputReport,
    Report, StageReport,
};
use crate::segment::{self, Segmentation};
use crate::texture::build::TextureError;
use crate::texture::stage::{TextureReport, Textures};
use glam::DVec3;
use marquetry_evaluation::distance;
use marquetry_format::reader::Document;
use marquetry_format::source::FileSource;
use marquetry_format::writer::ColourInput;
use marquetry_format::{ColourIndex, ContentKind, Lattice, Limits, Metadata, writer};
use rayon::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Which axis points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Up {
    /// x.
    X,
    /// y.
    #[default]
    Y,
    /// z.
    Z,
}

/// What a conversion is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// Target RMS error, relative to the diagonal of the bounds; > 0.
    pub error_rel: f64,
    /// Write the file even where the target is missed.
    pub allow_worse: bool,
    /// Which axis points up.
    pub up: Up,
    /// Ceiling of working memory in bytes; what needs more is refused ([`crate::memory`]).
    pub memory_bytes: u64,
    /// Threads; `None` for all.
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            error_rel: 1e-4,
            allow_worse: false,
            up: Up::Y,
            memory_bytes: 4 << 30,
            threads: None,
        }
    }
}

/// Told how a conversion goes. Called from many threads.
pub trait Progress: Sync {
    /// A stage begins.
    fn stage(&self, name: &'static str);
    /// How much of the stage is done, 0..=1.
    fn fraction(&self, done: f64);
    /// The resident set of `used` bytes is about to pass the ceiling. A program that is to keep it ends here: nothing is
    /// lost, what was written so far is gone already. Where this returns, the conversion fails at the end of the stage.
    fn over_memory(&self, error: &ConvertError) {
        let _ = error;
    }
}

/// A conversion that failed. Nothing was written under the output's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The input cannot be read as a mesh.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The surface could not be cut into charts.
    #[error("{path}: the surface cannot be cut into charts: {source}")]
    Layout {
        /// The input.
        path: PathBuf,
        /// Why.
        source: QuadrangulateError,
    },
    /// The target was missed.
    #[error(
        "{path}: the error reached is {reached:.2e} of the diagonal, the target is {target:.2e}; \
         ask for less with --error-rel, or accept it with --allow-worse"
    )]
    AboveTarget {
        /// The input.
        path: PathBuf,
        /// RMS error, relative.
        reached: f64,
        /// Target, relative.
        target: f64,
    },
    /// The input needs more memory than it may have.
    #[error(
        "{path}: needs more than the {} MiB of memory allowed ({} MiB at stage {stage}); allow more with --memory, \
         or ask for less with --error-rel", allowed >> 20, used >> 20
    )]
    Memory {
        /// The input.
        path: PathBuf,
        /// The stage that took it.
        stage: &'static str,
        /// Bytes taken.
        used: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// The input is known to need more memory than it may have; none was taken for it.
    #[error(
        "{path}: {triangles} triangles need about {} MiB of memory, but only {} MiB are allowed; allow more with --memory, \
         or simplify or split the input", needed >> 20, allowed >> 20
    )]
    TooLarge {
        /// The input.
        path: PathBuf,
        /// Its triangles.
        triangles: u64,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// Vertices without a place.
    #[error(
        "{path}: vertex {first} (counted from 0) is not finite (NaN or infinite), as {count} in all are; \
         repair the file, or drop the triangles that touch them with --allow-worse"
    )]
    NotFinite {
        /// The input.
        path: PathBuf,
        /// The first such vertex.
        first: usize,
        /// How many there are.
        count: usize,
    },
    /// The textures cannot be used.
    #[error("{path}: {source}")]
    Textures {
        /// The input.
        path: PathBuf,
        /// Why.
        source: TextureError,
    },
    /// The result could not be measured.
    #[error("{path}: the result cannot be measured: {source}")]
    Measure {
        /// The input.
        path: PathBuf,
        /// Why.
        source: distance::MeshError,
    },
    /// The target is no positive number.
    #[error("the target error must be a number above 0 and at most 1, not {0}")]
    Target(f64),
    /// The output cannot be written.
    #[error("{path}: cannot be written")]
    Output {
        /// The output.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file written is not what was meant: our fault.
    #[error("{path}: the file written does not read back: {source}")]
    Format {
        /// The output.
        path: PathBuf,
        /// Why.
        source: marquetry_format::Error,
    },
    /// Threads could not be started.
    #[error("cannot start threads: {0}")]
    Threads(String),
}

/// Converts the scan at `input` to a file at `output`, which appears complete or not at all.
///
/// The same bytes come out for any number of threads.
///
/// # Errors
/// See [`ConvertError`].
pub fn convert(
    input: &Path,
    output: &Path,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Report, ConvertError> {
    if !(options.error_rel > 0.0 && options.error_rel <= 1.0) {
        return Err(ConvertError::Target(options.error_rel));
    }
    let threads = options
        .threads
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| ConvertError::Threads(e.to_string()))?;
    pool.install(|| {
        Conversion {
            input,
            output,
            options,
            stages: Stages::new(progress),
            threads,
        }
        .run()
    })
}

/// Regions wanted: about 30 for 100 k triangles, 250 for 5 M, and three for every handle.
///
/// Handles force regions of their own whatever is wanted; asking for too few makes the others ragged (the dragon, 55
/// handles: 12% of its area lies in ragged regions at 120 wanted, 2% at 250).
fn target_regions(triangles: usize, handles: usize) -> u32 {
    let regions = 30.0 * (triangles as f64 / 1e5).powf(0.55) + 3.0 * handles as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let regions = regions.round().clamp(4.0, 1e6) as u32;
    regions
}

/// Handles are cut where a cap stays within so many targets of the surface.
const CAP_OVER_TARGET: f64 = 25.0;

/// Part of the squared error that all caps together may take. Two round caps of radius r add about 2 r⁴ to its integral.
const CAP_SHARE: f64 = 0.06;

/// Rounds of splitting regions at protrusions; each halves what is left of them.
const SPLIT_ROUNDS: u32 = 3;

/// Samples of the measurement of the written file, each way, beside all vertices.
const MEASURED_SAMPLES: u64 = 100_000;

struct Stages<'a> {
    progress: &'a dyn Progress,
    reports: Vec<StageReport>,
    started: Instant,
    running: Option<(&'static str, Instant, f64)>,
    /// Name of the stage that runs, for other threads.
    name: Arc<Mutex<&'static str>>,
}

impl<'a> Stages<'a> {
    fn new(progress: &'a dyn Progress) -> Self {
        Self {
            progress,
            reports: Vec::new(),
            started: Instant::now(),
            running: None,
            name: Arc::new(Mutex::new("start")),
        }
    }

    fn begin(&mut self, name: &'static str) {
        self.end();
        self.progress.stage(name);
        self.running = Some((name, Instant::now(), process::cpu_seconds()));
        if let Ok(mut shared) = self.name.lock() {
            *shared = name;
        }
    }

    fn shared_name(&self) -> Arc<Mutex<&'static str>> {
        Arc::clone(&self.name)
    }

    /// The stage that runs, or ran last.
    fn name(&self) -> &'static str {
        self.running.map_or("start", |(name, ..)| name)
    }

    fn end(&mut self) {
        if let Some((name, since, cpu)) = self.running.take() {
            self.reports.push(StageReport {
                name,
                seconds: since.elapsed().as_secs_f64(),
                cpu_seconds: process::cpu_seconds() - cpu,
                peak_rss_bytes: process::peak_rss_bytes(),
            });
        }
    }
}

struct Conversion<'a> {
    input: &'a Path,
    output: &'a Path,
    options: &'a Options,
    stages: Stages<'a>,
    threads: usize,
}

impl Conversion<'_> {
    fn run(self) -> Result<Report, ConvertError> {
        // Now rather than after all the work, lest the output cannot be written.
        let file = PendingFile::create(self.output).map_err(|source| ConvertError::Output {
            path: self.output.to_owned(),
            source,
        })?;
        let temporary = file.path().to_owned();
        let stage = self.stages.shared_name();
        let (path, allowed, progress) =
            (self.input, self.options.memory_bytes, self.stages.progress);
        let over = move |used| {
            // The process may end here.
            let _ = std::fs::remove_file(&temporary);
            progress.over_memory(&ConvertError::Memory {
                path: path.to_owned(),
                stage: stage.lock().map_or("start", |name| *name),
                used,
                allowed,
            });
        };
        memory::watch(allowed, over, || self.run_watched(file))
    }

    fn run_watched(mut self, file: PendingFile) -> Result<Report, ConvertError> {
        let (mut imported, import_report) = self.import()?;
        let textures = Textures::take(&mut imported, self.options.memory_bytes)
            .map_err(|source| self.texture_error(source.into()))?;
        let has_colours = !imported.colours.is_empty();
        self.begin("manifold")?;
        let (mesh, account) = mesh::prepare(imported).map_err(|e| e.in_file(self.input))?;
        let (min, max) = bounds(&mesh.positions);
        let diagonal = (max - min).length();
        let target = self.options.error_rel * diagonal;

        let lattice = quantize::lattice(min, max, target);
        let Selection {
            rest: mut surface,
            small,
            components,
        } = cluster::select::select(mesh);
        self.begin("handles")?;
        let source_triangles = surface.triangles.len();
        let reach = cap_reach(&surface, target);
        let cut = mesh::handles::cut(&mut surface, reach);
        let (atlas, colour, layout) =
            self.atlas(&surface, &textures, cut, (min, max), lattice, has_colours)?;
        // Caps are no part of the source.
        surface.triangles.truncate(source_triangles);
        let clusters = if components.is_empty() {
            None
        } else {
            self.begin("cluster")?;
            Some(cluster::build(&small, &components, &lattice, has_colours))
        };

        self.begin("measure")?;
        // What is left to do with the mesh is to measure against it.
        let (positions, triangles) = cluster::select::joined(surface, &small);
        drop(small);
        let source = distance::Mesh {
            positions: &positions,
            triangles: &triangles,
        };
        let error = self.judge(source, &atlas, clusters.as_ref(), &lattice, diagonal)?;
        drop((positions, triangles));

        self.begin("write")?;
        let metadata = Metadata {
            kind: ContentKind::Scan,
            lattice,
            bounds_min: min.to_array(),
            bounds_max: max.to_array(),
            up_axis: self.options.up as u8,
            has_colours,
            target_error_rel: error.target_rel,
            max_error_rel: error.max_rel,
            rms_error_rel: error.rms_rel,
            source_triangles: import_report.triangles,
            source_vertices: import_report.vertices,
            source_name: self
                .input
                .file_name()
                .map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default(),
            generator: concat!("marquetry ", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        let mut textures = textures.report();
        let output = self.write(
            file,
            &metadata,
            &atlas,
            clusters.as_ref(),
            colour.as_ref(),
            &mut textures,
        )?;
        self.stages.end();
        Ok(Report {
            input: InputReport {
                path: self.input.display().to_string(),
                bytes: import_report.bytes,
                triangles: import_report.triangles,
                vertices: import_report.vertices,
                components: account.topology.components,
                boundary_loops: account.topology.boundary_loops,
                non_manifold_edges: account.topology.non_manifold_edges,
                t_junctions: account.t_junctions,
            },
            layout,
            output,
            seconds: self.stages.started.elapsed().as_secs_f64(),
            stages: self.stages.reports,
            cpu_seconds: process::cpu_seconds(),
            peak_rss_bytes: process::peak_rss_bytes(),
            threads: self.threads,
            error,
            fit: FitReport {
                points: atlas.points,
                kept: atlas.kept,
            },
            lost: Lost::of(&account),
            merged: Merged::of(&account),
            textures,
        })
    }

    /// Charts of `mesh`, all the way to their samples; none where it has no triangles.
    fn atlas(
        &mut self,
        mesh: &ManifoldMesh,
        textures: &Textures,
        cut: mesh::handles::Cut,
        (min, max): (DVec3, DVec3),
        lattice: Lattice,
        colours: bool,
    ) -> Result<(build::Atlas, Option<ColourInput>, LayoutReport), ConvertError> {
        if mesh.triangles.is_empty() {
            return Ok((build::Atlas::default(), None, LayoutReport::default()));
        }
        let diagonal = (max - min).length();
        self.begin("segment")?;
        let segmentation =
            segment::segment(mesh, target_regions(mesh.triangles.len(), handles(mesh)));
        self.begin("quadrangulate")?;
        let Layout {
            mut patches,
            borders,
            regions,
            ..
        } = self.layout(mesh, segmentation)?;
        let layout = LayoutReport {
            regions,
            chart_area: AreaReport::of(patches.par_iter().map(Patch::area).collect()),
            handles_cut: cut.handles,
            cap_triangles: cut.cap_triangles,
            cap_distance_rel: cut.distance / diagonal.max(f64::MIN_POSITIVE),
        };
        chart_graph::sort_along_curve(
            &mut patches,
            min,
            (max - min).max_element().max(f64::MIN_POSITIVE),
        );
        let glue = chart_graph::glue(&patches, borders.len());

        self.begin("parametrize")?;
        let parametrizations: Vec<Parametrization> = patches
            .par_iter_mut()
            .map(|patch| parameterize::parameterize(patch, &borders))
            .collect();

        self.begin("resample")?;
        let progress = self.stages.progress;
        let atlas = build::build(
            &build::Surface {
                patches: &patches,
                parametrizations: &parametrizations,
                borders: &borders,
                glue: &glue,
                lattice,
                colours,
                target: self.options.error_rel * diagonal,
                cap_distance: cut.distance,
            },
            &|done| progress.fraction(done),
        );
        if textures.has_images() {
            self.begin("textures")?;
        }
        let colour = textures
            .tiles(&patches, &parametrizations, &glue, &|done| {
                progress.fraction(done);
            })
            .map_err(|source| self.texture_error(source))?;
        Ok((atlas, colour, layout))
    }

    /// Quads of the regions; regions with protrusions that no flattening shows are split.
    fn layout(
        &self,
        mesh: &ManifoldMesh,
        mut segmentation: Segmentation,
    ) -> Result<Layout, ConvertError> {
        let quadrangulate = |segmentation: &Segmentation| {
            quadrangulate::quadrangulate(mesh, segmentation).map_err(|source| {
                ConvertError::Layout {
                    path: self.input.to_owned(),
                    source,
                }
            })
        };
        let mut layout = quadrangulate(&segmentation)?;
        let mut split = vec![false; mesh.positions.len()];
        for _ in 0..SPLIT_ROUNDS {
            if layout.specks.is_empty() {
                break;
            }
            let Some(parts) = segment::split_at(mesh, &segmentation, &layout.specks, &mut split)
            else {
                break;
            };
            segmentation = parts;
            layout = quadrangulate(&segmentation)?;
        }
        if !layout.specks.is_empty() {
            tracing::warn!(
                regions = layout.specks.len(),
                "protrusions stay that are too long to be sampled well"
            );
        }
        Ok(layout)
    }

    fn import(&mut self) -> Result<(ImportedMesh, ImportReport), ConvertError> {
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

    fn texture_error(&self, source: TextureError) -> ConvertError {
        ConvertError::Textures {
            path: self.input.to_owned(),
            source,
        }
    }

    fn refuse_non_finite(&self, mesh: &ImportedMesh) -> Result<(), ConvertError> {
        let mut bad = (0..mesh.positions.len()).filter(|&v| !mesh.positions[v].is_finite());
        match bad.next() {
            Some(first) if !self.options.allow_worse => Err(ConvertError::NotFinite {
                path: self.input.to_owned(),
                first,
                count: 1 + bad.count(),
            }),
            _ => Ok(()),
        }
    }

    /// Measures the surface that will be written, and refuses it above the target.
    fn judge(
        &self,
        source: distance::Mesh<'_>,
        atlas: &build::Atlas,
        clusters: Option<&cluster::Layer>,
        lattice: &Lattice,
        diagonal: f64,
    ) -> Result<ErrorReport, ConvertError> {
        let (mut positions, mut triangles) = quantize::finest_surface(&atlas.charts, lattice);
        let mut bound = atlas.max_error;
        if let Some(layer) = clusters {
            cluster::append_finest(&layer.root, lattice, &mut positions, &mut triangles);
            bound = bound.max(layer.max_error);
        }
        let measured = distance::measure(
            distance::Mesh {
                positions: &positions,
                triangles: &triangles,
            },
            source,
            MEASURED_SAMPLES,
        )
        .map_err(|source| ConvertError::Measure {
            path: self.input.to_owned(),
            source,
        })?;
        let relative = |length: f64| {
            if diagonal > 0.0 {
                length / diagonal
            } else {
                0.0
            }
        };
        let error = ErrorReport {
            target_rel: self.options.error_rel,
            // The bound holds for real numbers; rounding must not let it fall below what was seen.
            max_rel: relative(measured.hausdorff().max(bound)),
            rms_rel: relative(measured.rms()),
            hausdorff_rel: relative(measured.hausdorff()),
        };
        if error.rms_rel > error.target_rel && !self.options.allow_worse {
            return Err(ConvertError::AboveTarget {
                path: self.input.to_owned(),
                reached: error.rms_rel,
                target: error.target_rel,
            });
        }
        Ok(error)
    }

    /// Begins a stage, if the last one left memory for it.
    fn begin(&mut self, stage: &'static str) -> Result<(), ConvertError> {
        let (used, allowed) = (process::peak_rss_bytes(), self.options.memory_bytes);
        if used > allowed {
            let stage = self.stages.name();
            return Err(ConvertError::Memory {
                path: self.input.to_owned(),
                stage,
                used,
                allowed,
            });
        }
        self.stages.begin(stage);
        Ok(())
    }

    /// Writes beside the output, reads back, syncs, renames.
    fn write(
        &self,
        mut file: PendingFile,
        metadata: &Metadata,
        atlas: &build::Atlas,
        clusters: Option<&cluster::Layer>,
        colour: Option<&ColourInput>,
        textures: &mut TextureReport,
    ) -> Result<OutputReport, ConvertError> {
        let failed = |source| ConvertError::Output {
            path: self.output.to_owned(),
            source,
        };
        let unreadable = |source| match source {
            marquetry_format::Error::Output(source) => failed(source),
            source => ConvertError::Format {
                path: self.output.to_owned(),
                source,
            },
        };
        let bytes = {
            let mut out = std::io::BufWriter::new(file.as_file_mut());
            let content = writer::Content {
                charts: &atlas.charts,
                clusters: clusters.map(|layer| &layer.root),
                colour,
            };
            let bytes = writer::write(metadata, &metadata.lattice, &content, &mut out)
                .map_err(unreadable)?;
            out.flush().map_err(failed)?;
            bytes
        };
        let source = FileSource::open(file.path()).map_err(|e| failed(std::io::Error::other(e)))?;
        let mut document = Document::open(&source, Limits::default()).map_err(unreadable)?;
        document.load_index(&source).map_err(unreadable)?;
        if let Some(mut index) =
            ColourIndex::of(&document, Limits::default()).map_err(unreadable)?
        {
            index.load(&source).map_err(unreadable)?;
            textures.tiles = index.tile_count();
            textures.bytes = index.bytes();
        }
        let levels = atlas
            .charts
            .iter()
            .map(|c| quantize::finest_resolution(&c.root))
            .max()
            .unwrap_or(0);
        file.persist().map_err(failed)?;
        Ok(OutputReport {
            path: self.output.display().to_string(),
            bytes: bytes.total,
            pages: document.stored_page_count(),
            charts: document.charts.len(),
            levels: u32::from(levels) + 1,
            samples: atlas.samples,
            clusters: clusters.map(|layer| layer.summary).unwrap_or_default(),
        })
    }
}

/// How far from the surface a cap may be, where every handle got such a one.
fn cap_reach(mesh: &ManifoldMesh, target: f64) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    let each = CAP_SHARE * target.powi(2) * total / handles(mesh).max(1) as f64;
    (CAP_OVER_TARGET * target).min((each / 2.0).powf(0.25))
}

/// Handles of all components together, from the Euler characteristic; 0 where cuts make that meaningless.
fn handles(mesh: &ManifoldMesh) -> usize {
    let open = mesh.twins.iter().filter(|&&t| t == NONE).count();
    let edges = mesh.twins.len().midpoint(open);
    let (_, components) = mesh.components();
    let loops = boundary_loops(mesh);
    // V - E + F = 2 (components - handles) - loops
    let vertices_and_faces = mesh.positions.len() + mesh.triangles.len() + loops;
    let doubled = (2 * components as usize + edges).saturating_sub(vertices_and_faces);
    doubled / 2
}

fn boundary_loops(mesh: &ManifoldMesh) -> usize {
    let corner = |h: usize| mesh.triangles[h / 3][h % 3];
    let mut following = vec![NONE; mesh.positions.len()];
    for h in (0..mesh.twins.len()).filter(|&h| mesh.twins[h] == NONE) {
        following[corner(h) as usize] = corner(h / 3 * 3 + (h % 3 + 1) % 3);
    }
    let mut loops = 0;
    for start in 0..following.len() {
        let mut at = start;
        let mut length = 0;
        while following[at] != NONE {
            at = std::mem::replace(&mut following[at], NONE) as usize;
            length += 1;
        }
        loops += usize::from(length > 0);
    }
    loops
}

fn bounds(positions: &[DVec3]) -> (DVec3, DVec3) {
    positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
            (min.min(p), max.max(p))
        })
}
