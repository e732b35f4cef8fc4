//! Pictures of plain triangle meshes, with or without textures: what a file is compared with.
//!
//! Drawn with the light, the sampling and the rounding to the lattice that the file's own surface is drawn with, so that
//! pictures differ by what is drawn and not by how. Textures have mips made in linear light and 16-fold anisotropy.
//! Limit: a mesh is one vertex and one index buffer, so 3 M vertices or so are the most on devices with WebGPU's default
//! limits; no transparency.

mod texture;

pub use texture::{MeshTexture, Wrap};

use crate::headless::FORMAT;
use crate::{Headless, NativeError, Picture, target};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec2, Vec3};
use marquetry_engine::camera::View;
use marquetry_engine::gpu_types::Frame;
use marquetry_engine::passes::clear_colour;
use marquetry_engine::passes::grid::{DEPTH_FORMAT, SAMPLES, SHADER};
use marquetry_engine::passes::timer::GpuTimer;
use marquetry_engine::residency::upload::pack_point;
use marquetry_engine::{Background, Camera, Shade, Viewport, wgpu};
use marquetry_format::{Lattice, Metadata};
use std::borrow::Cow;
use std::ops::Range;
use std::time::{Duration, Instant};
use texture::BoundTexture;
use wgpu::util::DeviceExt;

/// Largest lattice coordinate.
const LAST: f64 = ((1_u32 << 21) - 1) as f64;

/// A corner of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// World coordinates.
    pub position: DVec3,
    /// Of any length; zero where there is none.
    pub normal: Vec3,
    /// sRGB; multiplied with the texture.
    pub colour: [u8; 3],
    /// Place on the texture, (0, 0) its upper left corner.
    pub uv: Vec2,
}

/// Triangles with one texture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Numbers of triangles.
    pub triangles: Range<usize>,
    /// A number of the painter's textures.
    pub texture: Option<usize>,
}

/// A mesh to be drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlainMesh {
    /// Its corners.
    pub vertices: Vec<Vertex>,
    /// Counter-clockwise seen from outside; every number is that of a vertex.
    pub triangles: Vec<[u32; 3]>,
    /// What is drawn; triangles in no part are not.
    pub parts: Vec<Part>,
}

/// As it lies in the vertex buffer.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Packed {
    point: [u32; 2],
    normal: [f32; 3],
    colour: [u8; 4],
    uv: [f32; 2],
}

const ATTRIBUTES: [wgpu::VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Uint32x2, 1 => Float32x3, 2 => Unorm8x4, 3 => Float32x2];

/// A mesh on the device.
#[derive(Debug)]
pub struct MeshBuffers {
    vertices: wgpu::Buffer,
    corners: wgpu::Buffer,
    parts: Vec<Part>,
    triangles: u64,
}

impl MeshBuffers {
    /// Triangles drawn.
    pub fn triangles(&self) -> u64 {
        self.triangles
    }
}

/// Draws plain meshes without a window, in the space of one file.
#[derive(Debug)]
pub struct MeshPainter {
    headless: Headless,
    pipeline: wgpu::RenderPipeline,
    frame: wgpu::Buffer,
    frame_binding: wgpu::BindGroup,
    textures: Vec<BoundTexture>,
    /// White.
    plain: BoundTexture,
    timer: Option<GpuTimer>,
    looks: Looks,
    metadata: Metadata,
    target: Option<Target>,
}

/// How meshes are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looks {
    /// What the colours show. Lines and levels are not drawn.
    pub shade: Shade,
    /// Colour behind the mesh.
    pub background: Background,
    /// Whether vertices' colours count; else the mesh is grey.
    pub has_colours: bool,
}

