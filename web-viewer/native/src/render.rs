//! `marquetry render`: settled frames to PNG files, with a report of what they took.

use crate::path::{self, CameraPath};
use crate::writer::writing;
use crate::{Headless, NativeError, Picture, Session};
use marquetry_engine::camera::STANDARD_DISTANCE;
use marquetry_engine::{Camera, Stats, ViewerOptions, Viewport};
use marquetry_format::{ByteSource, Metadata};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Where a picture is taken from.
#[derive(Debug, Clone, PartialEq)]
pub enum Eye {
    /// A standard view, 0..=25, from a distance in bounding-sphere radii.
    Standard {
        /// Number of the view.
        view: usize,
        /// Bounding-sphere radii.
        distance: f64,
    },
    /// `eye.x,eye.y,eye.z,target.x,target.y,target.z`.
    Camera(String),
    /// A file with a camera path: see [`crate::path`].
    Path(PathBuf),
}

impl Default for Eye {
    fn default() -> Self {
        Self::Standard {
            view: 0,
            distance: STANDARD_DISTANCE,
        }
    }
}

/// What to render.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderOptions {
    /// Size of the picture.
    pub size: Viewport,
    /// From where.
    pub eye: Eye,
    /// How.
    pub viewer: ViewerOptions,
    /// Threads that encode pictures while others are drawn, at least 1.
    pub threads: usize,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            size: Viewport::new(1280, 720),
            eye: Eye::default(),
            viewer: ViewerOptions::default(),
            threads: 1,
        }
    }
}

/// Pages, as in the `render` report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct PagesReport {
    /// Pages asked for.
    pub requested: u64,
    /// Pages that came.
    pub fetched: u64,
    /// Bytes of pages and index blocks that came; what was read to open the file is not counted.
    pub bytes: u64,
    /// Pages wanted that did not come.
    pub missing: u64,
}

/// Colour tiles, as in the `render` report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct TilesReport {
    /// Tiles asked for.
    pub requested: u64,
    /// Tiles that came.
    pub fetched: u64,
    /// Bytes of tiles and their index that came.
    pub bytes: u64,
    /// Tiles wanted that did not come.
    pub missing: u64,
    /// What resident tiles take; part of the cache's `used_bytes`.
    pub used_bytes: u64,
    /// Tiles evicted.
    pub evictions: u64,
}

/// The cache, as in the `render` report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct CacheReport {
    /// The budget.
    pub capacity_bytes: u64,
    /// What evictable pages take.
    pub used_bytes: u64,
    /// What the base takes, which never leaves.
    pub pinned_bytes: u64,
    /// Pages evicted.
    pub evictions: u64,
}

/// The `render` report.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RenderReport {
    /// Pictures written.
    pub frames: u64,
    /// From update to a finished picture, milliseconds, everything being resident; the mean over the frames.
    pub frame_ms: f64,
    /// The part of it before the GPU has its commands.
    pub cpu_ms: f64,
    /// The part of it on the GPU; `None` where it cannot be measured.
    pub gpu_ms: Option<f64>,
    /// Triangles drawn in the last frame.
    pub triangles: u64,
    /// Nodes drawn in the last frame.
    pub nodes: u64,
    /// Draw calls of the last frame.
    pub draw_calls: u64,
    /// Screen-space error aimed at beyond the base, pixels: above the option where the cache is too small.
    pub error_px: f64,
    /// Pages, over all frames.
    pub pages: PagesReport,
    /// Colour tiles, over all frames.
    pub tiles: TilesReport,
    /// The cache after the last frame.
    pub cache: CacheReport,
    /// Graphics adapter.
    pub adapter: String,
}

/// Renders what `options` say of the file in `source` to `output`; a path of several cameras to `output` with `-0000`,
/// `-0001`, … before its extension. `progress` is told how many frames of how many are done.
///
/// # Errors
/// When there is no adapter, the file cannot be opened, an option is wrong, pages cannot be fetched, or a picture cannot be
/// written.
pub fn render_png(
    source: &Arc<dyn ByteSource>,
    options: &RenderOptions,
    output: &Path,
    mut progress: impl FnMut(usize, usize),
) -> Result<RenderReport, NativeError> {
    let headless = Headless::new()?;
    let mut session = headless.session(source, options.viewer.clone())?;
    let CameraPath { cameras, fps } =
        cameras_of(&options.eye, &session.viewer().document().metadata)?;
    let mut times = Times::default();
    writing(options.threads, |writer| {
        for (index, camera) in cameras.iter().enumerate() {
            let picture = match fps.filter(|_| index > 0) {
                None => settled_frame(&mut session, *camera, options.size, &mut times)?,
                Some(fps) => {
                    moving_frame(&mut session, *camera, options.size, 1.0 / fps, &mut times)?
                }
            };
            let path = if cameras.len() == 1 {
                output.to_owned()
            } else {
                numbered(output, index)
            };
            if !writer.write(path, picture) {
                break;
            }
            progress(index + 1, cameras.len());
        }
        Ok(())
    })?;
    Ok(times.report(&session.viewer().stats(), headless.adapter()))
}

