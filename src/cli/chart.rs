//! `marquetry chart`: what accuracy costs, in triangles, bytes, frame time and conversion time, beside what one would use instead.

mod conversions;
mod data;
mod equal_cost;
mod external;
mod figures;
mod folder;
mod geometry;
mod lods;
mod page;
mod pictures;
mod quality;
mod row;
mod split;
mod tables;
mod transitions;
mod words;

use super::open::{self, Opened};
use super::output::Output;
use super::progress::Display;
use super::reference::Reference;
use super::{Common, Verdict, args};
use anyhow::{Context, bail};
use clap::builder::RangedU64ValueParser;
use data::{
    Adapter, FileInfo, GeometryPoint, InputInfo, PicturePoint, Report, RowPoint, Settings,
    TransitionPoint,
};
use folder::PendingFolder;
use geometry::Level;
use glam::DVec3;
use marquetry_converter::pipeline::{Charts, Progress, Up};
use marquetry_engine::Viewport;
use marquetry_engine::camera::STANDARD_VIEWS;
use marquetry_format::Metadata;
use marquetry_native::Headless;
use split::SplitMesh;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Bounds of a file and of its input may differ by this part of the diagonal.
const BOUNDS_TOLERANCE: f64 = 0.01;
/// An interval of the RMS wider than this part of it is too few samples.
const WIDE: f64 = 0.05;
/// Fewer views say little of a model.
const FEW_VIEWS: usize = 6;

/// Chart speed against accuracy: one self-contained HTML page, JSON and CSV
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
    /// The scan that it was made of
    #[arg(long, value_name = "INPUT")]
    against: PathBuf,
    /// The folder to write chart.html, chart.json, chart.csv and the plots into
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Samples each way of a distance, beside all vertices
    #[arg(long, value_name = "N", default_value_t = 200_000, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,
    /// Cuts of the file, and levels of the alternatives, each of half the triangles of the one before
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = RangedU64ValueParser::<usize>::new().range(1..=40))]
    levels: usize,
    /// The first N of the 26 standard views
    #[arg(long, value_name = "N", default_value_t = STANDARD_VIEWS, value_parser = RangedU64ValueParser::<usize>::new().range(1..=26))]
    views: usize,
    /// Distances of the views, in radii of the bounding sphere
    #[arg(long, value_name = "D,…", value_delimiter = ',', default_value = "1.5,2.5,5,10,20", value_parser = args::positive)]
    distances: Vec<f64>,
    /// Screen-space errors that the file is drawn with, in pixels
    #[arg(long, value_name = "T,…", value_delimiter = ',', default_value = "0.5,1,2,4,8", value_parser = args::positive)]
    error_px: Vec<f64>,
    /// Size of the pictures that are compared
    #[arg(long, value_name = "WxH", default_value = "400x300", value_parser = args::size)]
    size: [u32; 2],
    /// Make no pictures
    #[arg(long)]
    no_pictures: bool,
    /// Compare ways of changing levels, too, along a camera path and for rows of 50 to 2000 models
    #[arg(long, conflicts_with = "no_pictures")]
    transitions: bool,
    /// RMS errors that the input is converted again with
    #[arg(long, value_name = "E,…", value_delimiter = ',', default_value = "8e-4,4e-4,2e-4,1e-4", value_parser = args::relative, conflicts_with = "no_convert")]
    error_rels: Vec<f64>,
    /// Do not convert the input again
    #[arg(long)]
    no_convert: bool,
    /// Results of another tool, one row a surface; docs/chart.md has the columns
    #[arg(long, value_name = "FILE.csv")]
    external: Vec<PathBuf>,
}

pub(super) fn run(
    arguments: &Arguments,
    common: &Common,
    output: &Output,
) -> anyhow::Result<Verdict> {
    let start = Instant::now();
    // Everything that may be refused comes before everything that takes long.
    let mut external = Vec::new();
    for path in &arguments.external {
        external.extend(external::read(path)?);
    }
    let opened = open::open_indexed(&arguments.file)?;
    let mut folder = PendingFolder::create(&arguments.output)?;
    let reference = Reference::load(&arguments.against)?;
    check_bounds(arguments, &opened.document.metadata, &reference)?;
    let headless = if arguments.no_pictures {
        None
    } else {
        Some(Headless::new().context("pictures cannot be made; --no-pictures does without")?)
    };
    let progress = Display::new(common.progress);
    let threads = common.threads.map(std::num::NonZeroUsize::get);
    let job = Job {
        arguments,
        opened,
        reference,
        headless,
        threads,
        progress: &progress,
    };
    let made = job.run(external, &folder, start);
    progress.finish();
    let report = made?;
    let (html, plots) = page::page(&report);
    folder.write("chart.html", &html)?;
    folder.write("chart.csv", &tables::csv(&report))?;
    folder.write(
        "chart.json",
        &(serde_json::to_string_pretty(&report)? + "\n"),
    )?;
    for plot in plots {
        folder.write(&format!("{}.svg", plot.name), &plot.svg)?;
    }
    folder.persist()?;
    output.say(&page::summary(
        &report,
        &arguments.output.display().to_string(),
    ));
    output.report(&report)?;
    Ok(Verdict::Good)
}