#[derive(Debug)]
struct Target {
    picture: wgpu::Texture,
    colour: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl MeshPainter {
    /// A painter of meshes in the space of the file that `metadata` describes, with the textures that parts name.
    pub fn new(
        headless: &Headless,
        metadata: &Metadata,
        looks: Looks,
        textures: &[MeshTexture],
    ) -> Self {
        let device = headless.device();
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let frame_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let frame_binding = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &frame_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: frame.as_entire_binding(),
            }],
        });
        let texture_layout = texture::layout(device);
        let bound = |texture: &MeshTexture| BoundTexture::new(headless, &texture_layout, texture);
        Self {
            pipeline: pipeline(device, &[Some(&frame_layout), Some(&texture_layout)]),
            textures: textures.iter().map(bound).collect(),
            plain: bound(&MeshTexture::WHITE),
            timer: GpuTimer::new(device, headless.queue()),
            headless: headless.clone(),
            frame,
            frame_binding,
            looks,
            metadata: metadata.clone(),
            target: None,
        }
    }

    /// Uploads `mesh`, its positions rounded to the file's lattice.
    ///
    /// # Errors
    /// [`NativeError::MeshTooLarge`].
    pub fn upload(&self, mesh: &PlainMesh) -> Result<MeshBuffers, NativeError> {
        let lattice = &self.metadata.lattice;
        let packed: Vec<Packed> = mesh.vertices.iter().map(|v| pack(v, lattice)).collect();
        let device = self.headless.device();
        let most = device.limits().max_buffer_size;
        let buffer = |label, bytes: &[u8], usage| {
            let size_bytes = bytes.len() as u64;
            if size_bytes > most {
                return Err(NativeError::MeshTooLarge { size_bytes, most });
            }
            Ok(
                device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some(label),
                    contents: bytes,
                    usage,
                }),
            )
        };
        Ok(MeshBuffers {
            vertices: buffer(
                "mesh vertices",
                bytemuck::cast_slice(&packed),
                wgpu::BufferUsages::VERTEX,
            )?,
            corners: buffer(
                "mesh corners",
                bytemuck::cast_slice(&mesh.triangles),
                wgpu::BufferUsages::INDEX,
            )?,
            triangles: mesh.parts.iter().map(|p| p.triangles.len() as u64).sum(),
            parts: mesh.parts.clone(),
        })
    }

    /// Draws `mesh` from `camera` and waits until the GPU is done. The time until it had its commands.
    ///
    /// # Errors
    /// [`NativeError::Size`], or when the GPU fails.
    pub fn draw(
        &mut self,
        mesh: &MeshBuffers,
        camera: &Camera,
        viewport: Viewport,
    ) -> Result<Duration, NativeError> {
        let target = self.target_of(viewport)?;
        let start = Instant::now();
        let view = View::new(camera, &self.metadata, viewport);
        let frame = Frame::new(&view, self.looks.shade, self.looks.has_colours);
        let (device, queue) = (self.headless.device(), self.headless.queue());
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode(&mut encoder, mesh, &target);
        if let Some(timer) = &self.timer {
            timer.resolve(&mut encoder);
        }
        queue.submit([encoder.finish()]);
        let submitted = start.elapsed();
        self.target = Some(target);
        self.headless.wait()?;
        Ok(submitted)
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, mesh: &MeshBuffers, target: &Target) {
        let picture = target
            .picture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let background = clear_colour(self.looks.background.0, FORMAT.is_srgb());
        let timer = self.timer.as_ref();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("mesh"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.colour,
                depth_slice: None,
                resolve_target: Some(&picture),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(background),
                    store: wgpu::StoreOp::Discard,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: timer.and_then(|timer| timer.writes(true, true)),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.frame_binding, &[]);
        pass.set_vertex_buffer(0, mesh.vertices.slice(..));
        pass.set_index_buffer(mesh.corners.slice(..), wgpu::IndexFormat::Uint32);
        for part in mesh.parts.iter().filter(|part| !part.triangles.is_empty()) {
            let texture = part.texture.and_then(|number| self.textures.get(number));
            pass.set_bind_group(1, texture.unwrap_or(&self.plain).binding(), &[]);
            let corner = |triangle: usize| u32::try_from(3 * triangle).unwrap_or(u32::MAX);
            pass.draw_indexed(
                corner(part.triangles.start)..corner(part.triangles.end),
                0,
                0..1,
            );
        }
    }

    /// Milliseconds that the GPU took for what was drawn last; `None` where that cannot be measured.
    pub fn gpu_ms(&self) -> Option<f64> {
        self.timer.as_ref()?.wait_ms(self.headless.device())
    }

    /// The picture that was drawn last.
    ///
    /// # Errors
    /// [`NativeError::ReadBack`].
    pub fn read_back(&self) -> Result<Picture, NativeError> {
        match &self.target {
            Some(target) => target::read_back(&self.headless, &target.picture),
            None => Err(NativeError::ReadBack("nothing was drawn".to_owned())),
        }
    }

    fn target_of(&mut self, viewport: Viewport) -> Result<Target, NativeError> {
        let known = self.target.take().filter(|target| {
            (target.picture.width(), target.picture.height()) == (viewport.width, viewport.height)
        });
        if let Some(known) = known {
            return Ok(known);
        }
        let picture = target::of_size(&self.headless, viewport, None)?;
        let sampled = |format| {
            let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
            target::texture(&self.headless, viewport, format, SAMPLES, usage)
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        Ok(Target {
            picture,
            colour: sampled(FORMAT),
            depth: sampled(DEPTH_FORMAT),
        })
    }
}

fn pack(vertex: &Vertex, lattice: &Lattice) -> Packed {
    let place = (vertex.position - DVec3::from_array(lattice.origin)) / lattice.step;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the lattice; NaN becomes 0"
    )]
    let point = place.round().to_array().map(|c| c.clamp(0.0, LAST) as u32);
    let [r, g, b] = vertex.colour;
    Packed {
        point: pack_point(point),
        normal: vertex.normal.to_array(),
        colour: [r, g, b, 255],
        uv: vertex.uv.to_array(),
    }
}

fn pipeline(
    device: &wgpu::Device,
    layouts: &[Option<&wgpu::BindGroupLayout>],
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("mesh"),
        source: wgpu::ShaderSource::Wgsl(Cow::Owned(
            [SHADER, include_str!("mesh/mesh.wgsl")].concat(),
        )),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("mesh"),
        bind_group_layouts: layouts,
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("mesh"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("mesh_vertex"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Packed>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &ATTRIBUTES,
            })],
        },
        // Both faces are drawn, as of files.
        primitive: wgpu::PrimitiveState::default(),
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
            module: &module,
            entry_point: Some("mesh_fragment"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: FORMAT,
                blend: None,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
