//! What there is to draw: the finest nodes of charts, and clusters.

use super::ThumbnailError;
use super::cut::cut;
use super::raster::{Canvas, Corner, SAMPLES, Texture};
use super::view::View;
use crate::texture::light::Light;
use glam::Vec3;
use marquetry_format::cluster::ClusterTexture;
use marquetry_format::writer::{ClusterInput, Content, NodeInput};
use marquetry_format::{ClusterMesh, LatticePoint, PageSamples, octahedral};

/// Error of a cluster that is drawn, pixels. Colours ask for more than the surface does: see [`coarseness`].
const ERROR: f64 = 0.25;
/// sRGB of surfaces without colours; the viewer's (`shared/light.wgsl`).
const GREY: [u8; 3] = [199, 199, 194];

/// A part of the surface.
#[derive(Debug, Clone, Copy)]
pub(super) enum Piece<'a> {
    Samples(&'a PageSamples),
    Cluster(&'a ClusterMesh),
}

/// All of it.
#[derive(Debug)]
pub(super) struct Pieces<'a> {
    /// Nodes of charts without children.
    leaves: Vec<&'a PageSamples>,
    clusters: &'a [ClusterInput],
}

impl<'a> Pieces<'a> {
    pub(super) fn of(content: &Content<'a>) -> Self {
        let mut leaves = Vec::new();
        let mut stack: Vec<&NodeInput> = content.charts.iter().map(|chart| &chart.root).collect();
        while let Some(node) = stack.pop() {
            match &node.children {
                Some(children) => stack.extend(children.iter()),
                None => leaves.push(&node.samples),
            }
        }
        Self {
            leaves,
            clusters: content.clusters,
        }
    }

    /// All points of the finest surface.
    pub(super) fn finest(&self) -> impl Iterator<Item = LatticePoint> {
        let samples = self.leaves.iter().flat_map(|samples| &samples.positions);
        let clusters = self.clusters.iter().filter(|node| node.children.is_empty());
        samples
            .chain(clusters.flat_map(|node| &node.mesh.positions))
            .copied()
    }

    /// What to draw in a picture of the size of `view`.
    pub(super) fn fit_for(&self, view: &View) -> impl Iterator<Item = Piece<'a>> {
        let clusters = cut(self.clusters, |node| coarseness(node, view.pixel()));
        let samples = self.leaves.iter().copied().map(Piece::Samples);
        samples.chain(clusters.into_iter().map(|node| Piece::Cluster(&node.mesh)))
    }
}

/// How much too coarse a cluster is where a pixel is so many lattice units: above 1 where it is.
fn coarseness(node: &ClusterInput, pixel: f64) -> f64 {
    let surface = f64::from(node.error) / (ERROR * pixel);
    match node.texel {
        Some(texel) => surface.max(f64::from(texel) / pixel),
        // No error tells how far colours of vertices are from the source's.
        None if !node.mesh.colours.is_empty() => f64::INFINITY,
        None => surface,
    }
}

impl Piece<'_> {
    pub(super) fn draw(
        self,
        view: &View,
        light: &Light,
        canvas: &mut Canvas,
    ) -> Result<(), ThumbnailError> {
        match self {
            Self::Samples(samples) => {
                draw_samples(samples, view, light, canvas);
                Ok(())
            }
            Self::Cluster(mesh) => draw_cluster(mesh, view, light, canvas),
        }
    }
}

fn draw_samples(samples: &PageSamples, view: &View, light: &Light, canvas: &mut Canvas) {
    let PageSamples {
        positions,
        normals,
        colours,
        ..
    } = samples;
    let corners = corners(view, light, positions, normals, colours, &[]);
    let side = samples.side();
    for j in 1..side {
        for i in 1..side {
            let [a, b] = [i - 1, i].map(|i| &corners[(j - 1) * side + i]);
            let [d, c] = [i - 1, i].map(|i| &corners[j * side + i]);
            canvas.triangle([a, b, c], None);
            canvas.triangle([a, c, d], None);
        }
    }
}

fn draw_cluster(
    mesh: &ClusterMesh,
    view: &View,
    light: &Light,
    canvas: &mut Canvas,
) -> Result<(), ThumbnailError> {
    let ClusterMesh {
        positions,
        normals,
        colours,
        triangles,
        texture,
        ..
    } = mesh;
    let places = texture.as_ref().map_or(&[][..], |texture| &texture.places);
    let corners = corners(view, light, positions, normals, colours, places);
    let texels = texture
        .as_ref()
        .filter(|_| colours.is_empty() || shows_images(&corners, triangles.len()))
        .map(ClusterTexture::decode)
        .transpose()?;
    let texture = texels.as_ref().map(|texels| Texture { texels, light });
    for triangle in triangles {
        canvas.triangle(
            triangle.map(|corner| &corners[usize::from(corner)]),
            texture.as_ref(),
        );
    }
    Ok(())
}

/// Whether triangles are so large that the colours of their corners do not tell what is between: above a pixel each, about. Decoding the image of every
/// small cluster would take most of the time.
fn shows_images(corners: &[Corner], triangles: usize) -> bool {
    let along = |coordinate: fn(&Corner) -> f64| {
        let (min, max) = (corners.iter().map(coordinate))
            .fold((f64::MAX, f64::MIN), |(min, max), c| {
                (min.min(c), max.max(c))
            });
        max - min
    };
    let samples = along(Corner::column) * along(Corner::row);
    samples > (triangles * SAMPLES * SAMPLES) as f64
}

/// The vertices of a piece; `colours` and `places` may be empty.
fn corners(
    view: &View,
    light: &Light,
    positions: &[LatticePoint],
    normals: &[[u8; 2]],
    colours: &[[u8; 3]],
    places: &[[u8; 2]],
) -> Vec<Corner> {
    let corner = |(at, (&position, &normal)): (usize, (&LatticePoint, &[u8; 2]))| {
        let albedo: Vec3 = light.linear(colours.get(at).copied().unwrap_or(GREY));
        let texel = places
            .get(at)
            .map_or([0.0; 2], |place| place.map(f32::from));
        let normal = view.direction(octahedral::decode(normal));
        Corner::new(view.place(position), normal, albedo, texel)
    };
    positions
        .iter()
        .zip(normals)
        .enumerate()
        .map(corner)
        .collect()
}
