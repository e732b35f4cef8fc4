//! A viewer on a file in memory, driven step by step and drawn without a window, and what it should be covering.
//!
//! Fetches are answered here and not by the native shell's threads, so that a run is the same every time.

use crate::raster::{self, Picture};
use anyhow::{Context, Result, bail, ensure};
use glam::{DMat4, DVec2, DVec3};
use marquetry_engine::camera::View;
use marquetry_engine::lod::mesh::extract_mesh_in_motion;
use marquetry_engine::{Camera, Request, Viewer, ViewerOptions, Viewport};
use marquetry_evaluation::image::{Image, Mask};
use marquetry_format::{ByteSource, PageId, SliceSource};
use marquetry_native::{Headless, Session};
use std::sync::Arc;

/// Colour that no grey surface shows: full red and blue, no green.
pub const MAGENTA: [u8; 3] = [255, 0, 255];

/// Seconds of one step: short enough for a quarter-second morph to be seen on its way.
pub const STEP_SECONDS: f64 = 0.1;

/// Steps after which a view that has not settled never will: fetches take one step each, and so do morphs' parts.
const STEP_LIMIT: usize = 3000;

/// A viewer whose fetches are answered at once, from memory.
#[derive(Debug)]
pub struct Stage {
    session: Session,
    viewport: Viewport,
    source: Arc<SliceSource<Arc<[u8]>>>,
}

impl Stage {
    /// Shows the file `bytes`, with an empty cache.
    ///
    /// # Errors
    /// When the file or an option is not valid.
    pub fn open(
        headless: &Headless,
        bytes: Arc<[u8]>,
        options: ViewerOptions,
        viewport: Viewport,
    ) -> Result<Self> {
        let source = Arc::new(SliceSource(bytes));
        let shared: Arc<dyn ByteSource> = Arc::<SliceSource<Arc<[u8]>>>::clone(&source);
        Ok(Self {
            session: headless.session(&shared, options)?,
            viewport,
            source,
        })
    }

    /// The viewer.
    pub fn viewer(&mut self) -> &mut Viewer {
        self.session.viewer()
    }

    /// Lets each page pass with probability `share`, always the same ones for the same `seed`. The viewer never fetches a
    /// page whose parent is not let through, so what is resident is closed under parents.
    pub fn let_through(&mut self, share: f64, seed: u64) {
        self.viewer()
            .set_page_filter(Some(Box::new(move |PageId(page)| {
                unit(seed, u64::from(page)) < share
            })));
    }

    /// Looks from standard view `index`, `distance` bounding-sphere radii from the centre.
    ///
    /// # Errors
    /// When there is no such view.
    pub fn look_from(&mut self, index: usize, distance: f64) -> Result<()> {
        let camera = Camera::standard(&self.viewer().document().metadata, index, distance)?;
        self.viewer().set_camera(camera);
        Ok(())
    }

    /// One update, without any answer. Returns what it asks for.
    ///
    /// # Errors
    /// When the cache is over its budget.
    pub fn update(&mut self) -> Result<Vec<Request>> {
        let viewport = self.viewport;
        let requests = self.viewer().update(STEP_SECONDS, viewport);
        self.check_budget()?;
        Ok(requests)
    }

    fn check_budget(&mut self) -> Result<()> {
        let cache = self.viewer().stats().cache;
        ensure!(
            cache.used_bytes <= cache.capacity_bytes,
            "{} bytes in a cache of {}",
            cache.used_bytes,
            cache.capacity_bytes
        );
        Ok(())
    }

    /// The bytes that `request` asks for.
    ///
    /// # Errors
    /// When the file does not have them.
    pub fn read(&self, request: &Request) -> Result<Vec<u8>> {
        self.source
            .read(request.range.clone())
            .with_context(|| format!("{request:?}"))
    }

    /// One update; what it asks for is delivered before the next. Returns how many requests that were.
    ///
    /// # Errors
    /// When the viewer asks for bytes that the file does not have, or complains about those it got.
    pub fn step(&mut self) -> Result<usize> {
        let requests = self.update()?;
        let count = requests.len();
        for request in requests {
            let bytes = self.read(&request)?;
            self.viewer().deliver(request.id, Ok(bytes));
        }
        let failures = self.viewer().take_failures();
        ensure!(failures.is_empty(), "the viewer complains: {failures:?}");
        self.check_budget()?;
        Ok(count)
    }

    /// Steps until nothing is missing and nothing moves. Returns the number of steps.
    ///
    /// # Errors
    /// As [`Stage::step`], or when that never comes.
    pub fn settle(&mut self) -> Result<usize> {
        for steps in 1..=STEP_LIMIT {
            self.step()?;
            if self.viewer().is_settled() {
                return Ok(steps);
            }
        }
        bail!(
            "not settled after {STEP_LIMIT} updates: {:?}",
            self.viewer().stats()
        )
    }

