//! Textures of clusters.
//!
//! Every node gets an image of its own, laid out for its own triangles ([`mod@unwrap`]), so a node's page is all that it takes to show
//! it. A leaf's texels come from the source's images, about as dense as there; those of a node above from the images of its
//! children, at the places nearest to its own surface: a pyramid whose levels are those of the clusters ([`mod@bake`] fills both).
//! Parts that no image covers keep the colours of their vertices.

pub mod bake;
pub mod unwrap;

use super::appearance::Wrap;
use super::build::TextureError;
use super::encode;
use super::images::Texels;
use super::light::Light;
use super::raster::Paint;
use super::source::weights;
use super::stage::Painter;
use crate::cluster::ClusterInput;
use bake::{Spot, Steps, bake};
use glam::{DVec2, DVec3, Vec2, Vec3};
use marquetry_evaluation::distance::{Bvh, closest_point};
use marquetry_format::cluster::{ClusterTexture, MAX_TEXTURE_TEXELS};
use marquetry_format::{ClusterMesh, Lattice};
use rayon::prelude::*;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use unwrap::{Unwrapped, unwrap};

/// Part of an image that patches cover at best: where a node's texels start from.
const FULL: f64 = 0.7;

/// What the textures of a tree are made with.
#[expect(missing_debug_implementations, reason = "it holds a function")]
pub struct Canvas<'a> {
    /// Finds and reads the source's images.
    pub painter: &'a Painter<'a>,
    /// Where the tree lies.
    pub lattice: Lattice,
    /// Called with the part that is done.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

/// A node with its image, for the node above.
struct Painted {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    colours: Vec<Vec3>,
    /// Places of the vertices from the upper left corner of the image, it, and texels a lattice unit.
    image: Option<(Vec<Vec2>, Texels, f64)>,
}

impl Painted {
    fn area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    }
}

/// Gives every node of the tree the texture that its source has. The same for any number of threads.
///
/// # Errors
/// When an image is damaged.
pub fn paint(root: &mut ClusterInput, canvas: &Canvas<'_>) -> Result<(), TextureError> {
    let count = count(root);
    let done = AtomicUsize::new(0);
    let light = Light::new();
    let brush = Brush {
        canvas,
        light: &light,
        tick: &|| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            (canvas.progress)(done as f64 / count as f64);
        },
    };
    brush.node(root).map(|_| ())
}

fn count(node: &ClusterInput) -> usize {
    1 + node.children.iter().map(count).sum::<usize>()
}

struct Brush<'a> {
    canvas: &'a Canvas<'a>,
    light: &'a Light,
    tick: &'a (dyn Fn() + Sync),
}

