//! `marquetry render`: frames without a window.

use super::output::{self, Output};
use super::{Verdict, args, open};
use anyhow::Context;
use marquetry_engine::camera::{STANDARD_DISTANCE, STANDARD_VIEWS};
use marquetry_engine::{Background, Section, Shade, Transition, ViewerOptions, Viewport};
use marquetry_format::ContentKind;
use marquetry_native::render::{self, Eye, RenderOptions, RenderReport};
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

/// Render a frame, or a path of them, without a window
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
    /// The picture to write; with --path, -0000, -0001, … come before its extension
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = args::size)]
    size: [u32; 2],
    /// One of 26 standard directions, 0 = front
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = view, conflicts_with_all = ["camera", "path"])]
    view: usize,
    /// Eye and target: six numbers
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = args::camera, allow_hyphen_values = true, conflicts_with = "path")]
    camera: Option<String>,
    /// Distance of a standard view, in radii of the bounding sphere
    #[arg(long, value_name = "D", default_value_t = STANDARD_DISTANCE, value_parser = args::positive, conflicts_with_all = ["camera", "path"])]
    distance: f64,
    /// A camera path (JSON), one picture a frame
    #[arg(long, value_name = "FILE.json")]
    path: Option<PathBuf>,
    /// When (scenes)
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    time: Option<f64>,
    #[command(flatten)]
    looks: Looks,
}

/// How the model is drawn.
#[derive(Debug, clap::Args)]
pub(super) struct Looks {
    /// Largest screen-space error wanted, in pixels
    #[arg(long, value_name = "T", default_value_t = 1.0, value_parser = args::positive)]
    error_px: f64,
    /// How one resolution gives way to another: none, alpha, dither or geomorph
    #[arg(long, value_name = "HOW", default_value = "geomorph", value_parser = Transition::from_str)]
    transition: Transition,
    /// What the colours show: lit, normal, lod, wire or unlit
    #[arg(long, value_name = "WHAT", default_value = "lit", value_parser = Shade::from_str)]
    shade: Shade,
    /// Cut the model open: x, y or z and a part of the bounds (a minus sign keeps the upper part), or NX,NY,NZ,OFFSET
    #[arg(long, value_name = "AXIS,PART", value_parser = Section::from_str, allow_hyphen_values = true)]
    section: Option<Section>,
    /// Colour behind the model
    #[arg(long, value_name = "RRGGBB", value_parser = Background::from_str)]
    background: Option<Background>,
    /// Budget of the page cache, with suffix K, M or G [default: 512M]
    #[arg(long, value_name = "BYTES", value_parser = args::bytes)]
    cache: Option<u64>,
}

impl Looks {
    /// The options of the engine.
    pub(super) fn viewer_options(&self) -> ViewerOptions {
        let defaults = ViewerOptions::default();
        ViewerOptions {
            error_px: self.error_px,
            transition: self.transition,
            section: self.section,
            shade: self.shade,
            background: self.background.unwrap_or(defaults.background),
            cache_bytes: self.cache.unwrap_or(defaults.cache_bytes),
            ..defaults
        }
    }
}

fn view(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|view| *view < STANDARD_VIEWS)
        .ok_or_else(|| format!("expected a number from 0 to {}", STANDARD_VIEWS - 1))
}

pub(super) fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<Verdict> {
    let file = &arguments.file;
    let [width, height] = arguments.size;
    let options = RenderOptions {
        size: Viewport::new(width, height),
        eye: match (&arguments.camera, &arguments.path) {
            (Some(camera), _) => Eye::Camera(camera.clone()),
            (None, Some(path)) => Eye::Path(path.clone()),
            (None, None) => Eye::Standard {
                view: arguments.view,
                distance: arguments.distance,
            },
        },
        viewer: arguments.looks.viewer_options(),
        threads: rayon::current_num_threads(),
    };
    // Once more here, for a message about the file before one about the graphics adapter.
    let opened = open::open(file)?;
    if arguments.time.is_some() && opened.document.metadata.kind != ContentKind::Scene {
        output.say("note: --time has no effect on a file without a schedule");
    }
    let source = Arc::from(opened.source);
    let report = render::render_png(&source, &options, &arguments.output, |_, _| {})
        .with_context(|| file.clone())?;
    output.say(&describe(&arguments.output.display().to_string(), &report));
    output.report(&report)?;
    Ok(Verdict::Good)
}

fn describe(path: &str, report: &RenderReport) -> String {
    format!(
        "{path}: {} frames, {:.1} ms each on {}\n\
         {} triangles in {} nodes and {} draw calls\n\
         {} pages fetched, {}; cache {} of {}, {} evictions",
        report.frames,
        report.frame_ms,
        report.adapter,
        report.triangles,
        report.nodes,
        report.draw_calls,
        report.pages.fetched,
        output::bytes(report.pages.bytes),
        output::bytes(report.cache.used_bytes),
        output::bytes(report.cache.capacity_bytes),
        report.cache.evictions,
    )
}
