//! What networks, caches and cameras do to a picture: a closed surface drawn over magenta shows none of it, at any moment.
//!
//! The criterion is that of `watertight`: every pixel that the drawn cut covers, as the CPU sees it, but for a rim of one pixel. From
//! within a closed surface that is every pixel there is.

use super::{Case, Depth, Found, Outcome, Part};
use crate::network::{Network, Rule};
use crate::raster::AROUND_FOUR_SAMPLES;
use crate::stage::{MAGENTA, Stage, holes, unit};
use crate::{BOTH_WAYS, convert, meshes, ply};
use anyhow::{Context, Result, ensure};
use glam::DVec3;
use marquetry_engine::{Background, Camera, Stats, ViewerOptions, Viewport};
use marquetry_evaluation::image::{Image, Mask};
use marquetry_format::Metadata;
use marquetry_native::Headless;
use std::path::PathBuf;
use std::sync::Arc;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
/// Error that is wanted, pixels: the base of the torus shows it to about one.
const ERROR_PX: f64 = 0.4;

/// Where the camera is.
#[derive(Clone, Copy)]
enum Path {
    /// On the ring within the tube of the torus, looking along it and around.
    Inside,
    /// Anywhere, every few steps somewhere else.
    Teleport,
    /// Around the model, half a turn in four steps.
    Spin,
    /// To and fro between two places that look alike but for one cut.
    Threshold,
    /// A slow way around, closer and closer.
    Approach,
}

struct Scenario {
    name: &'static str,
    path: Path,
    rule: Rule,
    /// The cache in tenths of the file, of charts and of clusters, which take more beside their few bytes; `None` for the default.
    cache_tenths: Option<[u64; 2]>,
    /// Whether tests run it, and not the report alone.
    is_quick: bool,
    /// Whether it was seen what the case is about.
    is_seen: fn(&Seen) -> bool,
}

/// What happened on the way.
struct Seen {
    pictures: usize,
    in_motion: usize,
    /// Whether the cache was too small for what was wanted: something had to go, or a larger error was shown.
    was_felt: bool,
    stats: Stats,
    network: Network,
}

fn scenarios() -> Vec<Scenario> {
    let of = |name, path, rule, is_seen: fn(&Seen) -> bool| Scenario {
        name,
        path,
        rule,
        cache_tenths: None,
        is_quick: false,
        is_seen,
    };
    let quick = |scenario| Scenario {
        is_quick: true,
        ..scenario
    };
    let moved: fn(&Seen) -> bool = |seen| seen.in_motion > 0;
    let late = Rule {
        delay: 5..6,
        ..Rule::PROMPT
    };
    let disordered = Rule {
        delay: 0..12,
        ..Rule::PROMPT
    };
    let corrupt = Rule {
        corrupt: 0.3,
        ..Rule::PROMPT
    };
    let failing = Rule {
        failing: 0.4,
        ..Rule::PROMPT
    };
    let silent = Rule {
        silent: 0.3,
        ..Rule::PROMPT
    };
    let worst = Rule {
        delay: 0..8,
        corrupt: 0.15,
        failing: 0.15,
        silent: 0.0,
    };
    vec![
        quick(of(
            "camera inside the bounds",
            Path::Inside,
            Rule::PROMPT,
            moved,
        )),
        of("teleport", Path::Teleport, Rule::PROMPT, moved),
        quick(of("spin", Path::Spin, Rule::PROMPT, moved)),
        of(
            "oscillation at a threshold",
            Path::Threshold,
            Rule::PROMPT,
            |seen| seen.pictures > 0,
        ),
        Scenario {
            cache_tenths: Some([1, 60]),
            ..of("eviction storm", Path::Teleport, Rule::PROMPT, |seen| {
                seen.was_felt
            })
        },
        of("pages late", Path::Approach, late, moved),
        of("pages out of order", Path::Teleport, disordered, |seen| {
            seen.network.overtaken > 0
        }),
        of("pages corrupt", Path::Approach, corrupt, |seen| {
            seen.network.faults > 0 && seen.stats.failures > 0
        }),
        of("fetches that fail", Path::Approach, failing, |seen| {
            seen.network.faults > 0 && seen.stats.failures > 0
        }),
        of("pages never", Path::Teleport, silent, |seen| {
            seen.network.unanswered > 0
        }),
        Scenario {
            cache_tenths: Some([1, 60]),
            ..of("all of it at once", Path::Teleport, worst, |seen| {
                seen.network.faults > 0 && seen.network.overtaken > 0
            })
        },
    ]
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (way, suffix) in BOTH_WAYS.into_iter().zip([", clusters", ", charts"]) {
        for scenario in scenarios() {
            let has_charts = suffix == ", charts";
            cases.push(Case {
                part: Part::Streaming,
                set: scenario.is_quick.then_some("streaming"),
                name: format!("{}{suffix}", scenario.name),
                required: "no hole, no crack".to_owned(),
                run: Box::new(move |depth| scenario.run(way, has_charts, depth).map(Outcome::Met)),
            });
        }
    }
    cases
}

/// Fine enough that most of it lies beyond the base; the same as in other tests, which find it converted.
fn torus(way: &[&str]) -> Result<PathBuf> {
    let folder = tempfile::tempdir()?;
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(1200, 600))?;
    let fine = ["--error-rel", "1e-5", "--allow-worse"];
    Ok(convert(&input, &[&fine, way].concat())?.path)
}

