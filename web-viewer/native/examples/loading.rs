//! What the drawing thread does while pages come: milliseconds of `Viewer::update` and of uploads, frame by frame.
//!
//! `cargo run --release -p marquetry-native --example loading -- FILE.marq [WIDTHxHEIGHT]`

use marquetry_engine::{Camera, Renderer, Viewer, ViewerOptions, Viewport, wgpu};
use marquetry_format::{ByteSource, Document, FileSource, Limits};
use marquetry_native::{Decoders, Headless};
use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

/// Frames of a path, and how many of them there are in a second.
const FRAMES: u32 = 90;
const FRAMES_PER_SECOND: f64 = 60.0;

/// The camera of frame `frame`.
type CameraPath = fn(&Viewer, f64) -> Camera;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("which file?")?;
    let size = arguments.next().unwrap_or_else(|| "2560x1440".to_owned());
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let viewport = Viewport::new(width.parse()?, height.parse()?);
    let source = FileSource::open(Path::new(&file))?;
    let headless = Headless::new()?;
    println!(
        "| path | decoding | update, median | 99th percentile | max | upload, median | 99th percentile | max | frames until settled |"
    );
    let paths: [(&str, CameraPath); 2] = [("orbit", orbit), ("approach", approach)];
    for (name, path) in paths {
        for (way, on_threads) in [("inline", false), ("on threads", true)] {
            let decoders = on_threads.then(|| Decoders::new(|| ()));
            let times = load(&source, &headless, viewport, path, decoders)?;
            let [update, upload] = [times.update, times.upload].map(summary);
            println!(
                "| {name} | {way} | {update} | {upload} | {} |",
                times.frames
            );
        }
    }
    Ok(())
}

fn orbit(viewer: &Viewer, part: f64) -> Camera {
    let camera = distant(viewer, 2.5);
    let (sin, cos) = (std::f64::consts::TAU * part).sin_cos();
    let [x, y, z] = (camera.eye - camera.target).to_array();
    Camera {
        eye: camera.target + glam::DVec3::new(cos * x + sin * z, y, cos * z - sin * x),
        ..camera
    }
}

fn approach(viewer: &Viewer, part: f64) -> Camera {
    distant(viewer, 2.5 + (0.6 - 2.5) * part)
}

fn distant(viewer: &Viewer, radii: f64) -> Camera {
    Camera::standard(&viewer.document().metadata, 0, radii).unwrap_or_else(|_| viewer.camera())
}

#[derive(Default)]
struct Times {
    update: Vec<Duration>,
    upload: Vec<Duration>,
    frames: usize,
}

fn load(
    source: &FileSource,
    headless: &Headless,
    viewport: Viewport,
    path: CameraPath,
    mut decoders: Option<Decoders>,
) -> Result<Times, Box<dyn Error>> {
    let document = Document::open(source, Limits::default())?;
    let mut viewer = Viewer::new(document, ViewerOptions::default())?;
    if let Some(decoders) = &decoders {
        decoders.adopt(&mut viewer);
    }
    let mut renderer = Renderer::new(
        headless.device(),
        headless.queue(),
        wgpu::TextureFormat::Rgba8UnormSrgb,
    );
    let mut times = Times::default();
    for frame in 0.. {
        let begin = Instant::now();
        let part = f64::from(frame.min(FRAMES)) / f64::from(FRAMES);
        viewer.set_camera(path(&viewer, part));
        let start = Instant::now();
        if let Some(decoders) = &mut decoders {
            decoders.collect(&mut viewer);
        }
        let requests = viewer.update(1.0 / FRAMES_PER_SECOND, viewport);
        if let Some(decoders) = &mut decoders {
            decoders.feed(&mut viewer);
        }
        times.update.push(start.elapsed());
        let start = Instant::now();
        renderer.upload(&mut viewer)?;
        times.upload.push(start.elapsed());
        for request in requests {
            let answer = source
                .read(request.range)
                .map_err(|error| error.to_string());
            viewer.deliver(request.id, answer);
        }
        if frame > FRAMES && viewer.is_settled() {
            break;
        }
        let frame_time = Duration::from_secs_f64(1.0 / FRAMES_PER_SECOND);
        std::thread::sleep(frame_time.saturating_sub(begin.elapsed()));
    }
    times.frames = times.update.len();
    Ok(times)
}

/// Median, 99th percentile and longest, milliseconds.
fn summary(mut times: Vec<Duration>) -> String {
    times.sort_unstable();
    let at = |part: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place in the list"
        )]
        let index = ((times.len() - 1) as f64 * part).round() as usize;
        1e3 * times[index].as_secs_f64()
    };
    format!("{:.2} | {:.2} | {:.2}", at(0.5), at(0.99), at(1.0))
}
