//! Plain colours beside others, as images.
//!
//! A vertex has one colour, the mean of what meets there, so without an image two colours of faces run into each other over the whole
//! width of the faces beside their border. These faces, and only these, get an image of a single white texel, repeated, that
//! the colour is multiplied with: `TEXELS` of it are what each is worth, and all that is known about images does the rest.
//!
//! Limits: a border is as sharp as a texel, which is a part of the mean of the faces around it, so faces that are small beside their
//! neighbours are blurred; faces whose vertices have different colours of their own stay as they are.

use super::appearance::{Appearance, ImageFile, Material, NO_MATERIAL, TexturedFace};
use super::light::Light;
use crate::mesh::ImportedMesh;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Texels that a face beside a border is worth.
const TEXELS: f64 = 32.0;

/// A PNG of a white texel.
const WHITE: &[u8] =
    b"\x89PNG\x0d\x0a\x1a\x0a\x00\x00\x00\x0dIHDR\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\x00\
      \x00\x00:~\x9bU\x00\x00\x00\x0aIDATx\xdac\xf8\x0f\x00\x01\x01\x01\x00\x1c\xb0\x8c\x99\
      \x00\x00\x00\x00IEND\xaeB`\x82";

/// What a face shows, as far as borders go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    /// An image, or colours of vertices that differ.
    Varied,
    /// A colour, linear light, by its bits.
    Plain([u32; 3]),
}

impl Look {
    fn plain(colour: Vec3) -> Self {
        // Adding 0 makes −0 and 0 the same.
        Self::Plain((colour + 0.0).to_array().map(f32::to_bits))
    }
}

/// Gives every face of a plain colour that meets another colour or an image, if only at a corner, an image in `appearance`, which is that of `mesh`.
pub fn sharpen(mesh: &ImportedMesh, appearance: &mut Appearance, light: &Light) {
    if appearance.faces.len() != mesh.triangles.len() {
        return;
    }
    let looks: Vec<Look> = (0..mesh.triangles.len())
        .map(|t| look(mesh, appearance, light, t))
        .collect();
    let is_plain = |look: &Look| matches!(look, Look::Plain(_));
    if looks.windows(2).all(|w| w[0] == w[1]) || !looks.iter().any(is_plain) {
        return;
    }
    // Places by what is first seen there, and whether there is something else, too.
    let mut places: HashMap<[u64; 3], (Look, bool)> = HashMap::new();
    let place = |v: u32| {
        (mesh.positions[v as usize] + 0.0)
            .to_array()
            .map(f64::to_bits)
    };
    for (triangle, &look) in mesh.triangles.iter().zip(&looks) {
        for &v in triangle {
            let (first, is_border) = places.entry(place(v)).or_insert((look, false));
            *is_border |= *first != look;
        }
    }
    let Ok(image) = u32::try_from(appearance.images.len()) else {
        return;
    };
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    for (t, look) in looks.into_iter().enumerate() {
        let triangle = mesh.triangles[t];
        let is_border = |&v: &u32| places.get(&place(v)).is_some_and(|&(_, border)| border);
        if let Look::Plain(colour) = look
            && triangle.iter().any(is_border)
            && let Some(uv) = laid_out(triangle.map(|v| mesh.positions[v as usize]))
        {
            let materials = &mut appearance.materials;
            let material = *known.entry(colour).or_insert_with(|| {
                materials.push(Material {
                    image: Some(image),
                    factor: Vec3::from_array(colour.map(f32::from_bits)),
                    ..Material::default()
                });
                u32::try_from(materials.len() - 1).unwrap_or(NO_MATERIAL)
            });
            appearance.faces[t] = TexturedFace { material, uv };
        }
    }
    if !known.is_empty() {
        appearance.images.push(ImageFile {
            name: "a plain colour".to_owned(),
            bytes: WHITE.to_vec(),
        });
    }
}

/// What triangle `t` shows.
fn look(mesh: &ImportedMesh, appearance: &Appearance, light: &Light, t: usize) -> Look {
    let material = appearance
        .materials
        .get(appearance.faces[t].material as usize);
    let material = material.copied().unwrap_or_default();
    if material.image.is_some() {
        return Look::Varied;
    }
    if mesh.colours.is_empty() {
        return Look::plain(material.factor);
    }
    let own = mesh.triangles[t].map(|v| mesh.colours.get(v as usize).copied());
    match own {
        [Some(a), Some(b), Some(c)] if a == b && b == c => {
            Look::plain(material.factor * light.linear(a))
        }
        _ => Look::Varied,
    }
}