impl Scenario {
    fn run(&self, way: &[&str], has_charts: bool, depth: Depth) -> Result<Found> {
        let bytes: Arc<[u8]> = std::fs::read(torus(way)?)?.into();
        let mut options = ViewerOptions {
            error_px: ERROR_PX,
            background: Background(MAGENTA),
            ..ViewerOptions::default()
        };
        if let Some([charts, clusters]) = self.cache_tenths {
            let tenths = if has_charts { charts } else { clusters };
            options.cache_bytes = tenths * bytes.len() as u64 / 10;
        }
        let headless = Headless::new()?;
        let open = || {
            let viewport = Viewport::new(WIDTH, HEIGHT);
            Stage::open(&headless, Arc::clone(&bytes), options.clone(), viewport)
        };
        let threshold = match self.path {
            Path::Threshold => Some(threshold(&mut open()?)?),
            _ => None,
        };
        let mut stage = open()?;
        let metadata = stage.viewer().document().metadata.clone();
        let mut network = Network::new(self.rule.clone(), 11);
        let (mut pictures, mut in_motion, mut error_px) = (0, 0, 0.0_f64);
        let frames = match depth {
            Depth::Reduced => 8,
            Depth::Whole => 40,
        };
        for frame in 0..frames {
            let camera = self.path.camera(&metadata, frame, threshold)?;
            stage.viewer().set_camera(camera);
            network.step(&mut stage)?;
            self.check(&mut stage)
                .with_context(|| format!("frame {frame} of {frames}"))?;
            pictures += 1;
            error_px = error_px.max(stage.viewer().stats().error_px);
            let drawn = stage.viewer().drawn();
            in_motion += usize::from(!drawn.morphs.is_empty() || !drawn.group_morphs.is_empty());
        }
        if self.rule.silent == 0.0 {
            network.settle(&mut stage)?;
            self.check(&mut stage).context("settled")?;
            pictures += 1;
        }
        let stats = stage.viewer().stats();
        let seen = Seen {
            pictures,
            in_motion,
            was_felt: error_px > ERROR_PX || stats.cache.evictions > 0,
            stats,
            network,
        };
        ensure!(
            (self.is_seen)(&seen),
            "the case has not seen what it is about: {in_motion} in motion, {:?}, {stats:?}",
            seen.network
        );
        Ok(Found {
            words: format!(
                "{pictures} pictures, {in_motion} in motion, {} pages, {} evictions, {} faults",
                stats.pages.fetched, stats.cache.evictions, seen.network.faults
            ),
            ..Found::default()
        })
    }

    /// Draws a picture, which has no hole.
    fn check(&self, stage: &mut Stage) -> Result<()> {
        let rgba = stage.draw()?;
        let (width, height) = (WIDTH as usize, HEIGHT as usize);
        let inside = if matches!(self.path, Path::Inside) {
            let mut all = Mask::empty(width, height);
            for pixel in 0..width * height {
                all.insert(pixel % width, pixel / width);
            }
            all
        } else {
            stage.inside(&AROUND_FOUR_SAMPLES)?
        };
        ensure!(inside.count() > 100, "nothing to see");
        let found = holes(Image::new(width, height, &rgba)?, &inside);
        ensure!(
            found.is_empty(),
            "{} pixels of holes, the first at {:?}; {:?}",
            found.len(),
            found[0],
            stage.viewer().stats()
        );
        Ok(())
    }
}

/// Two distances, in radii of the bounding sphere, a hundredth apart, from which the settled cuts differ.
fn threshold(stage: &mut Stage) -> Result<[f64; 2]> {
    let mut previous = None;
    for step in 0..150 {
        let distance = 1.3 * 1.01_f64.powi(step);
        stage.look_from(0, distance)?;
        stage.settle()?;
        let cut = stage.viewer().drawn().cut.clone();
        if let Some((last, other)) = previous.replace((distance, cut.clone()))
            && other != cut
        {
            return Ok([last, distance]);
        }
    }
    anyhow::bail!("every distance shows the same cut")
}

impl Path {
    fn camera(
        self,
        metadata: &Metadata,
        frame: usize,
        threshold: Option<[f64; 2]>,
    ) -> Result<Camera> {
        let standard = Camera::standard(metadata, 0, 2.5)?;
        let radius = (standard.eye - standard.target).length() / 2.5;
        let time = frame as f64;
        Ok(match self {
            Self::Inside => {
                let (sin, cos) = (0.11 * time).sin_cos();
                let eye = DVec3::new(cos, sin, 0.0);
                // Ahead, then to the wall, then back.
                let turn = 0.7 * time;
                let ahead = DVec3::new(-sin, cos, 0.0) * turn.cos() + DVec3::Z * turn.sin();
                Camera {
                    eye,
                    target: eye + 0.2 * ahead,
                    up: eye,
                }
            }
            Self::Teleport => {
                let jump = (frame / 3) as u64;
                let signed = |axis: u64| 2.0 * unit(23, 4 * jump + axis) - 1.0;
                let direction = DVec3::new(signed(0), signed(1), signed(2));
                let direction = direction.try_normalize().unwrap_or(DVec3::Z);
                let distance = 1.1 + 3.0 * unit(23, 4 * jump + 3).powi(2);
                Camera {
                    eye: standard.target + direction * distance * radius,
                    ..standard
                }
            }
            Self::Spin => {
                let (sin, cos) = (0.8 * time).sin_cos();
                let direction = DVec3::new(sin, 0.3, cos).normalize_or_zero();
                Camera {
                    eye: standard.target + direction * 1.3 * radius,
                    ..standard
                }
            }
            Self::Threshold => {
                let ends = threshold.context("no threshold")?;
                Camera::standard(metadata, 0, ends[frame / 2 % 2])?
            }
            Self::Approach => {
                let (sin, cos) = (0.08 * time).sin_cos();
                let direction = DVec3::new(sin, 0.5 * cos, cos).normalize_or_zero();
                let distance = 1.1 + 2.5 * (-0.06 * time).exp();
                Camera {
                    eye: standard.target + direction * distance * radius,
                    ..standard
                }
            }
        })
    }
}
