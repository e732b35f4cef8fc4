//! Plain drawing: one instanced grid for each size, one instance for each leaf of the cut.
//!
//! The six grids (1² to 32² cells) share one index buffer; vertices have no attributes but their number, everything else
//! is in the sample textures. Lines for [`Shade::Wire`] are a second set of indices over the same vertices.

use super::atlas::AtlasTextures;
use super::colour::TileTextures;
use crate::gpu_types::{DrawList, Frame, Instance};
use crate::options::Shade;
use std::ops::Range;
use std::sync::OnceLock;

/// Samples a pixel.
pub const SAMPLES: u32 = 4;
/// Format of the depth buffer.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Source of the one shader module, its shared parts first.
pub const SHADER: &str = concat!(
    include_str!("../shaders/shared/frame.wgsl"),
    include_str!("../shaders/shared/samples.wgsl"),
    include_str!("../shaders/shared/patch_vertex.wgsl"),
    include_str!("../shaders/shared/light.wgsl"),
    include_str!("../shaders/shared/tiles.wgsl"),
    include_str!("../shaders/shared/visible.wgsl"),
    include_str!("../shaders/grid.wgsl"),
);

/// How instances lie in their buffer.
const INSTANCES: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Instance>() as u64,
    step_mode: wgpu::VertexStepMode::Instance,
    attributes: &Instance::ATTRIBUTES,
};

/// One of the lists that a picture may consist of, each with a frame of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// What both of two pictures show, or the only one.
    Steady,
    /// What is going.
    Leaving,
    /// What is coming.
    Arriving,
}

/// One layer, ready to be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// Its instances.
    pub list: &'a DrawList,
    /// Where they start in the instance buffer.
    pub first: u32,
}

/// Pipelines and buffers that do not depend on what is drawn.
#[derive(Debug)]
pub struct GridPass {
    device: wgpu::Device,
    format: wgpu::TextureFormat,
    module: wgpu::ShaderModule,
    whole: Pipelines,
    /// With pixels left out, which is slower; made when first needed.
    discarding: OnceLock<Pipelines>,
    layout: wgpu::BindGroupLayout,
    frames: [wgpu::Buffer; 3],
    indices: wgpu::Buffer,
    /// By log2 of the cells a side.
    triangle_ranges: [Range<u32>; 6],
    line_ranges: [Range<u32>; 6],
}

impl GridPass {
    /// Makes the pipelines for pictures of `format`.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("grid"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let texture = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Uint,
                view_dimension: wgpu::TextureViewDimension::D2Array,
                multisampled: false,
            },
            count: None,
        };
        let tiles = TileTextures::layout(4);
        let morphs = wgpu::BindGroupLayoutEntry {
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            ..texture(7)
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("grid"),
            entries: &[
                wgpu::BindGroupLayoutEntry {
                    binding: 0,
                    visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                    ty: wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: None,
                    },
                    count: None,
                },
                texture(1),
                texture(2),
                texture(3),
                tiles[0],
                tiles[1],
                tiles[2],
                morphs,
            ],
        });
        let (triangle_ranges, line_ranges, indices) = grid_indices();
        let maker = PipelineMaker {
            device,
            module: &module,
            layout: &layout,
            format,
            discards: false,
        };
        let whole = maker.both("", &[Some(INSTANCES)]);
        let indices = index_buffer(device, queue, &indices);
        let frame = |_| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("frame"),
                size: size_of::<Frame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Self {
            device: device.clone(),
            format,
            whole,
            discarding: OnceLock::new(),
            frames: [Layer::Steady, Layer::Leaving, Layer::Arriving].map(frame),
            module,
            layout,
            indices,
            triangle_ranges,
            line_ranges,
        }
    }

    /// Pipelines of other shaders with the same bindings.
    pub(super) fn maker<'a>(
        &'a self,
        module: &'a wgpu::ShaderModule,
        discards: bool,
    ) -> PipelineMaker<'a> {
        PipelineMaker {
            device: &self.device,
            module,
            layout: &self.layout,
            format: self.format,
            discards,
        }
    }

    /// Sets what is the same for all of `layer`.
    pub fn set_frame(&self, queue: &wgpu::Queue, layer: Layer, frame: &Frame) {
        queue.write_buffer(self.frame_of(layer), 0, bytemuck::bytes_of(frame));
    }

    /// Binds what to draw `layer` from: samples, the morphs of clusters, and `texels` in place of those of the tiles.
    pub fn bind(
        &self,
        device: &wgpu::Device,
        layer: Layer,
        atlas: &AtlasTextures,
        tiles: &TileTextures,
        morphs: &wgpu::TextureView,
        texels: Option<&wgpu::TextureView>,
    ) -> wgpu::BindGroup {
        let [positions, normals, colours] = atlas.views();
        let [tile_texels, tile_map] = tiles.views();
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("grid"),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: self.frame_of(layer).as_entire_binding(),
                },
                view(1, &positions),
                view(2, &normals),
                view(3, &colours),
                view(4, texels.unwrap_or(&tile_texels)),
                wgpu::BindGroupEntry {
                    binding: 5,
                    resource: wgpu::BindingResource::Sampler(tiles.sampler()),
                },
                view(6, &tile_map),
                view(7, morphs),
            ],
        })
    }

    /// Draws `drawing`, whose instances are in `instances` and whose samples `samples` binds. Pixels are left out only where
    /// it `discards`.
    pub fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        samples: &wgpu::BindGroup,
        instances: &wgpu::Buffer,
        drawing: Drawing<'_>,
        shade: Shade,
        discards: bool,
    ) {
        let pipelines = if discards {
            self.discarding
                .get_or_init(|| self.maker(&self.module, true).both("", &[Some(INSTANCES)]))
        } else {
            &self.whole
        };
        pass.set_bind_group(0, samples, &[]);
        pass.set_vertex_buffer(0, instances.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
        pass.set_pipeline(&pipelines.surface);
        draw_ranges(pass, drawing, &self.triangle_ranges);
        if shade == Shade::Wire {
            pass.set_pipeline(&pipelines.lines);
            draw_ranges(pass, drawing, &self.line_ranges);
        }
    }

    fn frame_of(&self, layer: Layer) -> &wgpu::Buffer {
        let [steady, leaving, arriving] = &self.frames;
        match layer {
            Layer::Steady => steady,
            Layer::Leaving => leaving,
            Layer::Arriving => arriving,
        }
    }
}

