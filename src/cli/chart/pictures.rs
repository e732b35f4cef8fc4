//! Pictures of the file, of levels of detail and of the input itself, compared view by view.
//!
//! The reference is the whole input, drawn from the same eye with the same light (`marquetry_native::mesh`), each pixel the mean of several
//! ([`refined`]): triangles that are smaller than a pixel are lit at one point of it otherwise, which is noise. A file is drawn as a
//! viewer would: settled, for several screen-space errors. Levels of detail are drawn as a whole from every distance, whatever
//! their error is on the screen: which of them a viewer would take is left to the reader of the curve.

use super::data::{FrameTime, Method, PicturePoint};
use super::geometry::Level;
use super::quality::{self, Likeness, Shot};
use super::split::SplitMesh;
use anyhow::Context;
use marquetry_engine::{Background, Camera, Shade, Transition, ViewerOptions, Viewport};
use marquetry_evaluation::pareto;
use marquetry_format::{ByteSource, Metadata};
use marquetry_native::mesh::{Looks, MeshBuffers, MeshTexture};
use marquetry_native::{Headless, MeshPainter, Session};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Standard views at right angles, of which the report states SSIM by itself: front, right, top.
const THREE_VIEWS: [usize; 3] = [0, 1, 4];
/// Frames that are timed of each setting where the adapter is no GPU.
const TIMED_IN_SOFTWARE: usize = 3;
/// Levels are drawn from a distance where their triangles are within this factor of what the file draws there: each has half as
/// many as the one before, so those around every point of the file are among them.
const NEARBY: f64 = 2.1;
/// Pixels of the reference, each way, in place of one, as far as it gets no larger than what every device draws.
const REFINED: u32 = 4;
pub(super) const LARGEST: u32 = 8192;
/// Of the pictures; no lit surface has it.
pub(super) const BACKGROUND: Background = Background([0x20, 0x22, 0x26]);

/// How meshes are drawn: as files are.
pub(super) fn looks(metadata: &Metadata) -> Looks {
    Looks {
        shade: Shade::Lit,
        background: BACKGROUND,
        has_colours: metadata.has_colours,
    }
}

/// What is drawn, and from where.
pub(super) struct Studio<'a> {
    pub(super) headless: &'a Headless,
    pub(super) source: Arc<dyn ByteSource>,
    pub(super) metadata: &'a Metadata,
    pub(super) size: Viewport,
    /// Numbers of standard views.
    pub(super) views: &'a [usize],
    /// Bounding-sphere radii.
    pub(super) distances: &'a [f64],
    /// Screen-space errors, pixels.
    pub(super) errors_px: &'a [f64],
    pub(super) tell: &'a dyn Fn(f64),
}

/// Draws and compares everything.
///
/// # Errors
/// When the file cannot be shown, a mesh does not fit the device, or the device fails.
pub(super) fn points(
    studio: &Studio<'_>,
    whole: &SplitMesh,
    textures: &[MeshTexture],
    levels: &[Level],
) -> anyhow::Result<Vec<PicturePoint>> {
    let mut easel = Easel::new(studio, textures)?;
    let cameras = studio.cameras()?;
    let rounds = (1 + studio.errors_px.len() + levels.len()) as f64;
    let mut points = Vec::new();
    let mut references = Vec::new();
    let original = easel.painter.upload(&whole.plain())?;
    for (distance, cameras) in studio.distances.iter().zip(&cameras) {
        let (shots, costs) = easel.meshes(&original, cameras)?;
        let refined = easel.refined(&original, cameras, &shots)?;
        let setting = "whole".to_owned();
        let point = point(
            studio,
            Method::Original,
            *distance,
            setting,
            &refined,
            &shots,
            &costs,
        )?;
        points.extend(point);
        references.push(refined);
    }
    drop(original);
    (studio.tell)(1.0 / rounds);
    for (round, &error_px) in (2..).zip(studio.errors_px) {
        easel.want(error_px)?;
        for ((distance, cameras), references) in
            studio.distances.iter().zip(&cameras).zip(&references)
        {
            let (shots, costs) = easel.file(cameras)?;
            let (method, setting) = (Method::Marquetry, format!("{error_px} px"));
            points.extend(point(
                studio, method, *distance, setting, references, &shots, &costs,
            )?);
        }
        (studio.tell)(f64::from(round) / rounds);
    }
    let done = 1 + studio.errors_px.len();
    for (number, level) in levels.iter().enumerate() {
        let buffers = easel.painter.upload(&level.mesh.plain())?;
        for ((distance, cameras), references) in
            studio.distances.iter().zip(&cameras).zip(&references)
        {
            if !is_near(&points, *distance, buffers.triangles() as f64) {
                continue;
            }
            let (shots, costs) = easel.meshes(&buffers, cameras)?;
            let method = Method::DiscreteLods;
            let setting = format!("level {}", number + 1);
            points.extend(point(
                studio, method, *distance, setting, references, &shots, &costs,
            )?);
        }
        (studio.tell)((done + number + 1) as f64 / rounds);
    }
    mark_fronts(&mut points, studio.distances);
    Ok(points)
}

