//! What an importer says about colour beyond vertices.

use glam::{Vec2, Vec3};

/// No material.
pub const NO_MATERIAL: u32 = u32::MAX;

/// What happens to texture coordinates outside 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every second time mirrored.
    Mirror,
    /// The outermost texel.
    Clamp,
}

/// An image as stored.
#[derive(Debug, Clone, Default)]
pub struct ImageFile {
    /// File, or place in the file, for messages.
    pub name: String,
    /// PNG, JPEG or `WebP`.
    pub bytes: Vec<u8>,
}

/// A material's base colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Image that `factor` is multiplied by; a number in [`Appearance::images`].
    pub image: Option<u32>,
    /// Linear light.
    pub factor: Vec3,
    /// Along u and v.
    pub wrap: [Wrap; 2],
}

impl Default for Material {
    fn default() -> Self {
        Self {
            image: None,
            factor: Vec3::ONE,
            wrap: [Wrap::Repeat; 2],
        }
    }
}

/// Material and texture coordinates of a triangle. (0, 0) is the image's upper left corner, (1, 1) its lower right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexturedFace {
    /// A number in [`Appearance::materials`], or [`NO_MATERIAL`].
    pub material: u32,
    /// By corner.
    pub uv: [Vec2; 3],
}

impl TexturedFace {
    /// A face that no image covers.
    pub const PLAIN: Self = Self {
        material: NO_MATERIAL,
        uv: [Vec2::ZERO; 3],
    };

    /// Texels that it covers of an image of `size`.
    pub fn texels(&self, size: Vec2) -> f32 {
        let [a, b, c] = self.uv.map(|uv| uv * size);
        0.5 * (b - a).perp_dot(c - a).abs()
    }
}

/// Images, materials, and how they cover the imported triangles.
#[derive(Debug, Clone, Default)]
pub struct Appearance {
    /// Images that materials use and that could be read.
    pub images: Vec<ImageFile>,
    /// Materials.
    pub materials: Vec<Material>,
    /// One a triangle, in the order of the import; empty where nothing is textured.
    pub faces: Vec<TexturedFace>,
    /// What could not be used, in words.
    pub warnings: Vec<String>,
    /// Normal maps that were left out.
    pub normal_maps: usize,
}

impl Appearance {
    /// Whether any triangle shows an image.
    pub fn is_textured(&self) -> bool {
        !self.images.is_empty() && self.faces.iter().any(|face| self.image_of(face).is_some())
    }

    /// Whether any triangle has a colour of its own: an image, or a material's.
    pub fn has_colours(&self) -> bool {
        let coloured = |m: &Material| m.image.is_some() || m.factor != Vec3::ONE;
        self.faces
            .iter()
            .filter_map(|face| self.materials.get(face.material as usize))
            .any(coloured)
    }

    /// The image on a face.
    pub fn image_of(&self, face: &TexturedFace) -> Option<u32> {
        self.materials.get(face.material as usize)?.image
    }

    /// Bytes of the images.
    pub fn image_bytes(&self) -> u64 {
        self.images
            .iter()
            .map(|image| image.bytes.len() as u64)
            .sum()
    }
}
