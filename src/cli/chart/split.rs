//! The input as it is drawn and simplified: one vertex for each position, material and place on a texture.
//!
//! Normals are those of positions, weighed as in [`marquetry_converter::mesh::normals`]. Limit: sharp edges of CAD models look round.

use super::super::reference::Reference;
use anyhow::Context;
use glam::{DVec3, Vec2};
use marquetry_converter::mesh::normals::vertex_normals;
use marquetry_converter::texture::appearance::{Appearance, NO_MATERIAL, Wrap};
use marquetry_converter::texture::images::Texels;
use marquetry_converter::texture::light::Light;
use marquetry_evaluation::distance::Mesh;
use marquetry_native::mesh::{self, MeshTexture, Part, PlainMesh, Vertex};
use std::collections::HashMap;

/// A mesh whose vertices have everything that is drawn of them. Triangles whose corners coincide are left out.
#[derive(Debug, Clone, Default)]
pub(super) struct SplitMesh {
    pub(super) vertices: Vec<Vertex>,
    /// By vertex; [`NO_MATERIAL`] for none.
    pub(super) materials: Vec<u32>,
    /// Corners of one triangle have one material.
    pub(super) triangles: Vec<[u32; 3]>,
}

impl SplitMesh {
    /// Splits the vertices of `reference`.
    pub(super) fn new(reference: &Reference) -> Self {
        let mesh = &reference.mesh;
        let (first, normals) = welded(&mesh.positions, &mesh.triangles);
        let light = Light::new();
        let mut split = Self::default();
        let mut known = HashMap::new();
        for (number, triangle) in mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|v| first[v as usize]);
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                continue;
            }
            let face = mesh.appearance.faces.get(number);
            let material = face.map_or(NO_MATERIAL, |face| face.material);
            let look = mesh.appearance.materials.get(material as usize);
            let factor = look.map(|material| light.srgb(material.factor));
            // Plain colours are those of vertices: there may be as many as faces.
            let has_image = look.is_some_and(|material| material.image.is_some());
            let material = if has_image { material } else { NO_MATERIAL };
            let corners = [0, 1, 2].map(|k: usize| {
                let uv = face.map_or(Vec2::ZERO, |face| face.uv[k]);
                let own = mesh.colours.get(triangle[k] as usize).copied();
                let colour = factor.or(own).unwrap_or([255; 3]);
                let key = (
                    corners[k],
                    material,
                    uv.to_array().map(f32::to_bits),
                    colour,
                );
                let next = split.vertices.len();
                *known.entry(key).or_insert_with(|| {
                    split.vertices.push(Vertex {
                        position: mesh.positions[corners[k] as usize],
                        normal: normals[corners[k] as usize].as_vec3(),
                        colour,
                        uv,
                    });
                    split.materials.push(material);
                    u32::try_from(next).unwrap_or(u32::MAX)
                })
            });
            split.triangles.push(corners);
        }
        split
    }

    /// As it is drawn: triangles of one material side by side.
    pub(super) fn plain(&self) -> PlainMesh {
        let material_of = |triangle: &[u32; 3]| self.materials[triangle[0] as usize];
        let mut triangles = self.triangles.clone();
        triangles.sort_by_key(material_of);
        let mut parts: Vec<Part> = Vec::new();
        let mut start = 0;
        for run in triangles.chunk_by(|a, b| material_of(a) == material_of(b)) {
            let material = run.first().map_or(NO_MATERIAL, material_of);
            parts.push(Part {
                triangles: start..start + run.len(),
                texture: (material != NO_MATERIAL).then_some(material as usize),
            });
            start += run.len();
        }
        PlainMesh {
            vertices: self.vertices.clone(),
            triangles,
            parts,
        }
    }
}

