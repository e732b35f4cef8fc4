//! Textures of clusters.
//!
//! Every node gets an image of its own, laid out for its own triangles ([`mod@unwrap`]), so a node's page is all that it takes to show
//! it. A leaf's texels come from the source's images, about as dense as there; those of a node above from the images of its
//! children, at the places nearest to its own surface: a pyramid whose levels are those of the clusters ([`mod@bake`] fills both).
//! Images are kept only until what is above them has its own.
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
use bake::{Spot, Steps, bake};
use glam::{DVec2, DVec3, Vec2, Vec3};
use marquetry_evaluation::distance::{Bvh, closest_point};
use marquetry_format::cluster::{ClusterTexture, MAX_TEXTURE_TEXELS};
use marquetry_format::writer::ClusterInput;
use marquetry_format::{ClusterMesh, Lattice};
use rayon::prelude::*;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use unwrap::{Unwrapped, unwrap};

/// Part of an image that patches cover at best: where a node's texels start from.
const FULL: f64 = 0.7;

/// Groups that are painted at a time: enough for all threads, few enough for their images to take little memory.
const GROUPS: usize = 32;

/// Samples of a texel along each side where plain colours may meet in it.
const BORDER_SAMPLES: u32 = 2;

/// Texels along a length of a node for each of the finest of its children, at most: a node has about the area of four.
const COARSER: f64 = 0.5;

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

/// A node with its image, for the nodes above.
struct Painted {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    colours: Vec<Vec3>,
    /// Places of the vertices from the upper left corner of the image, it, and texels a lattice unit.
    image: Option<(Vec<Vec2>, Texels, f64)>,
    /// What the node is to have in place of its mesh, and the length of its texels, lattice units.
    mesh: Option<(ClusterMesh, f32)>,
}

impl Painted {
    fn area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    }
}

/// Gives each of `nodes`, of which the first is the root, the texture that its source has. The same for any number of threads.
///
/// # Errors
/// When an image is damaged.
pub fn paint(nodes: &mut [ClusterInput], canvas: &Canvas<'_>) -> Result<(), TextureError> {
    let light = Light::new();
    let mut members: HashMap<u32, Vec<usize>> = HashMap::new();
    for (number, node) in nodes.iter().enumerate() {
        if let Some(&first) = node.children.first() {
            members.entry(first).or_default().push(number);
        }
    }
    let order = children_first(nodes);
    let mut painting = Painting {
        brush: Brush {
            canvas,
            light: &light,
        },
        painted: nodes.iter().map(|_| None).collect(),
        nodes,
        members,
        done: 0,
    };
    if order.is_empty() {
        return painting.leaves(&[0]);
    }
    order
        .chunks(GROUPS)
        .try_for_each(|groups| painting.groups(groups))
}

/// The first children of all groups, depth first, those below before those above.
fn children_first(nodes: &[ClusterInput]) -> Vec<u32> {
    let first = |k: u32| nodes.get(k as usize)?.children.first().copied();
    let mut order = Vec::new();
    let mut is_known = HashSet::new();
    // Groups, and how many of their children have been looked at.
    let mut stack: Vec<(u32, Vec<u32>)> = Vec::new();
    let mut next = Some(0);
    loop {
        if let Some(node) = next.take()
            && let Some(group) = first(node)
            && is_known.insert(group)
        {
            let mut left = nodes[node as usize].children.clone();
            left.reverse();
            stack.push((group, left));
        }
        let Some((group, left)) = stack.last_mut() else {
            return order;
        };
        next = left.pop();
        if next.is_none() {
            order.push(*group);
            stack.pop();
        }
    }
}

/// Nodes, some of which have their images.
struct Painting<'a> {
    brush: Brush<'a>,
    nodes: &'a mut [ClusterInput],
    /// Nodes that have the same children, by the first of these.
    members: HashMap<u32, Vec<usize>>,
    /// Images that are needed above.
    painted: Vec<Option<Painted>>,
    done: usize,
}