fn cameras_of(eye: &Eye, metadata: &Metadata) -> Result<CameraPath, NativeError> {
    let cameras = match eye {
        Eye::Standard { view, distance } => vec![Camera::standard(metadata, *view, *distance)?],
        Eye::Camera(text) => vec![Camera::parse(metadata, text)?],
        Eye::Path(file) => return path::read(file, metadata),
    };
    Ok(CameraPath { cameras, fps: None })
}

fn settled_frame(
    session: &mut Session,
    camera: Camera,
    size: Viewport,
    times: &mut Times,
) -> Result<Picture, NativeError> {
    session.settle(camera, size)?;
    // Once for uploads and first use, once for the clock.
    session.draw(size)?;
    timed_frame(session, size, 0.0, times)
}

fn moving_frame(
    session: &mut Session,
    camera: Camera,
    size: Viewport,
    seconds: f64,
    times: &mut Times,
) -> Result<Picture, NativeError> {
    session.viewer().set_camera(camera);
    timed_frame(session, size, seconds, times)
}

fn timed_frame(
    session: &mut Session,
    size: Viewport,
    seconds: f64,
    times: &mut Times,
) -> Result<Picture, NativeError> {
    let start = Instant::now();
    session.step(seconds, size, Duration::ZERO);
    let updated = start.elapsed();
    let submitted = session.draw(size)?;
    times.add(start.elapsed(), updated + submitted, session.gpu_ms());
    session.read_back()
}

fn numbered(output: &Path, index: usize) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let extension = output.extension().unwrap_or_default().to_string_lossy();
    let dot = if extension.is_empty() { "" } else { "." };
    output.with_file_name(format!("{stem}-{index:04}{dot}{extension}"))
}

#[derive(Debug, Default)]
struct Times {
    frames: u32,
    frame: Duration,
    cpu: Duration,
    gpu_ms: Option<f64>,
}

impl Times {
    fn add(&mut self, frame: Duration, cpu: Duration, gpu_ms: Option<f64>) {
        self.gpu_ms = gpu_ms.map(|ms| ms + self.gpu_ms.unwrap_or(0.0));
        self.frames += 1;
        self.frame += frame;
        self.cpu += cpu;
    }

    fn report(&self, stats: &Stats, adapter: &str) -> RenderReport {
        let mean_ms = |total: Duration| 1e3 * total.as_secs_f64() / f64::from(self.frames.max(1));
        RenderReport {
            frames: u64::from(self.frames),
            frame_ms: mean_ms(self.frame),
            cpu_ms: mean_ms(self.cpu),
            gpu_ms: self
                .gpu_ms
                .map(|total| total / f64::from(self.frames.max(1))),
            triangles: stats.triangles,
            nodes: stats.nodes,
            draw_calls: stats.draw_calls,
            error_px: stats.error_px,
            pages: PagesReport {
                requested: stats.pages.requested,
                fetched: stats.pages.fetched,
                bytes: stats.pages.bytes,
                missing: stats.pages.missing,
            },
            tiles: TilesReport {
                requested: stats.tiles.requested,
                fetched: stats.tiles.fetched,
                bytes: stats.tiles.bytes,
                missing: stats.tiles.missing,
                used_bytes: stats.tiles.used_bytes,
                evictions: stats.tiles.evictions,
            },
            cache: CacheReport {
                capacity_bytes: stats.cache.capacity_bytes,
                used_bytes: stats.cache.used_bytes,
                pinned_bytes: stats.cache.pinned_bytes,
                evictions: stats.cache.evictions,
            },
            adapter: adapter.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_before_the_extension() {
        assert_eq!(
            numbered(Path::new("a/b.c.png"), 12),
            Path::new("a/b.c-0012.png")
        );
        assert_eq!(numbered(Path::new("frame"), 0), Path::new("frame-0000"));
    }
}
