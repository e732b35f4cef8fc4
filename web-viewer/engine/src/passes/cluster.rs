//! Drawing of clusters: one vertex and one index buffer cut into slots of equal size, runs of slots in one call.
//!
//! Unused corners of a slot form triangles without extent, which cost little and save draw calls. Numbers of vertices are
//! absolute, since WebGL2 has no base vertex. Shading is that of the grids: same bindings, same fragment shader.

use super::grid::{GridPass, Pipelines, SHADER as GRID_SHADER};
use crate::gpu_types::{CLUSTER_ATTRIBUTES, ClusterList};
use crate::options::Shade;
use crate::residency::upload::{CLUSTER_CORNERS, CLUSTER_VERTICES, ClusterUpload};
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

/// Bytes of a vertex.
const VERTEX_BYTES: u64 = 16;
/// How vertices lie in their buffer.
const VERTICES: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: VERTEX_BYTES,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &CLUSTER_ATTRIBUTES,
};
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
            whole: grid
                .maker(&module, false)
                .both("cluster_", &[Some(VERTICES)]),
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
            self.discarding.get_or_init(|| {
                grid.maker(&self.module, true)
                    .both("cluster_", &[Some(VERTICES)])
            })
        } else {
            &self.whole
        };
        pass.set_vertex_buffer(0, buffers.vertices.slice(..));
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
                VERTEX_BYTES * u64::from(CLUSTER_VERTICES),
                wgpu::BufferUsages::VERTEX,
            ),
            corners: buffer("cluster corners", corners, wgpu::BufferUsages::INDEX),
            line_ends: buffer("cluster lines", 2 * corners, wgpu::BufferUsages::INDEX),
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
            (&self.corners, &grown.corners),
            (&self.line_ends, &grown.line_ends),
        ] {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        Some(grown)
    }

    /// Writes a cluster into its slot.
    pub fn write(&self, queue: &wgpu::Queue, upload: &ClusterUpload) {
        let slot = u64::from(upload.slot);
        let corners = CORNER_BYTES * u64::from(CLUSTER_CORNERS) * slot;
        let vertices = VERTEX_BYTES * u64::from(CLUSTER_VERTICES) * slot;
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
    }
}