impl Painting<'_> {
    /// Paints groups, and the leaves among their children; the groups among these come before them.
    fn groups(&mut self, groups: &[u32]) -> Result<(), TextureError> {
        let mut left: Vec<(Vec<usize>, Vec<u32>)> = groups
            .iter()
            .filter_map(|first| {
                let members = self.members.remove(first)?;
                let children = self.nodes.get(*members.first()?)?.children.clone();
                Some((members, children))
            })
            .collect();
        let children = left.iter().flat_map(|(_, children)| children);
        let leaves = children.map(|&child| child as usize);
        let leaves: Vec<usize> = leaves
            .filter(|&child| self.nodes[child].children.is_empty())
            .collect();
        self.leaves(&leaves)?;
        while !left.is_empty() {
            let is_ready = |children: &[u32]| {
                children
                    .iter()
                    .all(|&child| self.painted[child as usize].is_some())
            };
            let (ready, others): (Vec<_>, Vec<_>) = left
                .into_iter()
                .partition(|(_, children)| is_ready(children));
            left = others;
            if ready.is_empty() {
                // Not in the order that was asked for.
                return Ok(());
            }
            let below: Vec<Vec<Painted>> = ready
                .iter()
                .map(|(_, children)| {
                    let children = children.iter();
                    children
                        .filter_map(|&child| self.painted[child as usize].take())
                        .collect()
                })
                .collect();
            let (brush, nodes) = (&self.brush, &*self.nodes);
            let painted = ready
                .par_iter()
                .zip(&below)
                .map(|((members, _), below)| {
                    let below = Below::new(below);
                    let inner = |&member: &usize| brush.inner(&nodes[member], below.as_ref());
                    members.par_iter().map(inner).collect()
                })
                .collect::<Result<Vec<Vec<_>>, _>>()?;
            for ((members, children), painted) in ready.iter().zip(painted) {
                self.keep(members, painted);
                self.agree(members, children);
            }
        }
        Ok(())
    }

    /// Gives members with textures the length of texels of the coarsest of them, no less than of their children: they are
    /// replaced together, and after these.
    fn agree(&mut self, members: &[usize], children: &[u32]) {
        let children = children.iter().map(|&child| child as usize);
        let texels = members.iter().copied().chain(children);
        let longest = texels
            .filter_map(|k| self.nodes[k].texel)
            .fold(0.0, f32::max);
        for &member in members {
            if let Some(texel) = &mut self.nodes[member].texel {
                *texel = longest;
            }
        }
    }

    fn leaves(&mut self, leaves: &[usize]) -> Result<(), TextureError> {
        let (brush, nodes) = (&self.brush, &*self.nodes);
        let painted = leaves
            .par_iter()
            .map(|&leaf| brush.leaf(&nodes[leaf]))
            .collect::<Result<Vec<_>, _>>()?;
        self.keep(leaves, painted);
        Ok(())
    }

    fn keep(&mut self, numbers: &[usize], painted: Vec<Painted>) {
        for (&number, mut painted) in numbers.iter().zip(painted) {
            let node = &mut self.nodes[number];
            if let Some((mesh, texel)) = painted.mesh.take() {
                (node.mesh, node.texel) = (mesh, Some(texel));
            }
            self.painted[number] = Some(painted);
        }
        self.done += numbers.len();
        (self.brush.canvas.progress)(self.done as f64 / self.nodes.len() as f64);
    }
}

struct Brush<'a> {
    canvas: &'a Canvas<'a>,
    light: &'a Light,
}