impl Studio<'_> {
    /// By distance and view.
    fn cameras(&self) -> anyhow::Result<Vec<Vec<Camera>>> {
        let from = |distance: &f64| {
            let view = |&view: &usize| Camera::standard(self.metadata, view, *distance);
            self.views.iter().map(view).collect::<Result<_, _>>()
        };
        Ok(self.distances.iter().map(from).collect::<Result<_, _>>()?)
    }
}

/// What a frame took.
#[derive(Debug, Clone, Copy)]
struct Cost {
    triangles: u64,
    /// Processor, whole frame, GPU; of frames that were timed.
    times: Option<(Duration, Duration, Option<f64>)>,
}

/// Draws files and meshes alike.
struct Easel<'a> {
    session: Session,
    painter: MeshPainter,
    size: Viewport,
    /// Views that are timed.
    timed: usize,
    is_software: bool,
    headless: &'a Headless,
}

impl<'a> Easel<'a> {
    fn new(studio: &Studio<'a>, textures: &[MeshTexture]) -> anyhow::Result<Self> {
        let Studio {
            headless, metadata, ..
        } = studio;
        let options = ViewerOptions {
            background: BACKGROUND,
            transition: Transition::None,
            ..ViewerOptions::default()
        };
        let is_software = headless.is_software();
        Ok(Self {
            session: headless.session(&studio.source, options)?,
            painter: MeshPainter::new(headless, metadata, looks(metadata), textures),
            size: studio.size,
            timed: if is_software {
                TIMED_IN_SOFTWARE
            } else {
                studio.views.len()
            },
            is_software,
            headless,
        })
    }

    fn want(&mut self, error_px: f64) -> anyhow::Result<()> {
        let options = ViewerOptions {
            error_px,
            ..self.session.viewer().options().clone()
        };
        Ok(self.session.viewer().set_options(options)?)
    }

    fn meshes(
        &mut self,
        mesh: &MeshBuffers,
        cameras: &[Camera],
    ) -> anyhow::Result<(Vec<Shot>, Vec<Cost>)> {
        let mut taken = (Vec::new(), Vec::new());
        for (number, camera) in cameras.iter().enumerate() {
            self.painter.draw(mesh, camera, self.size)?;
            let mut times = None;
            if number < self.timed {
                let start = Instant::now();
                let cpu = self.painter.draw(mesh, camera, self.size)?;
                let frame = start.elapsed();
                let gpu = self.painter.gpu_ms().filter(|_| !self.is_software);
                times = Some((cpu, frame, gpu));
            }
            taken
                .0
                .push(Shot::new(self.painter.read_back()?, BACKGROUND.0)?);
            taken.1.push(Cost {
                triangles: mesh.triangles(),
                times,
            });
        }
        Ok(taken)
    }

    /// Pictures of a mesh that `shots` were taken of, for reference.
    fn refined(
        &mut self,
        mesh: &MeshBuffers,
        cameras: &[Camera],
        shots: &[Shot],
    ) -> anyhow::Result<Vec<Shot>> {
        let views = cameras.iter().zip(shots);
        let refined =
            views.map(|(camera, shot)| refined(&mut self.painter, mesh, camera, shot, REFINED));
        refined.collect()
    }

    fn file(&mut self, cameras: &[Camera]) -> anyhow::Result<(Vec<Shot>, Vec<Cost>)> {
        let mut taken = (Vec::new(), Vec::new());
        for (number, camera) in cameras.iter().enumerate() {
            self.session.settle(*camera, self.size)?;
            self.session.draw(self.size)?;
            let mut times = None;
            if number < self.timed {
                let start = Instant::now();
                self.session.step(0.0, self.size, Duration::ZERO);
                let updated = start.elapsed();
                let submitted = self.session.draw(self.size)?;
                let frame = start.elapsed();
                let gpu = self.session.gpu_ms().filter(|_| !self.is_software);
                times = Some((updated + submitted, frame, gpu));
            }
            taken
                .0
                .push(Shot::new(self.session.read_back()?, BACKGROUND.0)?);
            taken.1.push(Cost {
                triangles: self.session.viewer().stats().triangles,
                times,
            });
        }
        self.headless.wait()?;
        Ok(taken)
    }
}

