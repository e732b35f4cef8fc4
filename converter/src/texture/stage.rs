//! What a conversion does about textures: what it takes from the import, and what it gives to the file and the report.

use super::appearance::Appearance;
use super::appearance::TexturedFace;
use super::build::{self, Input, TextureError};
use super::cluster::{self, Canvas};
use super::coarse;
use super::images::{ImageError, ImageStore};
use super::light::Light;
use super::seams;
use super::source::SourceMesh;
use super::sparse::{self, Sparse};
use crate::atlas::patch::Patch;
use crate::cluster::Need;
use crate::mesh::ImportedMesh;
use crate::parameterize::Parametrization;
use glam::DVec3;
use marquetry_format::writer::{ClusterInput, ColourInput};
use marquetry_format::{Glue, Lattice};
use rayon::prelude::*;

/// Share of the working memory that decoded images may take.
const IMAGE_SHARE: u64 = 4;

/// Textures between import and file.
#[derive(Debug, Default)]
pub struct Textures {
    appearance: Appearance,
    /// The imported triangles, where an image is on them.
    source: Option<SourceMesh>,
    sparse: Sparse,
    image_budget_bytes: u64,
    /// Images of the input, and their bytes.
    images: (usize, u64),
}

/// What is on which triangle.
#[derive(Debug, Clone, Copy)]
pub struct Painter<'a> {
    /// The imported triangles.
    pub source: &'a SourceMesh,
    /// What covers them.
    pub appearance: &'a Appearance,
    /// Those with next to no texels.
    pub sparse: &'a Sparse,
    /// Their images.
    pub images: &'a ImageStore<'a>,
}

/// What covers a triangle.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// Its texture.
    pub texture: TexturedFace,
    /// Whether that has next to no texels.
    pub is_sparse: bool,
}

impl Painter<'_> {
    /// What covers a triangle that is a piece of a source triangle, its corners `rounded` by so much.
    pub fn face(&self, corners: [DVec3; 3], rounded: f64) -> Face {
        let number = self.source.piece_of(corners, rounded);
        Face {
            texture: self.source.texture(number, corners, self.appearance),
            is_sparse: number.is_some_and(|number| self.sparse.contains_key(&number)),
        }
    }
}

/// Textures, in the report of a conversion.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct TextureReport {
    /// Images read.
    pub images: usize,
    /// Their bytes.
    pub image_bytes: u64,
    /// Colour tiles written.
    pub tiles: u32,
    /// Their bytes, index included.
    pub bytes: u64,
    /// Clusters with a texture.
    pub clusters: usize,
    /// Bytes of these textures.
    pub cluster_bytes: u64,
    /// Normal maps, which are left out.
    pub normal_maps: usize,
    /// What could not be used, in words.
    pub warnings: Vec<String>,
}

impl Textures {
    /// Takes the appearance out of `mesh` and gives its vertices the colours of the textures.
    ///
    /// # Errors
    /// When an image is damaged.
    pub fn take(mesh: &mut ImportedMesh, memory_bytes: u64) -> Result<Self, ImageError> {
        let appearance = std::mem::take(&mut mesh.appearance);
        let mut textures = Self {
            source: None,
            sparse: Sparse::new(),
            image_budget_bytes: memory_bytes / IMAGE_SHARE,
            images: (appearance.images.len(), appearance.image_bytes()),
            appearance,
        };
        for warning in &textures.appearance.warnings {
            tracing::warn!("{warning}");
        }
        if textures.appearance.has_colours() {
            let images = textures.images();
            let light = Light::new();
            let means = coarse::face_means(&textures.appearance, &images, &light)?;
            let colours = coarse::vertex_colours(mesh, &means, &light);
            if mesh.colours.is_empty() {
                let sizes = build::image_sizes(&textures.appearance)?;
                let surface = (&*mesh.positions, &*mesh.triangles);
                textures.sparse =
                    sparse::find(surface, &textures.appearance, &sizes, &means, &light);
            }
            seams::sharpen(mesh, &mut textures.appearance, &light);
            mesh.colours = colours;
        }
        if textures.appearance.is_textured() {
            // Without a triangle that has an area there is no surface, which is said later.
            textures.source = SourceMesh::new(mesh.positions.clone(), mesh.triangles.clone()).ok();
        }
        Ok(textures)
    }

    fn images(&self) -> ImageStore<'_> {
        ImageStore::new(&self.appearance.images, self.image_budget_bytes)
    }

    /// The tiles of the charts; `None` where nothing is textured.
    ///
    /// # Errors
    /// As [`build::build`].
    pub fn tiles(
        &self,
        patches: &[Patch],
        parametrizations: &[Parametrization],
        glue: &[[Option<Glue>; 4]],
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Option<ColourInput>, TextureError> {
        let Some(source) = &self.source else {
            return Ok(None);
        };
        let input = Input {
            patches,
            parametrizations,
            glue,
            source,
            appearance: &self.appearance,
            images: &self.images(),
        };
        let tiles = build::build(input, progress)?;
        Ok(tiles.iter().any(Option::is_some).then_some(tiles))
    }

    /// What each of some triangles needs of images; empty where nothing is textured.
    ///
    /// # Errors
    /// When the header of an image is damaged.
    pub fn needs_of(
        &self,
        positions: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> Result<Vec<Need>, ImageError> {
        let Some(source) = &self.source else {
            return Ok(Vec::new());
        };
        let sizes = build::image_sizes(&self.appearance)?;
        let texels = |face: TexturedFace| {
            let image = self.appearance.image_of(&face)?;
            let size = (*sizes.get(image as usize)?)?;
            Some(face.texels(size))
        };
        let need = |t: &[u32; 3]| {
            let corners = t.map(|v| positions[v as usize]);
            let number = source.piece_of(corners, 0.0);
            if let Some(colour) = number.and_then(|number| self.sparse.get(&number)) {
                return Need::Colour(*colour);
            }
            let face = source.texture(number, corners, &self.appearance);
            Need::Texels(texels(face).unwrap_or(0.0))
        };
        Ok(triangles.par_iter().map(need).collect())
    }

    /// Gives each of `nodes` its texture, and adds leaves below leaves for theirs; nothing where nothing is textured.
    ///
    /// # Errors
    /// When an image is damaged.
    pub fn paint(
        &self,
        nodes: &mut Vec<ClusterInput>,
        lattice: &Lattice,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(), TextureError> {
        let Some(source) = &self.source else {
            return Ok(());
        };
        let painter = Painter {
            source,
            appearance: &self.appearance,
            sparse: &self.sparse,
            images: &self.images(),
        };
        let canvas = Canvas {
            painter: &painter,
            lattice: *lattice,
            progress,
        };
        cluster::paint(nodes, &canvas)
    }

    /// Whether there are tiles to make.
    pub fn has_images(&self) -> bool {
        self.source.is_some()
    }

    /// What is reported, but for the tiles.
    pub fn report(self) -> TextureReport {
        TextureReport {
            images: self.images.0,
            image_bytes: self.images.1,
            normal_maps: self.appearance.normal_maps,
            warnings: self.appearance.warnings,
            ..TextureReport::default()
        }
    }
}