/// What was found by drawing.
#[derive(Default)]
struct Drawn {
    pictures: Vec<PicturePoint>,
    transitions: Vec<TransitionPoint>,
    rows: Vec<RowPoint>,
}

struct Job<'a> {
    arguments: &'a Arguments,
    opened: Opened,
    reference: Reference,
    headless: Option<Headless>,
    threads: Option<usize>,
    progress: &'a Display,
}

impl Job<'_> {
    fn run(
        &self,
        external: Vec<GeometryPoint>,
        folder: &PendingFolder,
        start: Instant,
    ) -> anyhow::Result<Report> {
        let (arguments, reference) = (self.arguments, &self.reference);
        let input_bytes = bytes_of(&arguments.against, reference)?;
        self.progress.stage("cuts");
        let tell = |part| self.progress.fraction(part);
        let mut points = geometry::file_curve(
            &arguments.file,
            &self.opened,
            reference,
            arguments.samples,
            arguments.levels,
            tell,
        )?;
        self.progress.stage("levels");
        let whole = SplitMesh::new(reference);
        let wanted = geometry::level_sizes(&points);
        let levels = geometry::levels(
            &whole,
            reference,
            wanted.into_iter(),
            arguments.samples,
            tell,
        )?;
        points.extend(levels.iter().map(|level| level.point.clone()));
        points.push(geometry::original(reference, input_bytes));
        points.extend(external);
        geometry::mark_fronts(&mut points);
        self.progress.stage("pictures");
        let Drawn {
            pictures,
            transitions,
            rows,
        } = self.pictures(&whole, &levels)?;
        self.progress.stage("conversions");
        let conversions = if arguments.no_convert {
            Vec::new()
        } else {
            conversions::points(
                &arguments.against,
                &arguments.error_rels,
                charts_of(&self.opened),
                up_of(&self.opened.document.metadata),
                self.threads,
                folder.path(),
                &tell,
            )?
        };
        let adapter = self.headless.as_ref().map(|headless| Adapter {
            name: headless.adapter().to_owned(),
            software: headless.is_software(),
        });
        let mut report = Report {
            file: FileInfo {
                path: arguments.file.clone(),
                bytes: self.opened.document.file_length(),
            },
            input: InputInfo {
                path: arguments.against.display().to_string(),
                bytes: input_bytes,
                triangles: reference.mesh.triangles.len() as u64,
                textured: !reference.mesh.appearance.faces.is_empty(),
                diagonal: reference.diagonal(),
            },
            settings: self.settings(),
            recommendations: (adapter.as_ref()).map_or_else(Vec::new, |adapter| {
                row::recommend(&rows, &transitions, adapter)
            }),
            adapter,
            equal_cost: equal_cost::compare(&pictures),
            geometry: points,
            pictures,
            transitions,
            rows,
            conversions,
            notes: Vec::new(),
            seconds: 0.0,
        };
        report.notes = notes(&report);
        report.seconds = start.elapsed().as_secs_f64();
        Ok(report)
    }

    fn pictures(&self, whole: &SplitMesh, levels: &[Level]) -> anyhow::Result<Drawn> {
        let Some(headless) = &self.headless else {
            return Ok(Drawn::default());
        };
        let textures = split::textures(&self.reference.mesh.appearance)
            .with_context(|| self.arguments.against.display().to_string())?;
        let [width, height] = self.arguments.size;
        let views: Vec<usize> = (0..self.arguments.views).collect();
        let studio = pictures::Studio {
            headless,
            source: Arc::from(open::source(&self.arguments.file)?),
            metadata: &self.opened.document.metadata,
            size: Viewport::new(width, height),
            views: &views,
            distances: &self.arguments.distances,
            errors_px: &self.arguments.error_px,
            tell: &|part| self.progress.fraction(part),
        };
        let failed = || self.arguments.file.clone();
        let mut drawn = Drawn {
            pictures: pictures::points(&studio, whole, &textures, levels).with_context(failed)?,
            ..Drawn::default()
        };
        if self.arguments.transitions {
            self.progress.stage("transitions");
            drawn.transitions =
                transitions::points(&studio, whole, &textures).with_context(failed)?;
            self.progress.stage("rows");
            drawn.rows = row::points(&studio).with_context(failed)?;
        }
        Ok(drawn)
    }

    fn settings(&self) -> Settings {
        Settings {
            samples: self.arguments.samples,
            size: self.arguments.size,
            views: (0..self.arguments.views).collect(),
            distances: self.arguments.distances.clone(),
            threads: self.threads.unwrap_or_else(rayon::current_num_threads),
        }
    }
}

