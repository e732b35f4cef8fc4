//! Colour tiles of every chart.

use super::appearance::{Appearance, TexturedFace};
use super::density::{self, ChartTexels};
use super::encode::{self, EncodeError};
use super::images::{ImageError, ImageStore, Texels};
use super::light::Light;
use super::pyramid;
use super::raster::{Canvas, Picture, Region};
use super::source::SourceMesh;
use super::surround::{Surrounded, along, density_of_neighbour, oriented, strip_region};
use crate::atlas::patch::Patch;
use crate::parameterize::Parametrization;
use glam::Vec2;
use marquetry_format::Glue;
use marquetry_format::colour::GUTTER;
use marquetry_format::writer::{ChartTiles, ColourInput};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Tiles that cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TextureError {
    /// An image of the input is damaged.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Our fault.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// What the tiles are made of.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// Patches in chart order.
    pub patches: &'a [Patch],
    /// How each lies on its square.
    pub parametrizations: &'a [Parametrization],
    /// Glue by chart and side.
    pub glue: &'a [[Option<Glue>; 4]],
    /// The imported triangles.
    pub source: &'a SourceMesh,
    /// What covers them.
    pub appearance: &'a Appearance,
    /// Their images.
    pub images: &'a ImageStore<'a>,
}

/// Samples, filters and compresses the tiles of every chart that shows an image. The same for any number of threads.
///
/// # Errors
/// When an image is damaged.
pub fn build(
    input: Input<'_>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<ColourInput, TextureError> {
    let light = Light::new();
    let sizes = image_sizes(input.appearance)?;
    let faces: Vec<Vec<TexturedFace>> = input
        .patches
        .par_iter()
        .map(|patch| input.source.faces_of(patch, input.appearance))
        .collect();
    let image_size = |face: &TexturedFace| {
        let image = input.appearance.image_of(face)?;
        sizes.get(image as usize).copied().flatten()
    };
    let texels: Vec<Option<ChartTexels>> = (0..input.patches.len())
        .into_par_iter()
        .map(|chart| {
            let patch = &input.patches[chart];
            density::of(
                patch,
                &input.parametrizations[chart],
                &faces[chart],
                image_size,
            )
        })
        .collect();
    let charts = Charts {
        input,
        faces,
        texels,
        light,
    };
    let done = AtomicUsize::new(0);
    (0..charts.texels.len())
        .into_par_iter()
        .map(|chart| {
            let tiles = charts.tiles(chart)?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(done as f64 / charts.texels.len() as f64);
            Ok(tiles)
        })
        .collect()
}

/// Width and height of every image that a material uses.
///
/// # Errors
/// When the header of one is damaged.
pub fn image_sizes(appearance: &Appearance) -> Result<Vec<Option<Vec2>>, ImageError> {
    let count = u32::try_from(appearance.images.len()).unwrap_or(u32::MAX);
    let size = |image: u32| {
        let used = appearance
            .materials
            .iter()
            .any(|material| material.image == Some(image));
        used.then(|| {
            let (width, height) = Texels::dimensions(&appearance.images[image as usize])?;
            Ok(Vec2::new(width as f32, height as f32))
        })
        .transpose()
    };
    (0..count).into_par_iter().map(size).collect()
}

struct Charts<'a> {
    input: Input<'a>,
    faces: Vec<Vec<TexturedFace>>,
    texels: Vec<Option<ChartTexels>>,
    light: Light,
}

impl Charts<'_> {
    fn tiles(&self, chart: usize) -> Result<Option<ChartTiles>, TextureError> {
        let Some(texels) = self.texels[chart] else {
            return Ok(None);
        };
        let finest = self.surrounded(chart, texels)?;
        let raw = pyramid::tiles(texels, finest, &self.light);
        Ok(Some(ChartTiles {
            size: texels.size,
            root: encode::tree(raw, texels.size)?,
        }))
    }

    /// The finest texels of a chart and, beyond its sides, as many of its neighbours' as the coarsest gutter takes.
    fn surrounded(&self, chart: usize, texels: ChartTexels) -> Result<Surrounded, ImageError> {
        let density = texels.at(texels.levels);
        let own = self.draw(
            chart,
            Region {
                chart: density,
                x: 0,
                y: 0,
                width: density.0,
                height: density.1,
            },
        )?;
        let depth = GUTTER << texels.levels;
        let mut beyond = [const { None }; 4];
        for (side, strip) in beyond.iter_mut().enumerate() {
            let Some(glue) = &self.input.glue[chart][side] else {
                continue;
            };
            let (other, glued) = (glue.chart.0 as usize, usize::from(glue.side.0));
            let count = along(density, side);
            let there = match self.texels[other] {
                Some(texels) => density_of_neighbour(texels.at(texels.levels), glued, count),
                None => (count, count),
            };
            let drawn = self.draw(other, strip_region(there, glued, depth))?;
            *strip = Some(oriented(&drawn, glue, depth));
        }
        Ok(Surrounded { own, beyond })
    }

    fn draw(&self, chart: usize, region: Region) -> Result<Picture, ImageError> {
        let faces = &self.faces[chart];
        let mut images: BTreeMap<u32, Arc<Texels>> = BTreeMap::new();
        for face in faces {
            if let Some(image) = self.input.appearance.image_of(face)
                && !images.contains_key(&image)
            {
                images.insert(image, self.input.images.get(image)?);
            }
        }
        let canvas = Canvas {
            patch: &self.input.patches[chart],
            parametrization: &self.input.parametrizations[chart],
            faces,
            materials: &self.input.appearance.materials,
            images,
        };
        Ok(canvas.draw(region, &self.light))
    }
}