/// For every vertex the first at the same position, and at each of those the normal.
fn welded(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<DVec3>) {
    let mut known = HashMap::with_capacity(positions.len());
    let first: Vec<u32> = (0..)
        .zip(positions)
        // Adding 0 makes −0 and 0 the same.
        .map(|(vertex, p)| {
            *known
                .entry((*p + 0.0).to_array().map(f64::to_bits))
                .or_insert(vertex)
        })
        .collect();
    let welded: Vec<[u32; 3]> = triangles
        .iter()
        .map(|triangle| triangle.map(|v| first[v as usize]))
        .collect();
    let mut normals = vertex_normals(Mesh {
        positions,
        triangles: &welded,
    });
    for normal in &mut normals {
        *normal = normal.normalize_or_zero();
    }
    (first, normals)
}

/// The texture of every material up to the last that has an image, white where there is none.
///
/// # Errors
/// When an image is damaged.
pub(super) fn textures(appearance: &Appearance) -> anyhow::Result<Vec<MeshTexture>> {
    let texture = |material: &marquetry_converter::texture::appearance::Material| {
        let wrap = material.wrap.map(|wrap| match wrap {
            Wrap::Repeat => mesh::Wrap::Repeat,
            Wrap::Mirror => mesh::Wrap::Mirror,
            Wrap::Clamp => mesh::Wrap::Clamp,
        });
        let Some(image) = material.image else {
            return Ok(MeshTexture {
                width: 1,
                height: 1,
                texels: vec![[255; 3]],
                wrap,
            });
        };
        let file = appearance.images.get(image as usize);
        let texels = Texels::decode(file.context("a material names an image that is not there")?)?;
        Ok(MeshTexture {
            width: texels.width,
            height: texels.height,
            texels: texels.rgb,
            wrap,
        })
    };
    let materials = &appearance.materials;
    let last = materials.iter().rposition(|m| m.image.is_some());
    let used = last.map_or(0, |last| last + 1);
    materials[..used].iter().map(texture).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use marquetry_converter::mesh::ImportedMesh;
    use marquetry_converter::texture::appearance::{Material, TexturedFace};

    fn reference(mesh: ImportedMesh) -> Reference {
        Reference {
            mesh,
            min: DVec3::ZERO,
            max: DVec3::ONE,
        }
    }

    /// Two triangles of a square, all corners apart, and one without extent.
    fn square() -> ImportedMesh {
        let (a, b, c, d) = (DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y);
        ImportedMesh {
            positions: vec![a, b, c, a, c, d, -a, b, b],
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            ..ImportedMesh::default()
        }
    }

    #[test]
    fn equal_corners_are_one_vertex_and_normals_are_shared() {
        let split = SplitMesh::new(&reference(square()));
        assert_eq!((split.vertices.len(), split.triangles.len()), (4, 2));
        let up = |vertex: &Vertex| (vertex.normal.as_dvec3() - DVec3::Z).length() < 1e-6;
        assert!(split.vertices.iter().all(up));
        let plain = split.plain();
        assert_eq!(plain.parts.len(), 1);
        assert_eq!(plain.parts[0].triangles, 0..2);
    }

    #[test]
    fn images_part_vertices_and_triangles_and_plain_colours_vertices_alone() {
        let mesh = square();
        let face = |material| TexturedFace {
            material,
            uv: [Vec2::ZERO; 3],
        };
        let looks = |image: Option<u32>, factor| Material {
            image,
            factor,
            ..Material::default()
        };
        let parts = |materials: [Material; 2]| {
            let mut mesh = mesh.clone();
            mesh.appearance.materials = materials.to_vec();
            mesh.appearance.faces = vec![face(1), face(0), face(1)];
            let split = SplitMesh::new(&reference(mesh));
            assert_eq!(split.vertices.len(), 6);
            let parts = split.plain().parts.into_iter();
            parts.map(|part| part.texture).collect::<Vec<_>>()
        };
        let images = [0, 1].map(|image| looks(Some(image), Vec3::ONE));
        assert_eq!(parts(images), [Some(0), Some(1)]);
        let colours = [Vec3::X, Vec3::Y].map(|colour| looks(None, colour));
        assert_eq!(parts(colours), [None]);
        let appearance = |materials: &[Material]| Appearance {
            materials: materials.to_vec(),
            ..Appearance::default()
        };
        assert!(textures(&appearance(&colours)).unwrap().is_empty());
    }
}
