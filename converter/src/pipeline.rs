//! The whole way from a mesh file to a `.marq` file.

mod charts;
mod error;
mod frame;
mod measure;
mod options;
mod prepare;
mod stages;

pub use error::ConvertError;
pub use options::{Charts, Options, Up};

use crate::atlas::{build, quantize};
use crate::cluster::{self, Room, select::Selection};
use crate::import::ImportReport;
use crate::memory;
use crate::mesh::ManifoldMesh;
use crate::mesh::account::Account;
use crate::output::PendingFile;
use crate::process;
use crate::report::{FitReport, InputReport, Lost, Merged, OutputReport, Report};
use crate::texture::build::TextureError;
use crate::texture::stage::{TextureReport, Textures};
use crate::thumbnail;
use charts::Charted;
use frame::Frame;
use marquetry_evaluation::distance;
use marquetry_format::reader::Document;
use marquetry_format::source::FileSource;
use marquetry_format::{ColourIndex, ContentKind, Limits, Metadata, writer};
use measure::TRIM_AIM;
use prepare::{Built, Origin, Prepared};
use stages::Stages;
use std::io::Write;
use std::path::Path;

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
        let Built {
            account,
            frame,
            atlas,
            colour,
            layout,
            clusters,
            error,
        } = self.built(imported, &textures)?;
        self.judge(&error)?;

        let metadata = Metadata {
            kind: ContentKind::Scan,
            lattice: frame.lattice,
            bounds_min: frame.min.to_array(),
            bounds_max: frame.max.to_array(),
            up_axis: self.options.up as u8,
            has_colours: frame.has_colours,
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
        let content = writer::Content {
            charts: &atlas.charts,
            clusters: clusters.as_ref().map_or(&[], |layer| &layer.nodes),
            colour: colour.as_ref(),
            thumbnail: None,
        };
        let thumbnail = self.thumbnail(&content, &metadata)?;
        self.begin("write")?;
        let content = writer::Content {
            thumbnail: thumbnail.as_deref(),
            ..content
        };
        let mut textures = textures.report();
        let output = self.write(
            file,
            &metadata,
            &content,
            &atlas,
            clusters.as_ref(),
            &mut textures,
        )?;
        self.stages.end();
        Ok(Report {
            input: self.input_report(&import_report, &account),
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

    /// What is made of a surface, measured against what it came from.
    fn build(
        &mut self,
        prepared: Prepared<'_>,
        textures: &Textures,
    ) -> Result<Built, ConvertError> {
        let Prepared {
            mesh,
            account,
            frame,
            origin,
            without_charts,
        } = prepared;
        let mut selection = cluster::select::select(mesh);
        if without_charts && selection.can_take_all() {
            selection.take_all(usize::MAX);
        }
        let most_samples = if selection.can_take_all() {
            (selection.rest.triangles.len() as u64)
                .saturating_mul(self.options.samples_per_triangle)
        } else {
            u64::MAX
        };
        let caps = self.cut(&mut selection, textures, &frame)?;
        let charts = self.charts(&selection.rest, &caps, textures, &frame, most_samples)?;
        let charts = charts.unwrap_or_else(|| {
            selection.take_all(caps.source_triangles);
            Charted::default()
        });
        let Charted {
            atlas,
            colour,
            layout,
        } = charts;
        // Caps are no part of the source.
        selection.rest.triangles.truncate(caps.source_triangles);
        let Selection {
            rest: surface,
            mut small,
            mut components,
        } = selection;
        let mut clusters = if components.is_empty() {
            None
        } else {
            Some(self.clusters(&mut small, &mut components, textures, &frame)?)
        };

        self.begin("measure")?;
        // What is left to do with the mesh is to measure against it.
        let error = match origin {
            Origin::Kept(source) => {
                drop((surface, small));
                self.measured(source.surface(), &[], &atlas, clusters.as_mut(), &frame)?
            }
            Origin::Gone(gone) => {
                let (positions, triangles) = cluster::select::joined(surface, &small);
                drop(small);
                let source = distance::Mesh {
                    positions: &positions,
                    triangles: &triangles,
                };
                self.measured(source, &gone, &atlas, clusters.as_mut(), &frame)?
            }
        };
        Ok(Built {
            account,
            frame,
            atlas,
            colour,
            layout,
            clusters,
            error,
        })
    }

    /// The tree of `components`, lists of triangles of `small`, with its textures.
    fn clusters(
        &mut self,
        small: &mut ManifoldMesh,
        components: &mut [Vec<u32>],
        textures: &Textures,
        frame: &Frame,
    ) -> Result<cluster::Layer, ConvertError> {
        self.begin("cluster")?;
        let mut needs = textures
            .needs_of(&small.positions, &small.triangles)
            .map_err(|source| self.texture_error(source.into()))?;
        cluster::refine::refine(small, components, &mut needs, Room::MOST_TEXELS);
        let mut layer =
            cluster::build(small, components, &frame.lattice, frame.has_colours, &needs);
        layer.add_error(frame.decimated.bound);
        // Colours and images may change where the surface does not.
        if !frame.has_colours && !textures.has_images() {
            layer.trim(frame.trimmed_rms(TRIM_AIM), frame.most_distance());
        }
        if textures.has_images() {
            self.begin("cluster-textures")?;
            let progress = self.stages.progress;
            textures
                .paint(&mut layer.nodes, &frame.lattice, &|done| {
                    progress.fraction(done);
                })
                .map_err(|source| self.texture_error(source))?;
            layer.count();
        }
        Ok(layer)
    }

    fn input_report(&self, import: &ImportReport, account: &Account) -> InputReport {
        InputReport {
            path: self.input.display().to_string(),
            bytes: import.bytes,
            triangles: import.triangles,
            vertices: import.vertices,
            components: account.topology.components,
            boundary_loops: account.topology.boundary_loops,
            non_manifold_edges: account.topology.non_manifold_edges,
            t_junctions: account.t_junctions,
            decimated: account.decimated.triangles,
        }
    }

    fn texture_error(&self, source: TextureError) -> ConvertError {
        ConvertError::Textures {
            path: self.input.to_owned(),
            source,
        }
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

    /// A picture of what is to be written, if one is asked for.
    fn thumbnail(
        &mut self,
        content: &writer::Content<'_>,
        metadata: &Metadata,
    ) -> Result<Option<Vec<u8>>, ConvertError> {
        if !self.options.thumbnail {
            return Ok(None);
        }
        self.begin("thumbnail")?;
        let picture = thumbnail::draw(content, metadata);
        picture.map(Some).map_err(|source| ConvertError::Thumbnail {
            path: self.input.to_owned(),
            source,
        })
    }

    /// Writes beside the output, reads back, syncs, renames.
    fn write(
        &self,
        mut file: PendingFile,
        metadata: &Metadata,
        content: &writer::Content<'_>,
        atlas: &build::Atlas,
        clusters: Option<&cluster::Layer>,
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
            let bytes = writer::write(metadata, &metadata.lattice, content, &mut out)
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
        let nodes = clusters.iter().flat_map(|layer| &layer.nodes);
        for texture in nodes.filter_map(|node| node.mesh.texture.as_ref()) {
            textures.clusters += 1;
            textures.cluster_bytes += texture.frame.len() as u64;
        }
        let resolutions = atlas
            .charts
            .iter()
            .map(|c| quantize::finest_resolution(&c.root));
        let depths = document.clusters.iter().flat_map(|graph| &graph.nodes);
        let depth = depths.map(|node| node.level).max().unwrap_or(0);
        let deepest = resolutions.max().unwrap_or(depth);
        file.persist().map_err(failed)?;
        Ok(OutputReport {
            path: self.output.display().to_string(),
            bytes: bytes.total,
            pages: document.stored_page_count(),
            charts: document.charts.len(),
            levels: u32::from(deepest) + 1,
            samples: atlas.samples,
            clusters: clusters.map(|layer| layer.summary).unwrap_or_default(),
        })
    }
}
