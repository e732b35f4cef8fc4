//! Materials: base colour factor and texture, sampler, `KHR_texture_transform`, `EXT_texture_webp`.
//!
//! An image that is missing, or texture coordinates that are, cost a warning and the texture, not the conversion. Normal maps
//! are counted.

use super::Document;
use crate::error::ParseError;
use crate::import::faces::Faces;
use crate::import::references;
use crate::texture::appearance::{
    Appearance, ImageFile, Material, NO_MATERIAL, TexturedFace, Wrap,
};
use ::gltf::json::mesh::{Primitive, Semantic};
use ::gltf::json::texture::WrappingMode;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Accessor, Index, material, texture};
use glam::{Mat3, Vec2, Vec3};
use std::collections::BTreeMap;
use std::path::Path;

/// What the triangles of one primitive wear.
#[derive(Debug)]
pub(super) struct Use {
    material: usize,
    /// By number of the set.
    uvs: BTreeMap<u32, Index<Accessor>>,
    first_vertex: u32,
    /// One past the last triangle.
    end: u64,
}

impl Use {
    /// The use that ends before triangle `end`.
    pub(super) fn of(primitive: &Primitive, first_vertex: u32, end: u64) -> Self {
        let set = |(semantic, accessor): (&Checked<Semantic>, &Index<Accessor>)| match semantic {
            Checked::Valid(Semantic::TexCoords(set)) => Some((*set, *accessor)),
            _ => None,
        };
        Self {
            material: primitive.material.map_or(usize::MAX, |m| m.value()),
            uvs: primitive.attributes.iter().filter_map(set).collect(),
            first_vertex,
            end,
        }
    }
}

/// A base colour texture, ready to be put on faces.
struct Textured {
    /// In [`Appearance::materials`].
    number: u32,
    uv_set: u32,
    transform: Option<Mat3>,
}

/// Reads the appearance of `faces`, of which each use covers a run.
pub(super) fn read(
    document: &Document,
    path: &Path,
    uses: &[Use],
    faces: &Faces,
) -> Result<Appearance, ParseError> {
    let mut reader = Reader {
        document,
        path,
        appearance: Appearance::default(),
        images: BTreeMap::new(),
    };
    let root = &document.root;
    let materials: Vec<Option<Textured>> =
        root.materials.iter().map(|m| reader.material(m)).collect();
    let mut appearance = reader.appearance;
    if appearance.images.is_empty() {
        return Ok(appearance);
    }
    let mut known: BTreeMap<usize, Vec<Vec2>> = BTreeMap::new();
    let mut without = 0u64;
    for run in uses {
        let start = appearance.faces.len();
        let end = usize::try_from(run.end).unwrap_or(usize::MAX);
        let material = materials.get(run.material).and_then(Option::as_ref);
        let found = material.and_then(|m| Some((m, *run.uvs.get(&m.uv_set)?)));
        if let Some((material, accessor)) = found {
            let uvs = match known.entry(accessor.value()) {
                std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
                std::collections::btree_map::Entry::Vacant(entry) => {
                    entry.insert(coordinates(document, accessor)?)
                }
            };
            let place = |vertex: u32| {
                let index = vertex.checked_sub(run.first_vertex)?;
                let uv = *uvs.get(index as usize)?;
                Some(
                    material
                        .transform
                        .map_or(uv, |m| (m * uv.extend(1.0)).truncate()),
                )
            };
            let triangles = faces.triangles().get(start..end).unwrap_or_default();
            appearance
                .faces
                .extend(triangles.iter().map(|corners| TexturedFace {
                    material: material.number,
                    uv: corners.map(|vertex| place(vertex).unwrap_or_default()),
                }));
        } else {
            without += material.map_or(0, |_| run.end - start as u64);
            appearance.faces.resize(end, TexturedFace::PLAIN);
        }
    }
    if without > 0 {
        appearance.warnings.push(format!(
            "{without} triangles have a texture and no texture coordinates; they are drawn without it"
        ));
    }
    debug_assert_eq!(appearance.faces.len() as u64, faces.len());
    Ok(appearance)
}