impl Brush<'_> {
    fn node(&self, node: &mut ClusterInput) -> Result<Painted, TextureError> {
        let below: Vec<Painted> = node
            .children
            .par_iter_mut()
            .map(|child| self.node(child))
            .collect::<Result<_, TextureError>>()?;
        let painted = if below.is_empty() {
            self.leaf(node)?
        } else {
            self.inner(node, &below)?
        };
        (self.tick)();
        Ok(painted)
    }

    fn leaf(&self, node: &mut ClusterInput) -> Result<Painted, TextureError> {
        let mut painted = self.plain(&node.mesh);
        let lattice = &self.canvas.lattice;
        let faces = node.mesh.triangles.iter().map(|t| {
            let corners =
                t.map(|v| lattice.world_from_lattice(node.mesh.positions[usize::from(v)]));
            self.canvas.painter.face(corners)
        });
        let faces: Vec<_> = faces.collect();
        let mut images: BTreeMap<u32, Arc<Texels>> = BTreeMap::new();
        for image in faces
            .iter()
            .filter_map(|face| self.canvas.painter.appearance.image_of(face))
        {
            if let std::collections::btree_map::Entry::Vacant(slot) = images.entry(image) {
                slot.insert(self.canvas.painter.images.get(image)?);
            }
        }
        let paints: Vec<Paint<'_>> = faces
            .iter()
            .zip(&painted.triangles)
            .map(|(face, t)| {
                let colours = t.map(|v| painted.colours[v as usize]);
                let materials = &self.canvas.painter.appearance.materials;
                Paint::new(colours, face, materials, &images)
            })
            .collect();
        let (mut texels, mut area) = (0.0, 0.0);
        for (paint, t) in paints.iter().zip(&painted.triangles) {
            if let Some(own) = paint.texels() {
                texels += f64::from(own);
                area += painted.area(t);
            }
        }
        if texels <= 0.0 || area <= 0.0 {
            return Ok(painted);
        }
        let scale = (texels / area).sqrt();
        if let Some(mesh) = unwrap(&painted.positions, &painted.triangles, scale) {
            let image = bake(
                &mesh,
                self.light,
                |Spot { triangle, weights }: Spot, [step_i, step_j]: Steps| {
                    paints[triangle as usize].mean(weights, step_i, step_j, self.light)
                },
            );
            finish(node, &mut painted, mesh, image)?;
        }
        Ok(painted)
    }

    fn inner(&self, node: &mut ClusterInput, below: &[Painted]) -> Result<Painted, TextureError> {
        let mut painted = self.plain(&node.mesh);
        let finest = below.iter().filter_map(|child| child.image.as_ref());
        let finest = finest.map(|(_, _, scale)| *scale).fold(0.0, f64::max);
        let source = Below::new(below);
        let Some(source) = source.filter(|_| finest > 0.0) else {
            return Ok(painted);
        };
        let area: f64 = painted.triangles.iter().map(|t| painted.area(t)).sum();
        let texels = FULL * f64::from(MAX_TEXTURE_TEXELS).powi(2);
        let scale = (texels / area.max(f64::MIN_POSITIVE)).sqrt().min(finest);
        if let Some(mesh) = unwrap(&painted.positions, &painted.triangles, scale) {
            let image = bake(
                &mesh,
                self.light,
                |Spot { triangle, weights }: Spot, _: Steps| {
                    let [a, b, c] =
                        painted.triangles[triangle as usize].map(|v| painted.positions[v as usize]);
                    let weights = weights.as_dvec2();
                    source.colour(
                        a + (b - a) * weights.x + (c - a) * weights.y,
                        mesh.scale,
                        self.light,
                    )
                },
            );
            finish(node, &mut painted, mesh, image)?;
        }
        Ok(painted)
    }

    fn plain(&self, mesh: &ClusterMesh) -> Painted {
        let colour = |k: usize| {
            let colour = mesh.colours.get(k).copied();
            self.light.linear(colour.unwrap_or([255; 3]))
        };
        Painted {
            positions: mesh
                .positions
                .iter()
                .map(|p| DVec3::from_array(p.map(f64::from)))
                .collect(),
            triangles: mesh.triangles.iter().map(|t| t.map(u32::from)).collect(),
            colours: (0..mesh.positions.len()).map(colour).collect(),
            image: None,
        }
    }
}

/// Gives `node` its image, and the vertices that it takes.
fn finish(
    node: &mut ClusterInput,
    painted: &mut Painted,
    laid_out: Unwrapped,
    image: Texels,
) -> Result<(), TextureError> {
    let texture = ClusterTexture {
        places: laid_out.vertices.iter().map(|&(_, place)| place).collect(),
        frame: encode::frame(image.rgb.as_flattened(), image.width, image.height)?,
    };
    let old = &node.mesh;
    let of = |v: u32| v as usize;
    let index = |v: u32| u8::try_from(v).unwrap_or(u8::MAX);
    let numbers = || laid_out.vertices.iter().map(|&(v, _)| of(v));
    let mesh = ClusterMesh {
        positions: numbers().map(|v| old.positions[v]).collect(),
        normals: numbers().map(|v| old.normals[v]).collect(),
        colours: numbers()
            .filter_map(|v| old.colours.get(v).copied())
            .collect(),
        triangles: laid_out.triangles.iter().map(|t| t.map(index)).collect(),
        texture: Some(texture),
    };
    painted.positions = numbers().map(|v| painted.positions[v]).collect();
    painted.colours = numbers().map(|v| painted.colours[v]).collect();
    painted.triangles = laid_out.triangles;
    let places = laid_out
        .vertices
        .iter()
        .map(|(_, [i, j])| Vec2::new(f32::from(*i), f32::from(*j)) + 0.5);
    painted.image = Some((places.collect(), image, laid_out.scale));
    #[expect(clippy::cast_possible_truncation, reason = "a length on the lattice")]
    let texel = (1.0 / laid_out.scale) as f32;
    (node.mesh, node.texel) = (mesh, Some(texel));
    Ok(())
}