fn draw_ranges(pass: &mut wgpu::RenderPass<'_>, drawing: Drawing<'_>, ranges: &[Range<u32>; 6]) {
    for (grid, instances) in drawing.list.draws() {
        if let Some(indices) = ranges.get(usize::from(grid)) {
            let instances = drawing.first + instances.start..drawing.first + instances.end;
            pass.draw_indexed(indices.clone(), 0, instances);
        }
    }
}

#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) surface: wgpu::RenderPipeline,
    pub(super) lines: wgpu::RenderPipeline,
}

pub(super) struct PipelineMaker<'a> {
    device: &'a wgpu::Device,
    module: &'a wgpu::ShaderModule,
    layout: &'a wgpu::BindGroupLayout,
    format: wgpu::TextureFormat,
    discards: bool,
}

impl PipelineMaker<'_> {
    /// The pipelines whose vertex shaders are called `{prefix}surface_vertex` and `{prefix}line_vertex`.
    pub(super) fn both(
        &self,
        prefix: &str,
        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    ) -> Pipelines {
        Pipelines {
            surface: self.make(
                wgpu::PrimitiveTopology::TriangleList,
                &format!("{prefix}surface_vertex"),
                "surface_fragment",
                buffers,
            ),
            lines: self.make(
                wgpu::PrimitiveTopology::LineList,
                &format!("{prefix}line_vertex"),
                "line_fragment",
                buffers,
            ),
        }
    }

    fn make(
        &self,
        topology: wgpu::PrimitiveTopology,
        vertex: &str,
        fragment: &str,
        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    ) -> wgpu::RenderPipeline {
        let layout = self
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("grid"),
                bind_group_layouts: &[Some(self.layout)],
                immediate_size: 0,
            });
        let encode_srgb = if self.format.is_srgb() { 0.0 } else { 1.0 };
        let discards = f64::from(u8::from(self.discards));
        let constants = [("encode_srgb", encode_srgb), ("discards", discards)];
        self.device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: self.module,
                    entry_point: Some(vertex),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers,
                },
                // Both faces are drawn: open scans are seen from behind, too.
                primitive: wgpu::PrimitiveState {
                    topology,
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH_FORMAT,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: SAMPLES,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: self.module,
                    entry_point: Some(fragment),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &constants,
                        ..Default::default()
                    },
                    targets: &[Some(wgpu::ColorTargetState {
                        format: self.format,
                        blend: None,
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
    }
}

/// Where the triangles and the lines of each grid size are, and all indices.
fn grid_indices() -> ([Range<u32>; 6], [Range<u32>; 6], Vec<u16>) {
    let mut indices: Vec<u16> = Vec::new();
    let end = |indices: &Vec<u16>| u32::try_from(indices.len()).unwrap_or(u32::MAX);
    let triangle_ranges = [0u16, 1, 2, 3, 4, 5].map(|resolution| {
        let start = end(&indices);
        let (cells, row) = (1 << resolution, (1 << resolution) + 1);
        for (j, i) in (0..cells).flat_map(|j| (0..cells).map(move |i| (j, i))) {
            let first: u16 = j * row + i;
            let (right, across, above) = (first + 1, first + row + 1, first + row);
            indices.extend([first, right, across, first, across, above]);
        }
        start..end(&indices)
    });
    let line_ranges = [0u16, 1, 2, 3, 4, 5].map(|resolution| {
        let start = end(&indices);
        let (cells, row) = (1 << resolution, (1 << resolution) + 1);
        for (j, i) in (0..row).flat_map(|j| (0..row).map(move |i| (j, i))) {
            let first: u16 = j * row + i;
            if i < cells {
                indices.extend([first, first + 1]);
            }
            if j < cells {
                indices.extend([first, first + row]);
            }
            if i < cells && j < cells {
                indices.extend([first, first + row + 1]);
            }
        }
        start..end(&indices)
    });
    (triangle_ranges, line_ranges, indices)
}

fn index_buffer(device: &wgpu::Device, queue: &wgpu::Queue, indices: &[u16]) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(indices);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("indices"),
        size: u64::try_from(bytes.len()).unwrap_or(u64::MAX),
        usage: wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, bytes);
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_have_two_triangles_a_cell_and_every_edge_once() {
        let (triangles, lines, indices) = grid_indices();
        for n in 0..6 {
            let cells = 1usize << n;
            let own = &indices[triangles[n].start as usize..triangles[n].end as usize];
            assert_eq!(own.len(), 6 * cells * cells);
            let most = own.iter().max().copied().map(usize::from);
            assert_eq!(most, Some((cells + 1) * (cells + 1) - 1));
            assert_eq!(lines[n].len(), 2 * (3 * cells * cells + 2 * cells));
        }
    }
}