/// Refuses a file and a reference that cannot be the same model.
fn check_bounds(
    arguments: &Arguments,
    metadata: &Metadata,
    reference: &Reference,
) -> anyhow::Result<()> {
    let [min, max] = [metadata.bounds_min, metadata.bounds_max].map(DVec3::from_array);
    let off = (min - reference.min).abs().max((max - reference.max).abs());
    let allowed = BOUNDS_TOLERANCE * (max - min).length().max(reference.diagonal());
    if off.max_element() <= allowed {
        return Ok(());
    }
    let bounds = |min: DVec3, max: DVec3| {
        format!(
            "({:.6}, {:.6}, {:.6}) to ({:.6}, {:.6}, {:.6})",
            min.x, min.y, min.z, max.x, max.y, max.z
        )
    };
    bail!(
        "{} and {} are not the same model: the file's bounds are {}, the input's {}; name the input that the file was made of",
        arguments.file,
        arguments.against.display(),
        bounds(min, max),
        bounds(reference.min, reference.max)
    )
}

/// Bytes of the input and of the images it refers to.
fn bytes_of(path: &Path, reference: &Reference) -> anyhow::Result<u64> {
    let own = std::fs::metadata(path)
        .with_context(|| format!("{}: cannot be read", path.display()))?
        .len();
    let images = &reference.mesh.appearance.images;
    let images: u64 = images.iter().map(|image| image.bytes.len() as u64).sum();
    // Images of a GLB are in the file.
    let has_them = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
    Ok(if has_them { own } else { own + images })
}

/// What makes a file of the same kind again: one with charts was asked for them, or has colours.
fn charts_of(opened: &Opened) -> Charts {
    if opened.document.charts.is_empty() {
        Charts::Auto
    } else {
        Charts::Always
    }
}

fn up_of(metadata: &Metadata) -> Up {
    match metadata.up_axis {
        0 => Up::X,
        2 => Up::Z,
        _ => Up::Y,
    }
}

/// What a reader has to know before the numbers.
fn notes(report: &Report) -> Vec<String> {
    let mut notes = Vec::new();
    let wide = report.geometry.iter().filter(|p| {
        p.rms_interval_rel
            .is_some_and(|[low, high]| high - low > WIDE * p.rms_rel && p.rms_rel > 0.0)
    });
    let wide = wide.count();
    if wide > 0 {
        notes.push(format!(
            "{} samples are few for {wide} of the surfaces: the 95% interval of their RMS error is wider than {:.0}% of it. Ask for more with --samples.",
            report.settings.samples,
            100.0 * WIDE
        ));
    }
    if !report.pictures.is_empty() && report.settings.views.len() < FEW_VIEWS {
        notes.push(format!(
            "{} views are few: what they do not show does not count, and the intervals are wide. Ask for more with --views.",
            report.settings.views.len()
        ));
    }
    let is_broken = |p: &&GeometryPoint| {
        let pair = p.hausdorff_rel.zip(p.bound_rel);
        pair.is_some_and(|(found, bound)| found > bound * 1.001 + 1e-9)
    };
    let broken: Vec<&GeometryPoint> = report.geometry.iter().filter(is_broken).collect();
    if let Some(point) = broken.first() {
        notes.push(format!(
            "Distances above what the file states as its bound were found in {} of its cuts (at {} triangles: {}, stated {}). The bound does \
             not hold there.{}",
            broken.len(),
            tables::count(point.triangles),
            tables::error(point.hausdorff_rel.unwrap_or_default()),
            tables::error(point.bound_rel.unwrap_or_default()),
            if point.asked_triangles.is_none() {
                " That includes the finest, so the file was not made of this input, or is at fault."
            } else {
                " They are coarse cuts: the finest keeps its bound."
            }
        ));
    }
    if report
        .adapter
        .as_ref()
        .is_some_and(|adapter| adapter.software)
    {
        notes.push(
            "Frames were drawn in software: their times are marked and not compared.".to_owned(),
        );
    }
    notes
}
