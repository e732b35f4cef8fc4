//! Drawing with wgpu. Everything else in this crate works without.

pub mod atlas;
pub mod cluster;
pub mod colour;
pub mod grid;
pub mod timer;

use crate::gpu_types::Frame;
use crate::{EngineError, Viewer, Viewport};
use atlas::AtlasTextures;
use cluster::{ClusterBuffers, ClusterPass};
use colour::TileTextures;
use grid::{DEPTH_FORMAT, GridPass, SAMPLES};
use timer::GpuTimer;

/// Draws a [`Viewer`] on one device. 4× multisampled; depth is reversed, 32-bit float.
///
/// Holds the samples of one viewer at a time. A viewer hands its samples out once: one renderer draws it for good.
#[derive(Debug)]
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    format: wgpu::TextureFormat,
    grid: GridPass,
    cluster: ClusterPass,
    timer: Option<GpuTimer>,
    scene: Option<Scene>,
    surface: Option<Surface>,
}

/// What belongs to one viewer.
#[derive(Debug)]
struct Scene {
    viewer: u64,
    atlas: AtlasTextures,
    clusters: ClusterBuffers,
    tiles: TileTextures,
    instances: wgpu::Buffer,
}

/// Intermediate pictures of one size.
#[derive(Debug)]
struct Surface {
    size: Viewport,
    colour: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl Renderer {
    /// Limits to ask a device for: WebGPU's defaults, lowered to what the adapter has.
    pub fn limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
        let available = adapter.limits();
        let mut limits = wgpu::Limits::default().or_worse_values_from(&available);
        // A picture may be as large as the adapter can make it.
        limits.max_texture_dimension_2d = available.max_texture_dimension_2d;
        limits
    }

    /// Makes the pipelines. `format` is that of the views given to [`Renderer::render`]; best an sRGB format
    /// (`surface_format.add_srgb_suffix()`, listed in the surface's `view_formats`): for others the shader encodes sRGB
    /// itself, and antialiased edges come out a little darker.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, format: wgpu::TextureFormat) -> Self {
        let grid = GridPass::new(device, queue, format);
        Self {
            cluster: ClusterPass::new(device, &grid, format),
            grid,
            timer: GpuTimer::new(device, queue),
            device: device.clone(),
            queue: queue.clone(),
            format,
            scene: None,
            surface: None,
        }
    }

    /// Uploads what has been decoded since and draws the viewer's present state to `target`, whose size is the viewer's viewport.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn render(
        &mut self,
        viewer: &mut Viewer,
        target: &wgpu::TextureView,
    ) -> Result<(), EngineError> {
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("frame"),
            });
        let mut scene = match self
            .scene
            .take()
            .filter(|scene| scene.viewer == viewer.id())
        {
            Some(scene) => scene,
            None => Scene::new(&self.device, viewer)?,
        };
        scene.prepare(&self.device, &self.queue, &mut encoder, viewer)?;
        let surface = match self
            .surface
            .take()
            .filter(|surface| surface.size == viewer.viewport())
        {
            Some(surface) => surface,
            None => Surface::new(&self.device, viewer.viewport(), self.format),
        };
        let frame = viewer
            .frame()
            .unwrap_or(<Frame as bytemuck::Zeroable>::zeroed());
        self.grid.set_frame(&self.queue, &frame);
        let background = clear_colour(viewer.options().background.0, self.format.is_srgb());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("surface"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &surface.colour,
                    depth_slice: None,
                    resolve_target: Some(target),
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(background),
                        store: wgpu::StoreOp::Discard,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &surface.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: self.timer.as_ref().map(GpuTimer::writes),
                ..Default::default()
            });
            let textures = self.grid.bind(&self.device, &scene.atlas, &scene.tiles);
            self.grid.draw(
                &mut pass,
                &textures,
                &scene.instances,
                viewer.draw_list(),
                viewer.options().shade,
            );
            self.cluster.draw(
                &mut pass,
                &scene.clusters,
                viewer.cluster_list(),
                viewer.options().shade,
            );
        }
        if let Some(timer) = &self.timer {
            timer.resolve(&mut encoder);
        }
        self.queue.submit([encoder.finish()]);
        self.scene = Some(scene);
        self.surface = Some(surface);
        viewer.mark_drawn();
        Ok(())
    }
}

impl Renderer {
    /// Times the frames drawn; `None` where the device cannot.
    pub fn timer(&self) -> Option<&GpuTimer> {
        self.timer.as_ref()
    }
}

impl Scene {
    fn new(device: &wgpu::Device, viewer: &Viewer) -> Result<Self, EngineError> {
        let has_colours = viewer.document().metadata.has_colours;
        Ok(Self {
            viewer: viewer.id(),
            atlas: AtlasTextures::new(device, viewer.texture_layers(), has_colours)?,
            clusters: ClusterBuffers::new(device, viewer.cluster_slots()),
            tiles: TileTextures::new(device),
            instances: instance_buffer(device, 256),
        })
    }

    fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        viewer: &mut Viewer,
    ) -> Result<(), EngineError> {
        let atlas = self.atlas.grown(device, encoder, viewer.texture_layers())?;
        let clusters = self.clusters.grown(device, encoder, viewer.cluster_slots());
        if atlas.is_some() || clusters.is_some() {
            submit_before_uploads(device, queue, encoder);
        }
        if let Some(grown) = atlas {
            self.atlas = grown;
        }
        if let Some(grown) = clusters {
            self.clusters = grown;
        }
        for upload in viewer.take_uploads() {
            self.atlas.write(queue, &upload);
        }
        for upload in viewer.take_cluster_uploads() {
            self.clusters.write(queue, &upload);
        }
        if let Some(layer) = viewer.colour_layer() {
            if self.tiles.grow(device, encoder, layer.layers())? {
                submit_before_uploads(device, queue, encoder);
            }
            for upload in layer.take_uploads() {
                self.tiles.write(queue, &upload);
            }
            self.tiles.write_map(device, queue, layer.map());
        }
        let bytes: &[u8] = bytemuck::cast_slice(&viewer.draw_list().instances);
        let needed = u64::try_from(bytes.len()).unwrap_or(u64::MAX);
        if self.instances.size() < needed {
            self.instances = instance_buffer(device, needed.next_power_of_two());
        }
        queue.write_buffer(&self.instances, 0, bytes);
        Ok(())
    }
}

impl Surface {
    fn new(device: &wgpu::Device, size: Viewport, format: wgpu::TextureFormat) -> Self {
        let texture = |label, format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width: size.width,
                    height: size.height,
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: SAMPLES,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            size,
            colour: texture("colour", format),
            depth: texture("depth", DEPTH_FORMAT),
        }
    }
}

/// Submits the copies in `encoder`, which have to come before the uploads: the queue runs these first of all it is given.
fn submit_before_uploads(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    encoder: &mut wgpu::CommandEncoder,
) {
    let copy = std::mem::replace(
        encoder,
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()),
    );
    queue.submit([copy.finish()]);
}

fn instance_buffer(device: &wgpu::Device, bytes: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("instances"),
        size: bytes,
        usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// The clear value that ends up as `rgb` in a picture; an sRGB picture is given linear values.
fn clear_colour(rgb: [u8; 3], is_srgb: bool) -> wgpu::Color {
    let [r, g, b] = rgb.map(|byte| {
        let value = f64::from(byte) / 255.0;
        match (is_srgb, value <= 0.04045) {
            (false, _) => value,
            (true, true) => value / 12.92,
            (true, false) => ((value + 0.055) / 1.055).powf(2.4),
        }
    });
    wgpu::Color { r, g, b, a: 1.0 }
}