/// What `shot` shows, of `times` as many pixels each way where the device draws so many: without the noise of lighting one point of each
/// pixel; the object is where it was there.
///
/// # Errors
/// When the mesh cannot be drawn so large.
pub(super) fn refined(
    painter: &mut MeshPainter,
    mesh: &MeshBuffers,
    camera: &Camera,
    shot: &Shot,
    times: u32,
) -> anyhow::Result<Shot> {
    let (width, height) = (shot.picture.width, shot.picture.height);
    let factor = (LARGEST / width.max(height).max(1)).clamp(1, times);
    let size = Viewport::new(factor * width, factor * height);
    painter.draw(mesh, camera, size)?;
    shot.refined(&painter.read_back()?, factor as usize)
}

/// The point of one setting and distance; `None` where no view shows anything.
fn point(
    studio: &Studio<'_>,
    method: Method,
    distance: f64,
    setting: String,
    references: &[Shot],
    shots: &[Shot],
    costs: &[Cost],
) -> anyhow::Result<Option<PicturePoint>> {
    let likenesses: Vec<Option<Likeness>> = references
        .par_iter()
        .zip(shots)
        .map(|(reference, shot)| quality::compare(reference, shot))
        .collect::<anyhow::Result<_>>()
        .context("pictures cannot be compared")?;
    let three: Vec<f64> = studio
        .views
        .iter()
        .zip(&likenesses)
        .filter(|(view, _)| THREE_VIEWS.contains(view))
        .filter_map(|(_, likeness)| Some((*likeness)?.ssim))
        .collect();
    let seen: Vec<Likeness> = likenesses.into_iter().flatten().collect();
    let Some(summary) = quality::summary(&seen) else {
        return Ok(None);
    };
    let triangles = costs.iter().map(|cost| cost.triangles as f64).sum::<f64>();
    let is_complete = three.len() == THREE_VIEWS.len();
    Ok(Some(PicturePoint {
        method,
        distance,
        setting,
        triangles: triangles / costs.len().max(1) as f64,
        ssim: summary.ssim,
        flip: summary.flip,
        psnr_db: summary.psnr_db,
        outline: summary.outline,
        ssim_three_views: is_complete.then(|| three.iter().sum::<f64>() / 3.0),
        time: frame_time(costs),
        views: summary.views,
        on_front: false,
    }))
}

fn frame_time(costs: &[Cost]) -> FrameTime {
    let times: Vec<_> = costs.iter().filter_map(|cost| cost.times).collect();
    let ms = |duration: Duration| 1e3 * duration.as_secs_f64();
    let gpu: Vec<f64> = times.iter().filter_map(|time| time.2).collect();
    FrameTime {
        cpu_ms: median(times.iter().map(|time| ms(time.0)).collect()).unwrap_or(0.0),
        frame_ms: median(times.iter().map(|time| ms(time.1)).collect()).unwrap_or(0.0),
        gpu_ms: median(gpu),
        frames: times.len(),
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Whether a level of so many triangles is to be compared with what the file draws from `distance`.
fn is_near(points: &[PicturePoint], distance: f64, triangles: f64) -> bool {
    let drawn = points
        .iter()
        .filter(|p| p.method == Method::Marquetry && same(p.distance, distance))
        .map(|p| p.triangles);
    let (low, high) = drawn.fold((f64::INFINITY, 0.0_f64), |(low, high), triangles| {
        (low.min(triangles), high.max(triangles))
    });
    (low / NEARBY..=high * NEARBY).contains(&triangles)
}

/// Whether two distances are the same one: they are copies of what was asked for.
pub(super) fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

/// Says of all points whether they are on the front of SSIM against triangles, distance by distance.
fn mark_fronts(points: &mut [PicturePoint], distances: &[f64]) {
    for &distance in distances {
        let pair = |p: &PicturePoint| {
            if same(p.distance, distance) {
                (p.triangles, 1.0 - p.ssim.mean)
            } else {
                (f64::NAN, f64::NAN)
            }
        };
        let front = pareto::front(&points.iter().map(pair).collect::<Vec<_>>());
        for (point, on_front) in points.iter_mut().zip(front) {
            point.on_front |= on_front;
        }
    }
}