/// The children of a node as one surface with colours.
struct Below<'a> {
    tree: Bvh,
    /// Child and triangle of every triangle of the tree.
    of: Vec<(usize, usize)>,
    children: &'a [Painted],
    /// What was found last: texels side by side mostly have the same triangle.
    last: Cell<Option<u32>>,
}

impl<'a> Below<'a> {
    fn new(children: &'a [Painted]) -> Option<Self> {
        let (mut positions, mut triangles, mut of) = (Vec::new(), Vec::new(), Vec::new());
        for (number, child) in children.iter().enumerate() {
            let first = u32::try_from(positions.len()).ok()?;
            positions.extend_from_slice(&child.positions);
            triangles.extend(child.triangles.iter().map(|t| t.map(|v| first + v)));
            of.extend((0..child.triangles.len()).map(|t| (number, t)));
        }
        let tree = Bvh::new(&positions, &triangles).ok()?;
        (!tree.is_empty()).then_some(Self {
            tree,
            of,
            children,
            last: Cell::new(None),
        })
    }

    /// Corners of a triangle of the tree, and the child that it is of.
    fn triangle(&self, number: u32) -> Option<(&'a Painted, [u32; 3])> {
        let &(child, triangle) = self.of.get(number as usize)?;
        let child = self.children.get(child)?;
        Some((child, *child.triangles.get(triangle)?))
    }

    /// The triangle nearest to `point`, and the nearest point of it.
    fn nearest(&self, point: DVec3) -> Option<(u32, DVec3)> {
        let last = self.last.get().and_then(|number| {
            let (child, corners) = self.triangle(number)?;
            let corners = corners.map(|v| child.positions[v as usize]);
            Some((number, closest_point(corners, point)))
        });
        let within = last.map_or(f64::INFINITY, |(_, found)| found.distance_squared(point));
        let found = self.tree.closest(point, within);
        let nearest = found.map(|found| (found.triangle, found.point)).or(last);
        self.last.set(nearest.map(|(number, _)| number));
        nearest
    }

    /// The colour nearest to `point`, as a texel of which there are `scale` a unit of length shows it.
    fn colour(&self, point: DVec3, scale: f64, light: &Light) -> Vec3 {
        let nearest = self.nearest(point);
        let found = nearest.and_then(|(number, found)| Some((self.triangle(number)?, found)));
        let Some(((child, corners), found)) = found else {
            return Vec3::ZERO;
        };
        let weights = weights_within(corners.map(|v| child.positions[v as usize]), found);
        let Some((places, image, own_scale)) = &child.image else {
            let [a, b, c] = corners.map(|v| child.colours[v as usize]);
            return a + (b - a) * weights.x + (c - a) * weights.y;
        };
        let [a, b, c] = corners.map(|v| places[v as usize]);
        let place = a + (b - a) * weights.x + (c - a) * weights.y;
        #[expect(clippy::cast_possible_truncation, reason = "a ratio")]
        let half = (0.25 * own_scale / scale) as f32;
        let around = [[-half, -half], [half, -half], [-half, half], [half, half]];
        around
            .into_iter()
            .map(|offset| image.sample(light, place + Vec2::from_array(offset), [Wrap::Clamp; 2]))
            .sum::<Vec3>()
            / 4.0
    }
}

/// Weights of the second and third corner at a point of a triangle; of a flat one some that are near.
fn weights_within(corners: [DVec3; 3], point: DVec3) -> Vec2 {
    let weights = weights(corners, point);
    if weights.is_finite() {
        let weights = weights.max(DVec2::ZERO);
        return (weights / weights.element_sum().max(1.0)).as_vec2();
    }
    let [a, b, _] = corners;
    let along = (point - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE);
    DVec2::new(along.clamp(0.0, 1.0), 0.0).as_vec2()
}