impl Brush<'_> {
    fn leaf(&self, node: &ClusterInput) -> Result<Painted, TextureError> {
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
            let is_plain = paints.iter().any(Paint::is_plain);
            let image = bake(
                &mesh,
                self.light,
                if is_plain { BORDER_SAMPLES } else { 1 },
                |Spot { triangle, weights }: Spot, [step_i, step_j]: Steps| {
                    paints[triangle as usize].mean(weights, step_i, step_j, self.light)
                },
            );
            finish(&node.mesh, &mut painted, mesh, image)?;
        }
        Ok(painted)
    }

    fn inner(
        &self,
        node: &ClusterInput,
        below: Option<&Below<'_>>,
    ) -> Result<Painted, TextureError> {
        let mut painted = self.plain(&node.mesh);
        let Some(source) = below else {
            return Ok(painted);
        };
        let finest = source.finest();
        if finest <= 0.0 {
            return Ok(painted);
        }
        let area: f64 = painted.triangles.iter().map(|t| painted.area(t)).sum();
        let texels = FULL * f64::from(MAX_TEXTURE_TEXELS).powi(2);
        let scale = (texels / area.max(f64::MIN_POSITIVE))
            .sqrt()
            .min(COARSER * finest);
        if let Some(mesh) = unwrap(&painted.positions, &painted.triangles, scale) {
            let last = Cell::new(None);
            let image = bake(
                &mesh,
                self.light,
                1,
                |Spot { triangle, weights }: Spot, _: Steps| {
                    let [a, b, c] =
                        painted.triangles[triangle as usize].map(|v| painted.positions[v as usize]);
                    let weights = weights.as_dvec2();
                    source.colour(
                        a + (b - a) * weights.x + (c - a) * weights.y,
                        mesh.scale,
                        self.light,
                        &last,
                    )
                },
            );
            finish(&node.mesh, &mut painted, mesh, image)?;
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
            mesh: None,
        }
    }
}

/// Gives what was `painted` its image, and `old` the vertices that it takes.
fn finish(
    old: &ClusterMesh,
    painted: &mut Painted,
    laid_out: Unwrapped,
    image: Texels,
) -> Result<(), TextureError> {
    let texture = ClusterTexture {
        places: laid_out.vertices.iter().map(|&(_, place)| place).collect(),
        frame: encode::frame(image.rgb.as_flattened(), image.width, image.height)?,
    };
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
        ranks: numbers()
            .filter_map(|v| old.ranks.get(v).copied())
            .collect(),
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
    painted.mesh = Some((mesh, texel));
    Ok(())
}

/// The children of a node as one surface with colours.
struct Below<'a> {
    tree: Bvh,
    /// Child and triangle of every triangle of the tree.
    of: Vec<(usize, usize)>,
    children: &'a [Painted],
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
        (!tree.is_empty()).then_some(Self { tree, of, children })
    }

    /// Most texels a lattice unit of an image; 0 where there is none.
    fn finest(&self) -> f64 {
        let images = self
            .children
            .iter()
            .filter_map(|child| child.image.as_ref());
        images.map(|(_, _, scale)| *scale).fold(0.0, f64::max)
    }

    /// Corners of a triangle of the tree, and the child that it is of.
    fn triangle(&self, number: u32) -> Option<(&'a Painted, [u32; 3])> {
        let &(child, triangle) = self.of.get(number as usize)?;
        let child = self.children.get(child)?;
        Some((child, *child.triangles.get(triangle)?))
    }

    /// The triangle nearest to `point`, and the nearest point of it. `found_last` is what was: texels side by side mostly have the
    /// same triangle.
    fn nearest(&self, point: DVec3, found_last: &Cell<Option<u32>>) -> Option<(u32, DVec3)> {
        let last = found_last.get().and_then(|number| {
            let (child, corners) = self.triangle(number)?;
            let corners = corners.map(|v| child.positions[v as usize]);
            Some((number, closest_point(corners, point)))
        });
        let within = last.map_or(f64::INFINITY, |(_, found)| found.distance_squared(point));
        let found = self.tree.closest(point, within);
        let nearest = found.map(|found| (found.triangle, found.point)).or(last);
        found_last.set(nearest.map(|(number, _)| number));
        nearest
    }

    /// The colour nearest to `point`, as a texel of which there are `scale` a unit of length shows it.
    fn colour(
        &self,
        point: DVec3,
        scale: f64,
        light: &Light,
        found_last: &Cell<Option<u32>>,
    ) -> Vec3 {
        let nearest = self.nearest(point, found_last);
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
