//! What lies beyond a chart's sides: strips of the neighbours' texels, taken through the glue.
//!
//! Texel k steps beyond a side is the neighbour's texel k steps inside its side, at the same place along the border. Where
//! both charts have the same number of texels along it, these are the very texels that the neighbour has; else the
//! neighbour is sampled at this chart's density. Two neighbours that blend the same pairs of texels across their border
//! show the same colour there. At open sides and at corners the nearest texel is repeated.

use super::raster::{Picture, Region};
use glam::Vec3;
use marquetry_format::Glue;

/// A chart's texels, and beyond its sides: of each a picture whose rows run along the side, the nearest first.
#[derive(Debug, Clone)]
pub struct Surrounded {
    /// The chart.
    pub own: Picture,
    /// By side; `None` where it is open.
    pub beyond: [Option<Picture>; 4],
}

impl Surrounded {
    /// The texel (i, j), which may lie beyond a side.
    pub fn at(&self, i: i64, j: i64) -> Vec3 {
        let (width, height) = (i64::from(self.own.width), i64::from(self.own.height));
        let outside = |depth: i64, side: usize, along: i64| {
            let strip = self.beyond[side].as_ref();
            (depth >= 0).then(|| strip.map(|strip| strip.at(along, depth)))?
        };
        let (ci, cj) = (i.clamp(0, width - 1), j.clamp(0, height - 1));
        let found = [
            outside(-1 - j, 0, ci),
            outside(i - width, 1, cj),
            outside(j - height, 2, width - 1 - ci),
            outside(-1 - i, 3, height - 1 - cj),
        ];
        let known = found.iter().flatten();
        let (sum, count) = known.fold((Vec3::ZERO, 0.0), |(s, n), &c| (s + c, n + 1.0));
        if count > 0.0 {
            sum / count
        } else {
            self.own.at(i, j)
        }
    }

    /// The next coarser level.
    #[must_use]
    pub fn halved(&self) -> Self {
        Self {
            own: self.own.halved(),
            beyond: self
                .beyond
                .each_ref()
                .map(|strip| strip.as_ref().map(Picture::halved)),
        }
    }
}

/// Texels along side `side` of a chart of these texels.
pub fn along((width, height): (u32, u32), side: usize) -> u32 {
    if side.is_multiple_of(2) {
        width
    } else {
        height
    }
}

/// Texels of the neighbour's whole square with which it has `along_own` texels along its glued side; `own` are its own.
pub fn density_of_neighbour(own: (u32, u32), glued: usize, along_own: u32) -> (u32, u32) {
    let there = along(own, glued);
    if there == along_own {
        return own;
    }
    let scaled = |texels: u32| {
        let product = u64::from(texels) * u64::from(along_own);
        let scaled = (product + u64::from(there) / 2) / u64::from(there.max(1));
        u32::try_from(scaled).unwrap_or(u32::MAX).max(1)
    };
    if glued.is_multiple_of(2) {
        (along_own, scaled(own.1))
    } else {
        (scaled(own.0), along_own)
    }
}

/// The part of a chart of `chart` texels that lies within `depth` of its side `side`.
pub fn strip_region(chart: (u32, u32), side: usize, depth: u32) -> Region {
    let (width, height) = chart;
    let (x, y, width, height) = match side {
        0 => (0, 0, width, depth.min(height)),
        1 => (width - depth.min(width), 0, depth.min(width), height),
        2 => (0, height - depth.min(height), width, depth.min(height)),
        _ => (0, 0, depth.min(width), height),
    };
    Region {
        chart,
        x,
        y,
        width,
        height,
    }
}

