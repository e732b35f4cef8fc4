//! The node tree, and the triangles that hang in it.

use super::material::{self, Use};
use super::{Document, Soup, fault};
use crate::error::{Fault, ParseError, Place};
use crate::import::colour::LinearToSrgb;
use crate::import::vertex_id;
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Node};
use glam::{DMat4, DQuat, DVec3};
use std::path::Path;

pub(super) fn read(document: &Document, path: &Path) -> Result<Soup, ParseError> {
    let mut reader = Reader {
        document,
        soup: Soup::default(),
        coloured: false,
        srgb: LinearToSrgb::new(),
        uses: Vec::new(),
        // Instances multiply the geometry; 64 times its bytes, or 64 Mi elements, is more than any real scene.
        budget: (document.total_bytes.saturating_mul(64)).max(1 << 26),
    };
    for (node, world_from_node) in reader.document.nodes()? {
        if let Some(mesh) = node.mesh {
            let i = mesh.value();
            let mesh = document
                .root
                .meshes
                .get(i)
                .ok_or_else(|| fault(format!("there is no mesh {i}")))?;
            reader.read_mesh(&mesh.primitives, world_from_node)?;
        }
    }
    let Reader {
        mut soup,
        coloured,
        uses,
        ..
    } = reader;
    if !coloured {
        soup.colours = Vec::new();
    }
    soup.appearance = material::read(document, path, &uses, &soup.faces)?;
    Ok(soup)
}

impl Document {
    /// The nodes of the scene in depth-first order, each with its world matrix.
    fn nodes(&self) -> Result<Vec<(&Node, DMat4)>, ParseError> {
        let root = &self.root;
        let roots: Vec<Index<Node>> = match root.scenes.get(root.scene.map_or(0, |s| s.value())) {
            Some(scene) => scene.nodes.clone(),
            None => self.roots(),
        };
        let mut seen = vec![false; root.nodes.len()];
        let mut out = Vec::new();
        let mut stack: Vec<(Index<Node>, DMat4)> = roots
            .into_iter()
            .rev()
            .map(|n| (n, DMat4::IDENTITY))
            .collect();
        while let Some((index, world_from_parent)) = stack.pop() {
            let i = index.value();
            let node = root
                .nodes
                .get(i)
                .ok_or_else(|| fault(format!("there is no node {i}")))?;
            if std::mem::replace(&mut seen[i], true) {
                return Err(fault(format!("node {i} has two parents")));
            }
            let world_from_node = world_from_parent * local(node);
            out.push((node, world_from_node));
            stack.extend(
                node.children
                    .iter()
                    .flatten()
                    .rev()
                    .map(|&c| (c, world_from_node)),
            );
        }
        Ok(out)
    }

    /// Nodes that are nobody's child, for files without scenes.
    fn roots(&self) -> Vec<Index<Node>> {
        let mut child = vec![false; self.root.nodes.len()];
        for c in self
            .root
            .nodes
            .iter()
            .flat_map(|n| n.children.iter().flatten())
        {
            if let Some(slot) = child.get_mut(c.value()) {
                *slot = true;
            }
        }
        let is_root = |i: &u32| child.get(*i as usize) == Some(&false);
        (0..u32::try_from(child.len()).unwrap_or(u32::MAX))
            .filter(is_root)
            .map(Index::new)
            .collect()
    }
}

fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let scale = node.scale.map_or(DVec3::ONE, vector);
    let translation = node.translation.map_or(DVec3::ZERO, vector);
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| {
        let q = DQuat::from_array(q.0.map(f64::from));
        let length = q.length();
        if length > 0.0 {
            q / length
        } else {
            DQuat::IDENTITY
        }
    });
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

struct Reader<'a> {
    document: &'a Document,
    soup: Soup,
    coloured: bool,
    srgb: LinearToSrgb,
    /// Materials of the triangles so far.
    uses: Vec<Use>,
    /// Vertices and corners that may still be added.
    budget: u64,
}

/// Vertex arrays of a node that are looked through for reuse; more would make many primitives slow.
const RECENT: usize = 16;

/// What decides a primitive's vertices: positions, colours, colour factor (as bits).
type VertexKey = (usize, Option<usize>, [u32; 3]);

