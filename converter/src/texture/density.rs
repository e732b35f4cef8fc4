//! How many texels a chart is worth.
//!
//! Along u and along v, the density of the source's texels over the chart (texels a unit of the square) is taken for every
//! textured triangle; the chart gets the density that `SHARE` of its textured area does not exceed. Parts with fewer are
//! stored at coarser levels only, where that shows no difference.

use super::appearance::TexturedFace;
use crate::atlas::patch::Patch;
use crate::parameterize::Parametrization;
use glam::{DVec2, Vec2};
use marquetry_format::TexelSize;
use marquetry_format::colour::{MOST_TEXELS, TEXEL_STEP};

/// Share of the textured area of a chart that gets as many texels as the source has.
const SHARE: f64 = 0.7;
/// Levels below the root at most: 4096 texels a side.
pub const MOST_LEVELS: u8 = 5;

/// Texels of a chart: tiles of `size` at level 0, twice as many a side at every further level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartTexels {
    /// Of every tile.
    pub size: TexelSize,
    /// Finest level.
    pub levels: u8,
}

impl ChartTexels {
    /// Texels along u and v at a level.
    pub fn at(self, level: u8) -> (u32, u32) {
        (self.size.width << level, self.size.height << level)
    }
}

/// The texels of a chart whose triangles are covered by `faces`; `None` where nothing is textured. `image_size` gives
/// the texels of the image on a face.
pub fn of(
    patch: &Patch,
    parametrization: &Parametrization,
    faces: &[TexturedFace],
    image_size: impl Fn(&TexturedFace) -> Option<Vec2>,
) -> Option<ChartTexels> {
    let mut along: [Vec<(f64, f64)>; 2] = Default::default();
    for (corners, face) in patch.triangles.iter().zip(faces) {
        let Some(size) = image_size(face) else {
            continue;
        };
        let chart = corners.map(|v| parametrization.uv[v as usize]);
        let image = face.uv.map(|uv| (uv * size).as_dvec2());
        let Some((area, densities)) = densities(chart, image) else {
            continue;
        };
        for (list, density) in along.iter_mut().zip(densities) {
            list.push((density, area));
        }
    }
    let [u, v] = along.map(|mut list| share_below(&mut list));
    fitting(u?, v?)
}

/// Area of a triangle of the chart, and image texels a unit along u and v.
fn densities([a, b, c]: [DVec2; 3], [p, q, r]: [DVec2; 3]) -> Option<(f64, [f64; 2])> {
    let (ab, ac) = (b - a, c - a);
    let area = ab.perp_dot(ac);
    let (pq, pr) = (q - p, r - p);
    let along_u = (pq * ac.y - pr * ab.y) / area;
    let along_v = (pr * ab.x - pq * ac.x) / area;
    let densities = [along_u.length(), along_v.length()];
    (area.abs() > 0.0 && densities.iter().all(|d| d.is_finite()))
        .then_some((0.5 * area.abs(), densities))
}

/// The density that [`SHARE`] of the area does not exceed.
fn share_below(list: &mut [(f64, f64)]) -> Option<f64> {
    list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let wanted = SHARE * list.iter().map(|&(_, area)| area).sum::<f64>();
    let mut sum = 0.0;
    let found = list.iter().find(|&&(_, area)| {
        sum += area;
        sum >= wanted
    });
    found.or(list.last()).map(|&(density, _)| density)
}

/// The smallest texels of at least `u` by `v`.
fn fitting(u: f64, v: f64) -> Option<ChartTexels> {
    let most = u.max(v);
    if most < 1.0 {
        return None;
    }
    let levels = (most / f64::from(MOST_TEXELS)).log2().ceil();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let levels = levels.clamp(0.0, f64::from(MOST_LEVELS)) as u8;
    let side = |texels: f64| {
        let steps = (texels / f64::from(TEXEL_STEP << levels)).ceil();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped"
        )]
        let steps = steps.clamp(1.0, f64::from(MOST_TEXELS / TEXEL_STEP)) as u32;
        steps * TEXEL_STEP
    };
    let size = TexelSize {
        width: side(u),
        height: side(v),
    };
    Some(ChartTexels { size, levels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_get_no_more_texels_than_the_source_has() {
        for (u, v, width, height, levels) in [
            (1.0, 1.0, 8, 8, 0),
            (100.0, 40.0, 104, 40, 0),
            (128.0, 128.0, 128, 128, 0),
            (130.0, 60.0, 72, 32, 1),
            (1000.0, 3.0, 128, 8, 3),
            (1e9, 1e9, 128, 128, MOST_LEVELS),
        ] {
            let expected = ChartTexels {
                size: TexelSize { width, height },
                levels,
            };
            assert_eq!(fitting(u, v), Some(expected), "{u} {v}");
        }
        assert_eq!(fitting(0.2, 0.5), None);
    }

    #[test]
    fn densities_are_texels_a_unit() {
        let chart = [DVec2::ZERO, DVec2::X * 0.5, DVec2::Y * 0.5];
        let image = [
            DVec2::new(5.0, 5.0),
            DVec2::new(5.0, 25.0),
            DVec2::new(2.0, 9.0),
        ];
        let (area, [u, v]) = densities(chart, image).unwrap();
        assert!((area - 0.125).abs() < 1e-12);
        assert!(
            (u - 40.0).abs() < 1e-9 && (v - 10.0).abs() < 1e-9,
            "{u} {v}"
        );
        assert!(densities([DVec2::ZERO; 3], image).is_none());
    }

    #[test]
    fn a_few_dense_triangles_do_not_decide() {
        let mut list = vec![(50.0, 0.1), (10.0, 0.6), (20.0, 0.3)];
        assert_eq!(share_below(&mut list), Some(20.0));
        assert_eq!(share_below(&mut []), None);
    }
}