    /// Draws what the viewer shows now: RGBA, row by row from the top.
    ///
    /// # Errors
    /// When the device fails.
    pub fn draw(&mut self) -> Result<Vec<u8>> {
        self.session.draw(self.viewport)?;
        Ok(self.session.read_back()?.rgba)
    }

    /// The pixels of which the surface that is drawn now covers every one of `samples`, but for a rim of one pixel.
    ///
    /// # Errors
    /// When the surface cannot be put together on the CPU.
    pub fn inside(&mut self, samples: &[DVec2]) -> Result<Mask> {
        let picture = self.picture(samples);
        self.covered(&picture)
    }

    /// As [`Stage::inside`], for an eye that may be within the model: triangles that reach before the near plane cover nothing. `together` is
    /// that of [`Picture`].
    ///
    /// # Errors
    /// As [`Stage::inside`].
    pub fn inside_from_within(&mut self, samples: &[DVec2], together: usize) -> Result<Mask> {
        let picture = Picture {
            is_within: true,
            together,
            ..self.picture(samples)
        };
        self.covered(&picture)
    }

    fn covered(&mut self, picture: &Picture<'_>) -> Result<Mask> {
        let viewer = self.session.viewer();
        let source = self.source.as_ref();
        let mesh = extract_mesh_in_motion(viewer.document(), source, viewer.drawn())?;
        Ok(raster::coverage(&mesh.positions, &mesh.triangles, picture)?.eroded())
    }

    /// The picture as the CPU sees it, for positions in lattice coordinates.
    pub fn picture<'a>(&mut self, samples: &'a [DVec2]) -> Picture<'a> {
        let viewport = self.viewport;
        let viewer = self.session.viewer();
        let view = View::new(&viewer.camera(), &viewer.document().metadata, viewport);
        let eye =
            DVec3::from_array(view.eye.whole.map(f64::from)) + DVec3::from_array(view.eye.fraction);
        Picture {
            clip_from_position: view.clip_from_offset * DMat4::from_translation(-eye),
            width: viewport.width as usize,
            height: viewport.height as usize,
            samples,
            is_within: false,
            together: 1,
        }
    }
}

/// Pixels of `inside` that show magenta, wholly or in part, on a surface that is grey.
pub fn holes(image: Image<'_>, inside: &Mask) -> Vec<(usize, usize)> {
    // One of four samples lets through a quarter of the light, which is far more than this.
    const TINT: i32 = 24;
    let tinted = |[r, g, b, _]: [u8; 4]| i32::from(r.min(b)) - i32::from(g) > TINT;
    let pixels = image.pixels().zip(inside.as_slice()).enumerate();
    pixels
        .filter(|&(_, (pixel, &inside))| inside && tinted(pixel))
        .map(|(index, _)| (index % image.width(), index / image.width()))
        .collect()
}

/// Whether tests are to look from everywhere (`MARQUETRY_ALL_VIEWS=1`), and not from as many places as do for a change.
pub fn wants_all_views() -> bool {
    std::env::var_os("MARQUETRY_ALL_VIEWS").is_some_and(|wanted| wanted == "1")
}

/// A number in [0, 1) that depends on `seed` and `counter` alone.
pub fn unit(seed: u64, counter: u64) -> f64 {
    (bits(seed, counter) >> 11) as f64 / (1_u64 << 53) as f64
}

/// 64 bits that depend on `seed` and `counter` alone.
pub fn bits(seed: u64, counter: u64) -> u64 {
    let mut key = seed.to_le_bytes().to_vec();
    key.extend(counter.to_le_bytes());
    xxhash_rust::xxh3::xxh3_64(&key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use marquetry_evaluation::image::silhouette;

    #[test]
    fn partly_magenta_pixels_are_holes_too() {
        // Grey, a quarter magenta (in linear light, sRGB), magenta; once outside of the mask.
        let rgba = [
            100, 100, 100, 255, 152, 87, 152, 255, 255, 0, 255, 255, 255, 0, 255, 255,
        ];
        let image = Image::new(4, 1, &rgba).unwrap();
        let mut inside = Mask::empty(4, 1);
        for x in 0..3 {
            inside.insert(x, 0);
        }
        assert_eq!(holes(image, &inside), [(1, 0), (2, 0)]);
        assert_eq!(silhouette(image, MAGENTA).count(), 2);
    }

    #[test]
    fn shares_of_pages_are_kept() {
        let passed = (0..10_000).filter(|&page| unit(3, page) < 0.3).count();
        assert!((2_800..3_200).contains(&passed));
    }
}
