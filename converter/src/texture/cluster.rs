//! Textures of clusters.
//!
//! Every node gets an image of its own, laid out for its own triangles ([`mod@unwrap`]), so a node's page is all that it takes to show
//! it. A leaf's texels come from the source's images, about as dense as there; those of a node above from the images of its
//! children, at the places nearest to its own surface: a pyramid whose levels are those of the clusters ([`mod@bake`] fills both).
//! Leaves with texels far shorter than a pixel may come twice (`twice`).
//! Images are kept only until what is above them has its own.
//! Parts that no image covers, or one with next to no texels, keep the colours of their vertices.

pub mod bake;
mod below;
mod twice;
pub mod unwrap;

use super::appearance::TexturedFace;
use super::build::TextureError;
use super::encode;
use super::images::Texels;
use super::light::Light;
use super::raster::Paint;
use super::stage::{Face, Painter};
use bake::{Spot, Steps, bake};
use below::Below;
use glam::{DVec3, Vec2, Vec3};
use marquetry_format::cluster::{ClusterTexture, MAX_TEXTURE_TEXELS};
use marquetry_format::writer::ClusterInput;
use marquetry_format::{ClusterMesh, Lattice};
use rayon::prelude::*;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use twice::Twice;
use unwrap::{Unwrapped, unwrap};

/// Part of an image that patches cover at best: where a node's texels start from.
const FULL: f64 = 0.7;

/// Groups that are painted at a time: enough for all threads, few enough for their images to take little memory.
const GROUPS: usize = 32;

/// Samples of a texel along each side where plain colours may meet in it.
const BORDER_SAMPLES: u32 = 2;

/// Texels of a node for each triangle of one colour below it.
const SPARSE_TEXELS: f64 = 32.0;

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
    /// Texels a lattice unit that show what has no image, or 0.
    scale: f64,
    /// What the node is to have in place of its mesh, and the length of its texels, lattice units.
    mesh: Option<(ClusterMesh, f32)>,
}

impl Painted {
    fn area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    }
}

/// Gives each of `nodes`, of which the first is the root, the texture that its source has, and adds leaves with all texels below those with
/// large ones. The same for any number of threads.
///
/// # Errors
/// When an image is damaged.
pub fn paint(nodes: &mut Vec<ClusterInput>, canvas: &Canvas<'_>) -> Result<(), TextureError> {
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
        twice: Vec::new(),
        done: 0,
    };
    if order.is_empty() {
        return painting.leaves(vec![(0.0, vec![0])]);
    }
    for groups in order.chunks(GROUPS) {
        painting.groups(groups)?;
    }
    let all_twice = painting.twice;
    for twice in all_twice {
        twice.add_to(nodes);
    }
    Ok(())
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
    nodes: &'a mut Vec<ClusterInput>,
    /// Nodes that have the same children, by the first of these.
    members: HashMap<u32, Vec<usize>>,
    twice: Vec<Twice>,
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
        let leaves = left.iter().map(|(members, children)| {
            let error = members.first().map_or(0.0, |&k| self.nodes[k].error);
            let children = children.iter().map(|&child| child as usize);
            let leaves = children.filter(|&child| self.nodes[child].children.is_empty());
            (f64::from(error), leaves.collect())
        });
        let leaves = leaves.collect();
        self.leaves(leaves)?;
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
                    let inner =
                        |&member: &usize| brush.inner(&nodes[member], below.as_ref(), COARSER);
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

    /// Paints leaves, listed by the groups that they are children of, with the errors of these.
    fn leaves(&mut self, groups: Vec<(f64, Vec<usize>)>) -> Result<(), TextureError> {
        let (brush, nodes) = (&self.brush, &**self.nodes);
        let painted = groups
            .into_par_iter()
            .map(|(error, leaves)| {
                let painted = leaves
                    .par_iter()
                    .map(|&leaf| brush.leaf(&nodes[leaf]))
                    .collect::<Result<Vec<_>, _>>()?;
                brush.twice(nodes, error, leaves, painted)
            })
            .collect::<Result<Vec<_>, TextureError>>()?;
        for (leaves, painted, twice) in painted {
            self.keep(&leaves, painted);
            self.twice.extend(twice);
        }
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
        let rounded = lattice.step * f64::from(1u32 << lattice.shift);
        let faces = node.mesh.triangles.iter().map(|t| {
            let corners =
                t.map(|v| lattice.world_from_lattice(node.mesh.positions[usize::from(v)]));
            self.canvas.painter.face(corners, rounded)
        });
        let faces: Vec<Face> = faces.collect();
        // A leaf has none of them or nothing else, but where sheets lie on each other some may be taken for others.
        let sparse = faces.iter().filter(|face| face.is_sparse).count();
        if 2 * sparse > faces.len() {
            let area: f64 = painted.triangles.iter().map(|t| painted.area(t)).sum();
            let texels = SPARSE_TEXELS * painted.triangles.len() as f64;
            painted.scale = (texels / area.max(f64::MIN_POSITIVE)).sqrt();
            return Ok(painted);
        }
        let faces: Vec<TexturedFace> = faces.iter().map(|face| face.texture).collect();
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
        coarser: f64,
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
            .min(coarser * finest);
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
            scale: 0.0,
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
