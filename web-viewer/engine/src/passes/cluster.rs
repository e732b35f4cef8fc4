//! Drawing of clusters: one vertex and one index buffer cut into slots of equal size, runs of slots in one call.
//!
//! Unused corners of a slot form triangles without extent, which cost little and save draw calls. Numbers of vertices are
//! absolute, since WebGL2 has no base vertex. Shading is that of the grids: same bindings, same fragment shader.

use super::colour::{copy_layers, texel_texture, write_mips};
use super::grid::{GridPass, Pipelines, SHADER as GRID_SHADER};
use crate::colour::slots::MAX_LAYERS;
use crate::gpu_types::{CLUSTER_ATTRIBUTES, CLUSTER_TEXTURE_ATTRIBUTES, ClusterList};
use crate::options::Shade;
use crate::residency::textures::{PARTS_A_LAYER, TEXTURE_SIDE, TEXTURES_ACROSS, TextureChange};
use crate::residency::upload::{
    CLUSTER_CORNERS, CLUSTER_VERTEX_BYTES, CLUSTER_VERTICES, ClusterUpload, MAX_CLUSTER_SLOTS,
};
use std::sync::OnceLock;

/// Source of the shader module: that of the grids, with the vertex shaders of clusters.
pub fn shader() -> String {
    [GRID_SHADER, include_str!("../shaders/cluster.wgsl")].concat()
}

/// Pipelines of clusters.
#[derive(Debug)]
pub struct ClusterPass {
    module: wgpu::ShaderModule,
    whole: Pipelines,
    /// With pixels left out; made when first needed.
    discarding: OnceLock<Pipelines>,
}

/// How vertices lie in their buffer.
const VERTICES: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: CLUSTER_VERTEX_BYTES,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &CLUSTER_ATTRIBUTES,
};
/// Bytes of the code of a vertex's texture.
const NUMBER_BYTES: u64 = 4;
const NUMBERS: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: NUMBER_BYTES,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &CLUSTER_TEXTURE_ATTRIBUTES,
};
const BUFFERS: [Option<wgpu::VertexBufferLayout<'_>>; 2] = [Some(VERTICES), Some(NUMBERS)];
/// Bytes of the number of a vertex.
const CORNER_BYTES: u64 = 4;

impl ClusterPass {
    /// Makes the pipelines, with the bindings of `grid` and for its pictures.
    pub fn new(device: &wgpu::Device, grid: &GridPass) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("cluster"),
            source: wgpu::ShaderSource::Wgsl(shader().into()),
        });
        Self {
            whole: grid.maker(&module, false).both("cluster_", &BUFFERS),
            discarding: OnceLock::new(),
            module,
        }
    }

    /// Draws `list` from `buffers`, with the bindings of `grid` set. Pixels are left out only where it `discards`.
    pub fn draw(
        &self,
        grid: &GridPass,
        pass: &mut wgpu::RenderPass<'_>,
        buffers: &ClusterBuffers,
        list: &ClusterList,
        shade: Shade,
        discards: bool,
    ) {
        if list.runs.is_empty() {
            return;
        }
        let pipelines = if discards {
            self.discarding
                .get_or_init(|| grid.maker(&self.module, true).both("cluster_", &BUFFERS))
        } else {
            &self.whole
        };
        pass.set_vertex_buffer(0, buffers.vertices.slice(..));
        pass.set_vertex_buffer(1, buffers.numbers.slice(..));
        pass.set_pipeline(&pipelines.surface);
        pass.set_index_buffer(buffers.corners.slice(..), wgpu::IndexFormat::Uint32);
        for run in &list.runs {
            let corners = run.start * CLUSTER_CORNERS..run.end * CLUSTER_CORNERS;
            pass.draw_indexed(corners, 0, 0..1);
        }
        if shade == Shade::Wire {
            pass.set_pipeline(&pipelines.lines);
            pass.set_index_buffer(buffers.line_ends.slice(..), wgpu::IndexFormat::Uint32);
            for run in &list.runs {
                let ends = 2 * run.start * CLUSTER_CORNERS..2 * run.end * CLUSTER_CORNERS;
                pass.draw_indexed(ends, 0, 0..1);
            }
        }
    }
}

/// The resident clusters of one file.
#[derive(Debug)]
pub struct ClusterBuffers {
    vertices: wgpu::Buffer,
    corners: wgpu::Buffer,
    line_ends: wgpu::Buffer,
    /// By vertex: the code of the part of the textures that its cluster shows; 0 for none.
    numbers: wgpu::Buffer,
    slots: u32,
}

impl ClusterBuffers {
    /// Buffers of at least `slots` slots.
    pub fn new(device: &wgpu::Device, slots: u32) -> Self {
        let slots = slots.max(1).next_power_of_two();
        let buffer = |label, bytes: u64, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes * u64::from(slots),
                usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let corners = CORNER_BYTES * u64::from(CLUSTER_CORNERS);
        Self {
            vertices: buffer(
                "cluster vertices",
                CLUSTER_VERTEX_BYTES * u64::from(CLUSTER_VERTICES),
                wgpu::BufferUsages::VERTEX,
            ),
            corners: buffer("cluster corners", corners, wgpu::BufferUsages::INDEX),
            line_ends: buffer("cluster lines", 2 * corners, wgpu::BufferUsages::INDEX),
            numbers: buffer(
                "cluster textures",
                NUMBER_BYTES * u64::from(CLUSTER_VERTICES),
                wgpu::BufferUsages::VERTEX,
            ),
            slots,
        }
    }