fn coordinates(document: &Document, accessor: Index<Accessor>) -> Result<Vec<Vec2>, ParseError> {
    let uvs = document.elements(accessor)?;
    if uvs.width != 2 {
        return Err(super::fault(format!(
            "accessor {}: texture coordinates must have two parts",
            accessor.value()
        )));
    }
    #[expect(clippy::cast_possible_truncation, reason = "stored as f32 or less")]
    let pairs = uvs
        .values
        .chunks_exact(2)
        .map(|p| Vec2::new(p[0] as f32, p[1] as f32));
    Ok(pairs.collect())
}

struct Reader<'a> {
    document: &'a Document,
    path: &'a Path,
    appearance: Appearance,
    /// By image: its number, or none where it cannot be read.
    images: BTreeMap<usize, Option<u32>>,
}

impl Reader<'_> {
    fn material(&mut self, material: &material::Material) -> Option<Textured> {
        self.appearance.normal_maps += usize::from(material.normal_texture.is_some());
        let pbr = &material.pbr_metallic_roughness;
        let info = pbr.base_color_texture.as_ref()?;
        let texture = self.document.root.textures.get(info.index.value())?;
        let image = self.image(texture)?;
        let [r, g, b, _] = pbr.base_color_factor.0;
        let number = u32::try_from(self.appearance.materials.len())
            .ok()
            .filter(|&n| n != NO_MATERIAL)?;
        self.appearance.materials.push(Material {
            image: Some(image),
            factor: Vec3::new(r, g, b),
            wrap: self.wrap(texture),
        });
        let moved = info
            .extensions
            .as_ref()
            .and_then(|e| e.texture_transform.as_ref());
        let transform = moved.map(|t| {
            let (scale, offset) = (Vec2::from_array(t.scale.0), Vec2::from_array(t.offset.0));
            // The extension turns against the sense that matrices do.
            Mat3::from_scale_angle_translation(Vec2::ONE, -t.rotation.0, offset)
                * Mat3::from_scale(scale)
        });
        Some(Textured {
            number,
            uv_set: moved.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
            transform,
        })
    }

    fn wrap(&self, texture: &texture::Texture) -> [Wrap; 2] {
        let sampler = texture
            .sampler
            .and_then(|s| self.document.root.samplers.get(s.value()));
        let wrap = |mode: &Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        sampler.map_or([Wrap::Repeat; 2], |s| [wrap(&s.wrap_s), wrap(&s.wrap_t)])
    }

    fn image(&mut self, texture: &texture::Texture) -> Option<u32> {
        let extended = texture.extensions.as_ref().and_then(|extensions| {
            let source = extensions.others.get("EXT_texture_webp")?.get("source")?;
            usize::try_from(source.as_u64()?).ok()
        });
        let index = extended.unwrap_or(texture.source.value());
        if let Some(known) = self.images.get(&index) {
            return *known;
        }
        let number = match self.load(index) {
            Ok(file) => {
                self.appearance.images.push(file);
                u32::try_from(self.appearance.images.len() - 1).ok()
            }
            Err(cause) => {
                let warning = format!(
                    "image {index} cannot be read ({cause}); its materials are drawn without it"
                );
                self.appearance.warnings.push(warning);
                None
            }
        };
        self.images.insert(index, number);
        number
    }

    fn load(&self, index: usize) -> Result<ImageFile, String> {
        let root = &self.document.root;
        let image = root
            .images
            .get(index)
            .ok_or("there is none of that number")?;
        if let Some(uri) = &image.uri {
            let (bytes, from_file) = references::load(uri, self.path)?;
            let name = if from_file {
                uri.clone()
            } else {
                format!("image {index}")
            };
            return Ok(ImageFile { name, bytes });
        }
        let view = image
            .buffer_view
            .ok_or("it has neither a URI nor a buffer view")?;
        let bytes = (|| {
            let view = root.buffer_views.get(view.value())?;
            let buffer = self.document.buffers.get(view.buffer.value())?;
            let start = usize::try_from(view.byte_offset.map_or(0, |o| o.0)).ok()?;
            let length = usize::try_from(view.byte_length.0).ok()?;
            buffer.get(start..start.checked_add(length)?)
        })();
        Ok(ImageFile {
            name: format!("image {index}"),
            bytes: bytes.ok_or("it does not lie within its buffer")?.to_vec(),
        })
    }
}
