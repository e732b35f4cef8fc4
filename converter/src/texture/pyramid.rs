//! From a chart's finest texels to its tree of tiles.
//!
//! Coarser levels are area means in linear light. A tile is kept where it, or one below it, shows something that its parent,
//! magnified, does not: where in some block of `BLOCK`² texels the root mean square of the difference exceeds
//! `VISIBLE` sRGB steps. Smooth areas, and areas with fewer source texels than the chart, so cost nothing.

use super::density::ChartTexels;
use super::light::Light;
use super::surround::Surrounded;
use glam::Vec3;
use marquetry_format::TexelSize;
use marquetry_format::colour::GUTTER;

/// Texels a side of the blocks that differences are taken over.
const BLOCK: u32 = 8;
/// Root mean square difference that is worth a tile, in steps of 8-bit sRGB.
const VISIBLE: f32 = 1.5;

/// A tile before compression.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RawTile {
    /// sRGB, gutter included, row by row.
    pub rgb: Vec<u8>,
    /// By quadrant.
    pub children: [Option<Box<RawTile>>; 4],
}

/// The tiles of a chart whose finest level is `finest`.
pub fn tiles(texels: ChartTexels, finest: Surrounded, light: &Light) -> RawTile {
    let mut levels = vec![finest];
    for _ in 0..texels.levels {
        let coarser = levels.last().map(Surrounded::halved);
        levels.extend(coarser);
    }
    levels.reverse();
    let tree = Tree {
        size: texels.size,
        levels: &levels,
        light,
    };
    RawTile {
        rgb: tree.texels(0, 0, 0),
        children: tree.children(0, 0, 0),
    }
}

struct Tree<'a> {
    size: TexelSize,
    /// Coarse to fine.
    levels: &'a [Surrounded],
    light: &'a Light,
}

impl Tree<'_> {
    fn children(&self, level: usize, x: u32, y: u32) -> [Option<Box<RawTile>>; 4] {
        [0, 1, 2, 3].map(|q| {
            let (x, y) = (2 * x + (q & 1), 2 * y + (q >> 1));
            let level = level + 1;
            if level >= self.levels.len() {
                return None;
            }
            let children = self.children(level, x, y);
            let below = children.iter().any(Option::is_some);
            (below || self.shows_more(level, x, y)).then(|| {
                Box::new(RawTile {
                    rgb: self.texels(level, x, y),
                    children,
                })
            })
        })
    }

    /// The stored texels of a tile.
    fn texels(&self, level: usize, x: u32, y: u32) -> Vec<u8> {
        let TexelSize { width, height } = self.size;
        let gutter = i64::from(GUTTER);
        let (first_i, first_j) = (
            i64::from(x * width) - gutter,
            i64::from(y * height) - gutter,
        );
        let (across, up) = self.size.stored();
        let mut rgb = Vec::with_capacity(3 * across as usize * up as usize);
        for j in first_j..first_j + i64::from(up) {
            for i in first_i..first_i + i64::from(across) {
                rgb.extend(self.light.srgb(self.levels[level].at(i, j)));
            }
        }
        rgb
    }

    /// Whether a tile differs visibly from what its parent shows there.
    fn shows_more(&self, level: usize, x: u32, y: u32) -> bool {
        let TexelSize { width, height } = self.size;
        let blocks = (0..height / BLOCK).flat_map(|j| (0..width / BLOCK).map(move |i| (i, j)));
        let count = (BLOCK * BLOCK) as f32;
        blocks.into_iter().any(|(bi, bj)| {
            let mut sum = 0.0;
            for k in 0..BLOCK * BLOCK {
                let i = i64::from(x * width + bi * BLOCK + k % BLOCK);
                let j = i64::from(y * height + bj * BLOCK + k / BLOCK);
                let own = self.levels[level].at(i, j);
                let shown = magnified(&self.levels[level - 1], i, j);
                sum += self.difference(own, shown);
            }
            sum > VISIBLE * VISIBLE * count
        })
    }

    /// Mean squared difference of the channels, sRGB steps.
    fn difference(&self, a: Vec3, b: Vec3) -> f32 {
        let (a, b) = (self.light.srgb(a), self.light.srgb(b));
        let squares = a.iter().zip(b).map(|(&a, b)| {
            let d = f32::from(a) - f32::from(b);
            d * d
        });
        squares.sum::<f32>() / 3.0
    }
}

/// The parent level, bilinearly magnified, at texel (i, j) of the finer one.
fn magnified(parent: &Surrounded, i: i64, j: i64) -> Vec3 {
    let (pi, pj) = (i.div_euclid(2), j.div_euclid(2));
    let other = |k: i64, p: i64| if k.rem_euclid(2) == 0 { p - 1 } else { p + 1 };
    let (oi, oj) = (other(i, pi), other(j, pj));
    let near = parent.at(pi, pj) * 0.75 + parent.at(oi, pj) * 0.25;
    let far = parent.at(pi, oj) * 0.75 + parent.at(oi, oj) * 0.25;
    near * 0.75 + far * 0.25
}

#[cfg(test)]
mod tests {
    use super::super::raster::Picture;
    use super::*;

    fn chart(levels: u8, texel: impl Fn(u32, u32) -> f32) -> RawTile {
        let texels = ChartTexels {
            size: TexelSize {
                width: 16,
                height: 16,
            },
            levels,
        };
        let (width, height) = texels.at(levels);
        let light = |k: u32| Vec3::splat(texel(k % width, k / width));
        let own = Picture {
            width,
            height,
            light: (0..width * height).map(light).collect(),
        };
        let beyond = [const { None }; 4];
        tiles(texels, Surrounded { own, beyond }, &Light::new())
    }

    fn count(tile: &RawTile) -> usize {
        1 + tile
            .children
            .iter()
            .flatten()
            .map(|c| count(c))
            .sum::<usize>()
    }

    #[test]
    fn smooth_charts_have_one_tile() {
        assert_eq!(count(&chart(3, |_, _| 0.3)), 1);
        assert_eq!(count(&chart(3, |i, j| 0.3 + (i + j) as f32 / 2048.0)), 1);
    }

    #[test]
    fn detail_is_kept_where_it_is() {
        // One bright texel in the last quadrant of a level-2 chart: two tiles below the root.
        let tile = chart(2, |i, j| if (i, j) == (60, 60) { 1.0 } else { 0.1 });
        assert_eq!(count(&tile), 3);
        let child = tile.children[3].as_ref().unwrap();
        assert!(child.children[3].is_some());
        let all = chart(2, |i, j| if (i + j) % 2 == 0 { 0.9 } else { 0.1 });
        assert_eq!(count(&all), 21);
    }

    #[test]
    fn coarser_levels_are_means_of_light() {
        let tile = chart(1, |i, _| if i % 2 == 0 { 1.0 } else { 0.0 });
        // Half the light is sRGB 188.
        assert!(tile.rgb.iter().all(|&byte| byte == 188));
    }

    #[test]
    fn tiles_repeat_their_neighbours_texels_in_the_gutter() {
        let tile = chart(1, |i, j| ((i * 7 + j * 13) % 32) as f32 / 32.0);
        let [left, right] = [0, 1].map(|q| &tile.children[q].as_ref().unwrap().rgb);
        let texel = |rgb: &[u8], i: usize, j: usize| rgb[3 * (j * 20 + i)];
        for j in 0..20 {
            for k in 0..4 {
                assert_eq!(texel(left, 16 + k, j), texel(right, k, j));
            }
        }
    }
}