    /// Larger buffers with the same content where `slots` are needed and there are fewer.
    pub fn grown(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        slots: u32,
    ) -> Option<Self> {
        if slots <= self.slots {
            return None;
        }
        let grown = Self::new(device, slots);
        for (from, to) in [
            (&self.vertices, &grown.vertices),
            (&self.numbers, &grown.numbers),
            (&self.corners, &grown.corners),
            (&self.line_ends, &grown.line_ends),
        ] {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        Some(grown)
    }

    /// Writes a cluster, which has no texture yet, into its slot.
    pub fn write(&self, queue: &wgpu::Queue, upload: &ClusterUpload) {
        let slot = u64::from(upload.slot);
        let corners = CORNER_BYTES * u64::from(CLUSTER_CORNERS) * slot;
        let vertices = CLUSTER_VERTEX_BYTES * u64::from(CLUSTER_VERTICES) * slot;
        queue.write_buffer(
            &self.vertices,
            vertices,
            bytemuck::cast_slice(&upload.vertices),
        );
        queue.write_buffer(
            &self.corners,
            corners,
            bytemuck::cast_slice(&upload.corners),
        );
        queue.write_buffer(
            &self.line_ends,
            2 * corners,
            bytemuck::cast_slice(&upload.line_ends),
        );
        self.set_texture(queue, upload.slot, 0);
    }

    /// Sets which part of the textures the cluster in a slot shows, by its code; 0 for none.
    fn set_texture(&self, queue: &wgpu::Queue, slot: u32, code: u32) {
        let vertices = usize::try_from(CLUSTER_VERTICES).unwrap_or_default();
        let first = NUMBER_BYTES * u64::from(CLUSTER_VERTICES) * u64::from(slot);
        queue.write_buffer(
            &self.numbers,
            first,
            bytemuck::cast_slice(&vec![code; vertices]),
        );
    }
}

/// How far the clusters of one file are on their way, by slot, for shaders.
#[derive(Debug)]
pub struct ClusterMorphs {
    texture: wgpu::Texture,
    /// What is in the texture, up to the last slot that was ever written.
    written: Vec<f32>,
}

/// Slots in a row of the texture.
pub const MORPHS_ACROSS: u32 = 128;

impl ClusterMorphs {
    /// Everything at rest.
    pub fn new(device: &wgpu::Device) -> Self {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("cluster morphs"),
            size: wgpu::Extent3d {
                width: MORPHS_ACROSS,
                height: MAX_CLUSTER_SLOTS / MORPHS_ACROSS,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Self {
            texture,
            written: Vec::new(),
        }
    }

    /// Writes those of what is drawn; everything else is at rest.
    pub fn write(&mut self, queue: &wgpu::Queue, lists: &[&ClusterList]) {
        let morphs = || lists.iter().flat_map(|list| list.morphs.iter().copied());
        let last = morphs().map(|(slot, _)| slot).max();
        let row = MORPHS_ACROSS as usize;
        let rows = last.map_or(0, |last| last as usize / row + 1);
        let mut wanted = vec![0.0; (rows * row).max(self.written.len())];
        for (slot, morph) in morphs() {
            if let Some(place) = wanted.get_mut(slot as usize) {
                *place = morph;
            }
        }
        if wanted == self.written {
            return;
        }
        queue.write_texture(
            self.texture.as_image_copy(),
            bytemuck::cast_slice(&wanted),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * MORPHS_ACROSS),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                width: MORPHS_ACROSS,
                height: u32::try_from(wanted.len() / row).unwrap_or_default(),
                depth_or_array_layers: 1,
            },
        );
        self.written = wanted;
    }

    /// A view to bind.
    pub fn view(&self) -> wgpu::TextureView {
        self.texture
            .create_view(&wgpu::TextureViewDescriptor::default())
    }
}

/// The texture that parts are lent of, to the clusters of one file.
#[derive(Debug)]
pub struct ClusterTextures {
    texels: wgpu::Texture,
    layers: u32,
}

impl ClusterTextures {
    /// Without a part yet.
    pub fn new(device: &wgpu::Device) -> Self {
        Self {
            texels: texel_texture(device, 1, 1),
            layers: 0,
        }
    }

    /// Makes room for `parts`, keeping what is there; whether commands were added that have to run before uploads.
    pub fn grow(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        parts: u32,
    ) -> bool {
        let layers = parts.div_ceil(PARTS_A_LAYER);
        if layers <= self.layers {
            return false;
        }
        // By half: a doubled texture of a large cache would be a large waste. The pool never asks for more than devices have.
        let wanted = layers.max(self.layers + self.layers / 2).min(MAX_LAYERS);
        let larger = texel_texture(device, TEXTURE_SIDE * TEXTURES_ACROSS, wanted);
        let had = self.layers;
        if had > 0 {
            copy_layers(encoder, &self.texels, &larger, had);
        }
        (self.texels, self.layers) = (larger, wanted);
        had > 0
    }

    /// Applies a change, to the clusters in `buffers` as well.
    pub fn apply(&self, queue: &wgpu::Queue, buffers: &ClusterBuffers, change: &TextureChange) {
        match change {
            TextureChange::Shown { slot, part, mips } => {
                write_mips(queue, &self.texels, part.corner(), mips);
                buffers.set_texture(queue, *slot, part.code());
            }
            TextureChange::Gone { slot } => buffers.set_texture(queue, *slot, 0),
        }
    }

    /// A view to bind.
    pub fn view(&self) -> wgpu::TextureView {
        self.texels.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        })
    }
}