/// Turns a strip drawn by [`strip_region`] so that its rows run along *our* side, the nearest first, `depth` of them.
pub fn oriented(strip: &Picture, glue: &Glue, depth: u32) -> Picture {
    let side = usize::from(glue.side.0);
    let count = along((strip.width, strip.height), side);
    let (width, height) = (i64::from(strip.width), i64::from(strip.height));
    let mut light = Vec::with_capacity(count as usize * depth as usize);
    for k in 0..i64::from(depth) {
        for t in 0..i64::from(count) {
            let t = if glue.reversed {
                i64::from(count) - 1 - t
            } else {
                t
            };
            light.push(match side {
                0 => strip.at(t, k),
                1 => strip.at(width - 1 - k, t),
                2 => strip.at(width - 1 - t, height - 1 - k),
                _ => strip.at(k, height - 1 - t),
            });
        }
    }
    Picture {
        width: count,
        height: depth,
        light,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use marquetry_format::{ChartId, Side};

    /// A picture whose texel (i, j) says so.
    fn numbered(width: u32, height: u32) -> Picture {
        let texel = |k: u32| Vec3::new((k % width) as f32, (k / width) as f32, 1.0);
        Picture {
            width,
            height,
            light: (0..width * height).map(texel).collect(),
        }
    }

    fn part(picture: &Picture, region: Region) -> Picture {
        let texel = |k: u32| {
            let (i, j) = (region.x + k % region.width, region.y + k / region.width);
            picture.at(i64::from(i), i64::from(j))
        };
        Picture {
            width: region.width,
            height: region.height,
            light: (0..region.width * region.height).map(texel).collect(),
        }
    }

    /// Where texel t along a side and k inside lies, in (i, j).
    fn inside(side: usize, n: i64, t: i64, k: i64) -> (i64, i64) {
        match side {
            0 => (t, k),
            1 => (n - 1 - k, t),
            2 => (n - 1 - t, n - 1 - k),
            _ => (k, n - 1 - t),
        }
    }

    /// For all sides and both directions: our gutter is their texels, and theirs is ours, at the same places.
    #[test]
    fn gutters_are_the_neighbours_texels_on_both_sides() {
        let (n, depth) = (8i64, 2);
        let chart = numbered(8, 8);
        for (own_side, their_side, reversed) in (0..32).map(|k| (k % 4, k / 4 % 4, k / 16 == 0)) {
            let strip = |side: usize, reversed| {
                let region = strip_region((8, 8), side, depth);
                let glue = Glue {
                    chart: ChartId(0),
                    side: Side(u8::try_from(side).unwrap()),
                    reversed,
                };
                oriented(&part(&chart, region), &glue, depth)
            };
            let mut beyond = [const { None }; 4];
            beyond[own_side] = Some(strip(their_side, reversed));
            let ours = Surrounded {
                own: chart.clone(),
                beyond,
            };
            for t in 0..n {
                for k in 0..2 {
                    let (i, j) = match own_side {
                        0 => (t, -1 - k),
                        1 => (n + k, t),
                        2 => (n - 1 - t, n + k),
                        _ => (-1 - k, n - 1 - t),
                    };
                    let theirs = if reversed { n - 1 - t } else { t };
                    let (x, y) = inside(their_side, n, theirs, k);
                    assert_eq!(
                        ours.at(i, j),
                        Vec3::new(x as f32, y as f32, 1.0),
                        "sides {own_side} {their_side} {reversed}, texel {t}, {k} beyond"
                    );
                }
            }
        }
    }

    #[test]
    fn open_sides_repeat_their_texels() {
        let alone = Surrounded {
            own: numbered(8, 8),
            beyond: [const { None }; 4],
        };
        assert_eq!(alone.at(-2, 3), alone.at(0, 3));
        assert_eq!(alone.at(9, 9), alone.at(7, 7));
    }

    #[test]
    fn halving_commutes_with_glue() {
        let chart = numbered(8, 8);
        let glue = Glue {
            chart: ChartId(0),
            side: Side(1),
            reversed: true,
        };
        let fine = oriented(&part(&chart, strip_region((8, 8), 1, 4)), &glue, 4);
        let half = chart.halved();
        let coarse = oriented(&part(&half, strip_region((4, 4), 1, 2)), &glue, 2);
        assert_eq!(fine.halved(), coarse);
    }

    #[test]
    fn a_neighbour_is_sampled_with_as_many_texels_along_the_border() {
        assert_eq!(density_of_neighbour((64, 32), 0, 64), (64, 32));
        assert_eq!(density_of_neighbour((64, 32), 0, 96), (96, 48));
        assert_eq!(density_of_neighbour((64, 32), 1, 96), (192, 96));
    }
}
