//! Triangles on which an image has next to no texels: a colour each.
//!
//! Scans end in triangles of any size, each the colour of what lies there. Images with as many texels as theirs would be blurred from
//! one to the next all over, and images that are not would have nothing in them. So these triangles keep their colours as those of
//! vertices that they do not share, and have no texels.

use super::appearance::Appearance;
use super::light::Light;
use glam::{DVec3, Vec2, Vec3};
use std::collections::{BTreeMap, HashMap};

/// Texels of a sparse triangle are fewer.
const FEW: f64 = 4.0;
/// And along a length it has fewer than this part of what most of the images' texels are on.
const SPARSE: f64 = 1.0 / 16.0;

/// Colours of sparse triangles by number of the imported one, sRGB.
pub type Sparse = HashMap<u32, [u8; 3]>;

/// The sparse ones of the `triangles` that `appearance` covers, whose colours are `means`. `sizes` has those of images.
pub fn find(
    (positions, triangles): (&[DVec3], &[[u32; 3]]),
    appearance: &Appearance,
    sizes: &[Option<Vec2>],
    means: &[Option<Vec3>],
    light: &Light,
) -> Sparse {
    // Number, texels, texels along a unit of length.
    let known = || {
        let covered = (0u32..).zip(triangles).zip(&appearance.faces);
        covered.filter_map(|((number, triangle), face)| {
            let size = (*sizes.get(appearance.image_of(face)? as usize)?)?;
            let texels = f64::from(face.texels(size));
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            let density = (texels / area).sqrt();
            (area > 0.0 && density.is_finite()).then_some((number, texels, density))
        })
    };
    let usual = usual(known().map(|(_, texels, density)| (texels, density)));
    known()
        .filter(|&(_, texels, density)| texels < FEW && density < SPARSE * usual)
        .filter_map(|(number, _, _)| {
            let mean = (*means.get(number as usize)?)?;
            Some((number, light.srgb(mean)))
        })
        .collect()
}

/// The density that half of all texels have at most, to a twelfth of a factor of two; 0 without texels.
fn usual(known: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut counts: BTreeMap<i32, f64> = BTreeMap::new();
    for (texels, density) in known.filter(|&(texels, _)| texels > 0.0) {
        #[expect(clippy::cast_possible_truncation, reason = "a logarithm")]
        let step = (12.0 * density.log2()).floor() as i32;
        *counts.entry(step).or_default() += texels;
    }
    let half = 0.5 * counts.values().sum::<f64>();
    let mut sum = 0.0;
    let found = counts.iter().find(|(_, texels)| {
        sum += **texels;
        sum >= half
    });
    found.map_or(0.0, |(&step, _)| (f64::from(step) / 12.0).exp2())
}

#[cfg(test)]
mod tests {
    use super::super::appearance::{ImageFile, Material, TexturedFace};
    use super::*;

    /// Right triangles with legs of `lengths`, and of as many texels as `texels` says.
    fn sparse(lengths: &[f64], texels: &[f32]) -> Vec<u32> {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (k, length) in (0u32..).zip(lengths) {
            positions.extend([DVec3::ZERO, DVec3::X * *length, DVec3::Y * *length]);
            triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        let face = |&texels: &f32| TexturedFace {
            material: 0,
            uv: [Vec2::ZERO, Vec2::X * texels / 64.0, Vec2::Y * texels / 64.0],
        };
        let appearance = Appearance {
            images: vec![ImageFile::default()],
            materials: vec![Material {
                image: Some(0),
                ..Material::default()
            }],
            faces: texels.iter().map(face).collect(),
            ..Appearance::default()
        };
        let means = vec![Some(Vec3::ONE); texels.len()];
        let sizes = [Some(Vec2::splat(64.0))];
        let mesh = (&*positions, &*triangles);
        let found = find(mesh, &appearance, &sizes, &means, &Light::new());
        assert!(found.values().all(|colour| *colour == [255; 3]));
        let mut numbers: Vec<u32> = found.into_keys().collect();
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn what_is_large_and_has_next_to_no_texels_is_sparse() {
        // Of the last two one has texels enough, and one the density of the others.
        let lengths = [1.0, 1.0, 50.0, 50.0, 0.1];
        let texels = [20.0, 20.0, 0.3, 8.0, 2.0];
        assert_eq!(sparse(&lengths, &texels), [2]);
    }

    #[test]
    fn images_with_few_texels_all_over_are_images() {
        assert!(sparse(&[1.0, 2.0, 1.0], &[0.5, 1.0, 0.5]).is_empty());
        assert!(sparse(&[1.0, 1.0], &[0.0, 0.0]).is_empty());
    }
}