impl Reader<'_> {
    fn read_mesh(
        &mut self,
        primitives: &[Primitive],
        world_from_node: DMat4,
    ) -> Result<(), ParseError> {
        // Exporters let many primitives share one vertex array; it is read once a node.
        let mut known: Vec<(VertexKey, u32, u32)> = Vec::new();
        for primitive in primitives {
            let Checked::Valid(mode) = primitive.mode else {
                return Err(fault("a primitive has an unknown mode"));
            };
            if !matches!(
                mode,
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                continue;
            }
            let attribute = |s| primitive.attributes.get(&Checked::Valid(s)).copied();
            let Some(positions) = attribute(Semantic::Positions) else {
                continue;
            };
            let colours = attribute(Semantic::Colors(0));
            let factor = self.factor(primitive)?;
            let factor_bits = factor.map(f32::to_bits);
            self.coloured |= colours.is_some() || factor_bits != [1.0_f32.to_bits(); 3];
            let key = (positions.value(), colours.map(|c| c.value()), factor_bits);
            let recent = known.iter().rev().take(RECENT).find(|(k, ..)| *k == key);
            let (first, count) = if let Some(&(_, first, count)) = recent {
                (first, count)
            } else {
                let (first, count) =
                    self.read_vertices(positions, colours, factor, world_from_node)?;
                known.push((key, first, count));
                (first, count)
            };
            let indices = match primitive.indices {
                Some(accessor) => self.document.indices(accessor)?,
                None => (0..count).collect(),
            };
            self.spend(indices.len() + 1)?;
            if let Some(&index) = indices.iter().find(|&&i| i >= count) {
                let fault = Fault::IndexOutOfRange {
                    index: i64::from(index),
                    vertices: u64::from(count),
                };
                return Err(ParseError::at(Place::File, fault));
            }
            self.push_triangles(mode, &indices, first, world_from_node.determinant() < 0.0);
            self.uses
                .push(Use::of(primitive, first, self.soup.faces.len()));
        }
        Ok(())
    }

    fn push_triangles(&mut self, mode: Mode, indices: &[u32], first: u32, mirrored: bool) {
        let mut add = |[a, b, c]: [u32; 3]| {
            let (b, c) = if mirrored { (c, b) } else { (b, c) };
            self.soup
                .faces
                .push_triangle([first + a, first + b, first + c], Place::File);
        };
        match mode {
            Mode::Triangles => indices
                .chunks_exact(3)
                .for_each(|t| add([t[0], t[1], t[2]])),
            Mode::TriangleFan => {
                let rim = indices.get(1..).unwrap_or_default();
                rim.windows(2).for_each(|w| add([indices[0], w[0], w[1]]));
            }
            _ => {
                for (i, w) in indices.windows(3).enumerate() {
                    // Repeated indices only steer the strip.
                    if w[0] != w[1] && w[1] != w[2] && w[2] != w[0] {
                        add(if i % 2 == 0 {
                            [w[0], w[1], w[2]]
                        } else {
                            [w[1], w[0], w[2]]
                        });
                    }
                }
            }
        }
    }

    /// Base colour factor, linear; white where a texture carries the colour.
    fn factor(&self, primitive: &Primitive) -> Result<[f32; 3], ParseError> {
        let Some(index) = primitive.material else {
            return Ok([1.0; 3]);
        };
        let i = index.value();
        let material = self
            .document
            .root
            .materials
            .get(i)
            .ok_or_else(|| fault(format!("there is no material {i}")))?;
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.0;
        Ok(if pbr.base_color_texture.is_some() {
            [1.0; 3]
        } else {
            [r, g, b]
        })
    }

    /// Appends the vertices of a primitive; gives the id of the first and their number.
    fn read_vertices(
        &mut self,
        positions: Index<::gltf::json::Accessor>,
        colours: Option<Index<::gltf::json::Accessor>>,
        factor: [f32; 3],
        world_from_node: DMat4,
    ) -> Result<(u32, u32), ParseError> {
        let points = self.document.elements(positions)?;
        if points.width != 3 {
            return Err(fault(format!(
                "accessor {}: positions must have three coordinates",
                positions.value()
            )));
        }
        let count = points.values.len() / 3;
        self.spend(count)?;
        let first = vertex_id(self.soup.positions.len(), Place::File)?;
        vertex_id(self.soup.positions.len() + count, Place::File)?;
        // An identity must not turn −0 into 0 or infinity into NaN.
        let transform = (world_from_node != DMat4::IDENTITY).then_some(world_from_node);
        self.soup
            .positions
            .extend(points.values.chunks_exact(3).map(|p| {
                let p = DVec3::new(p[0], p[1], p[2]);
                transform.map_or(p, |m| m.transform_point3(p))
            }));
        let factor = factor.map(f64::from);
        let end = self.soup.positions.len();
        if let Some(accessor) = colours {
            let rgba = self.document.elements(accessor)?;
            if rgba.width < 3 {
                return Err(fault(format!(
                    "accessor {}: colours must have three channels",
                    accessor.value()
                )));
            }
            let srgb = &self.srgb;
            let bytes = rgba.values.chunks_exact(rgba.width).take(count);
            self.soup
                .colours
                .extend(bytes.map(|c| [0, 1, 2].map(|k| srgb.byte(c[k] * factor[k]))));
        }
        self.soup
            .colours
            .resize(end, factor.map(|f| self.srgb.byte(f)));
        Ok((first, u32::try_from(count).unwrap_or(u32::MAX)))
    }

    fn spend(&mut self, elements: usize) -> Result<(), ParseError> {
        let left = self.budget.checked_sub(elements as u64);
        self.budget =
            left.ok_or_else(|| fault("its instances add up to far more than its size suggests"))?;
        Ok(())
    }
}
