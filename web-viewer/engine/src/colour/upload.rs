//! Texels with their mips, on their way to a slot.

use super::slots::{MIPS, TileSlot};
use marquetry_format::TileTexels;
use std::sync::LazyLock;

/// One mip: RGBA, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mip {
    /// Texels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row.
    pub rgba: Vec<[u8; 4]>,
}

/// A tile for the GPU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileUpload {
    /// Where it goes.
    pub slot: TileSlot,
    /// Fine to coarse, [`MIPS`] of them.
    pub mips: Vec<Mip>,
}

/// sRGB to linear light and back, by table.
#[derive(Debug)]
pub struct LightTables {
    linear: [f32; 256],
    /// By root of the light, so that dark shades have as many entries as bright ones.
    srgb: Vec<u8>,
}

/// Entries of the table back.
const ROOTS: u16 = 4096;

impl Default for LightTables {
    fn default() -> Self {
        let mut linear = [0.0; 256];
        for (value, byte) in linear.iter_mut().zip(0u8..) {
            let c = f32::from(byte) / 255.0;
            *value = if c <= 0.040_45 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            };
        }
        let srgb = (0..ROOTS).map(|i| {
            let root = f32::from(i) / f32::from(ROOTS - 1);
            let light = root * root;
            let c = if light <= 0.003_130_8 {
                12.92 * light
            } else {
                1.055 * light.powf(1.0 / 2.4) - 0.055
            };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within 0..=255"
            )]
            let byte = (c * 255.0 + 0.5) as u8;
            byte
        });
        Self {
            linear,
            srgb: srgb.collect(),
        }
    }
}

impl LightTables {
    /// Tables made once, for all threads.
    pub fn shared() -> &'static Self {
        static TABLES: LazyLock<LightTables> = LazyLock::new(LightTables::default);
        &TABLES
    }

    fn mean(&self, texels: [[u8; 4]; 4]) -> [u8; 4] {
        let channel = |k: usize| {
            let sum: f32 = texels.iter().map(|t| self.linear[usize::from(t[k])]).sum();
            let root = (0.25 * sum).sqrt() * f32::from(ROOTS - 1) + 0.5;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the table"
            )]
            let index = root as usize;
            self.srgb.get(index).copied().unwrap_or(255)
        };
        [channel(0), channel(1), channel(2), 255]
    }
}

/// The image of `tile` with its outermost texels repeated over a `margin`, and its mips.
pub fn mips(tile: &TileTexels, margin: u32, tables: &LightTables) -> Vec<Mip> {
    let (width, height) = (tile.width + 2 * margin, tile.height + 2 * margin);
    let texel = |x: u32, y: u32| {
        let inside = |at: u32, count: u32| at.saturating_sub(margin).min(count.max(1) - 1);
        let index = inside(y, tile.height) * tile.width + inside(x, tile.width);
        let start = 3 * usize::try_from(index).unwrap_or(usize::MAX);
        match tile.rgb.get(start..) {
            Some([r, g, b, ..]) => [*r, *g, *b, 255],
            _ => [0, 0, 0, 255],
        }
    };
    let rows = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mut mips = vec![Mip {
        width,
        height,
        rgba: rows.map(|(x, y)| texel(x, y)).collect(),
    }];
    for _ in 1..MIPS {
        let next = mips.last().map(|mip| halved(mip, tables));
        mips.extend(next);
    }
    mips
}

fn halved(mip: &Mip, tables: &LightTables) -> Mip {
    let (width, height) = (mip.width / 2, mip.height / 2);
    let at = |x: u32, y: u32| {
        let index = usize::try_from(y * mip.width + x).unwrap_or(usize::MAX);
        mip.rgba.get(index).copied().unwrap_or_default()
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (2 * x, 2 * y)));
    let mean = |(x, y)| tables.mean([at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)]);
    Mip {
        width,
        height,
        rgba: places.map(mean).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mips_are_means_of_light_and_the_margin_repeats_the_edge() {
        let (width, height) = (12, 12);
        let column = |k: u32| {
            if k.is_multiple_of(2) {
                [255; 3]
            } else {
                [0; 3]
            }
        };
        let tile = TileTexels {
            width,
            height,
            rgb: (0..width * height)
                .flat_map(|k| column(k % width))
                .collect(),
        };
        let mips = mips(&tile, 6, LightTables::shared());
        let sizes: Vec<u32> = mips.iter().map(|mip| mip.width).collect();
        assert_eq!(sizes, [24, 12, 6, 3]);
        let rows = |mip: &Mip| mip.rgba[..mip.width as usize].to_vec();
        assert_eq!(rows(&mips[0])[..7], [[255; 4]; 7]);
        // The six texels of the margin, then three pairs of black and white; half the light is sRGB 188.
        let grey = [188, 188, 188, 255];
        assert_eq!(rows(&mips[1])[..6], [[[255; 4]; 3], [grey; 3]].concat());
    }
}