/// The triangle in its plane, in units of which [`TEXELS`] squares are its area; `None` without area.
fn laid_out([a, b, c]: [DVec3; 3]) -> Option<[Vec2; 3]> {
    let (ab, ac) = (b - a, c - a);
    let (base, doubled) = (ab.length(), ab.cross(ac).length());
    let unit = (2.0 * TEXELS / doubled).sqrt();
    let along = ac.dot(ab) / base;
    let uv = [
        Vec2::ZERO,
        DVec2::new(base * unit, 0.0).as_vec2(),
        DVec2::new(along * unit, doubled / base * unit).as_vec2(),
    ];
    (unit > 0.0 && uv.iter().all(|uv| uv.is_finite())).then_some(uv)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::images::Texels;

    /// A strip of six squares of two triangles each, whose materials are `materials`.
    fn strip(materials: [u32; 6], colours: Vec<[u8; 3]>) -> (ImportedMesh, Appearance) {
        let mut mesh = ImportedMesh {
            colours,
            ..ImportedMesh::default()
        };
        let mut faces = Vec::new();
        for (n, material) in (0u32..).zip(materials) {
            // Every square has its own corners.
            let a = 4 * n;
            for [x, y] in [[0, 0], [1, 0], [1, 3], [0, 3]] {
                mesh.positions
                    .push(DVec3::new(f64::from(n + x), f64::from(y), 5.0));
            }
            mesh.triangles
                .extend([[a, a + 1, a + 2], [a, a + 2, a + 3]]);
            faces.extend(
                [TexturedFace {
                    material,
                    ..TexturedFace::PLAIN
                }; 2],
            );
        }
        let plain = |factor| Material {
            factor,
            ..Material::default()
        };
        let appearance = Appearance {
            images: vec![ImageFile::default()],
            materials: vec![
                plain(Vec3::X),
                plain(Vec3::Y),
                Material {
                    image: Some(0),
                    ..plain(Vec3::Z)
                },
            ],
            faces,
            ..Appearance::default()
        };
        (mesh, appearance)
    }

    /// By square: whether an image is shown that was none of the source's, and the factor.
    fn shown(appearance: &Appearance) -> Vec<(bool, Vec3)> {
        let shown = |face: &TexturedFace| {
            let material = appearance.materials.get(face.material as usize);
            let material = material.copied().unwrap_or_default();
            (material.image == Some(1), material.factor)
        };
        let faces: Vec<_> = appearance.faces.iter().map(shown).collect();
        assert!(faces.chunks(2).all(|square| square[0] == square[1]));
        faces.into_iter().step_by(2).collect()
    }

    #[test]
    fn faces_beside_another_colour_get_an_image_of_their_own_colour() {
        let (mesh, mut appearance) = strip([0, 0, 1, 1, 1, NO_MATERIAL], Vec::new());
        sharpen(&mesh, &mut appearance, &Light::new());
        let (x, y, white) = (Vec3::X, Vec3::Y, Vec3::ONE);
        assert_eq!(
            shown(&appearance),
            [
                (false, x),
                (true, x),
                (true, y),
                (false, y),
                (true, y),
                (true, white)
            ]
        );
        let image = Texels::decode(&appearance.images[1]).unwrap();
        assert_eq!(
            (image.width, image.height, image.rgb),
            (1, 1, vec![[255; 3]])
        );
        // Laid out without distortion, of the area that was asked for.
        for face in &appearance.faces[2..4] {
            let [a, b, c] = face.uv;
            assert!((f64::from((b - a).perp_dot(c - a)) / 2.0 - TEXELS).abs() < 1e-3);
        }
        let [a, b, c] = appearance.faces[2].uv;
        assert!((3.0 * (b - a).length() - (c - b).length()).abs() < 1e-4);
        assert!((b - a).dot(c - b).abs() < 1e-3);
    }

    #[test]
    fn faces_beside_an_image_do_not_take_its_colours() {
        let (mesh, mut appearance) = strip([2, 2, NO_MATERIAL, NO_MATERIAL, 2, 2], Vec::new());
        let before = appearance.faces.clone();
        sharpen(&mesh, &mut appearance, &Light::new());
        let found = shown(&appearance);
        assert_eq!(found[2..4], [(true, Vec3::ONE); 2]);
        assert_eq!(appearance.faces[..4], before[..4]);
        assert_eq!(appearance.faces[8..], before[8..]);
    }

    #[test]
    fn what_has_no_borders_stays() {
        for materials in [[0; 6], [2; 6], [NO_MATERIAL; 6]] {
            let (mesh, mut appearance) = strip(materials, Vec::new());
            let before = appearance.faces.clone();
            sharpen(&mesh, &mut appearance, &Light::new());
            assert_eq!(appearance.faces, before);
            assert_eq!(appearance.images.len(), 1);
        }
    }

    #[test]
    fn colours_of_vertices_count_where_a_face_has_one() {
        let mut colours = vec![[255, 0, 0]; 24];
        colours[20] = [1, 2, 3];
        let (mesh, mut appearance) = strip([NO_MATERIAL, NO_MATERIAL, 1, 1, 0, 0], colours);
        let before = appearance.faces[10];
        sharpen(&mesh, &mut appearance, &Light::new());
        // What is red alone is dark by a green material, and stays red by a red one.
        assert_eq!(appearance.faces[10..], [before; 2]);
        appearance.faces.truncate(10);
        assert_eq!(
            shown(&appearance),
            [
                (false, Vec3::ONE),
                (true, Vec3::X),
                (true, Vec3::ZERO),
                (true, Vec3::ZERO),
                (true, Vec3::X)
            ]
        );
    }
}
