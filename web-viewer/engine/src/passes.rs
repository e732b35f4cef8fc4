//! Drawing with wgpu. Everything else in this crate works without.

pub mod atlas;
pub mod blend;
pub mod cluster;
pub mod colour;
pub mod grid;
pub mod timer;

use crate::gpu_types::{ClusterList, DrawList, Frame};
use crate::{EngineError, Transition, Viewer, Viewport};
use atlas::AtlasTextures;
use blend::BlendPass;
use cluster::{ClusterBuffers, ClusterMorphs, ClusterPass, ClusterTextures};
use colour::TileTextures;
use grid::{DEPTH_FORMAT, Drawing, GridPass, Layer, SAMPLES};
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
    /// Made for the first picture that fades.
    blend: Option<BlendPass>,
}

/// What belongs to one viewer.
#[derive(Debug)]
struct Scene {
    viewer: u64,
    atlas: AtlasTextures,
    clusters: ClusterBuffers,
    textures: ClusterTextures,
    morphs: ClusterMorphs,
    tiles: TileTextures,
    instances: wgpu::Buffer,
}

/// One of the pictures that a frame is made of.
#[derive(Debug, Clone, Copy)]
struct Picture<'a> {
    target: &'a wgpu::TextureView,
    layers: &'a [Layer],
    discards: bool,
    /// Whether the clock starts with it.
    is_first: bool,
    /// Whether the clock stops after it.
    is_last: bool,
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
            cluster: ClusterPass::new(device, &grid),
            grid,
            timer: GpuTimer::new(device, queue),
            device: device.clone(),
            queue: queue.clone(),
            format,
            scene: None,
            surface: None,
            blend: None,
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
        let mut encoder = self.encoder();
        let scene = self.prepare(&mut encoder, viewer)?;
        let surface = match self
            .surface
            .take()
            .filter(|surface| surface.size == viewer.viewport())
        {
            Some(surface) => surface,
            None => Surface::new(&self.device, viewer.viewport(), self.format),
        };
        self.draw_picture(&mut encoder, viewer, &scene, &surface, target);
        if let Some(timer) = &self.timer {
            timer.resolve(&mut encoder);
        }
        self.queue.submit([encoder.finish()]);
        self.scene = Some(scene);
        self.surface = Some(surface);
        viewer.mark_drawn();
        Ok(())
    }

    /// Uploads what has been decoded since, without drawing it.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn upload(&mut self, viewer: &mut Viewer) -> Result<(), EngineError> {
        let mut encoder = self.encoder();
        let scene = self.prepare(&mut encoder, viewer)?;
        self.queue.submit([encoder.finish()]);
        self.scene = Some(scene);
        Ok(())
    }
}

impl Renderer {
    fn encoder(&self) -> wgpu::CommandEncoder {
        let label = Some("frame");
        self.device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label })
    }

    /// The scene of `viewer`, taken out, with everything that it was given since.
    fn prepare(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        viewer: &mut Viewer,
    ) -> Result<Scene, EngineError> {
        let known = self.scene.take();
        let mut scene = match known.filter(|scene| scene.viewer == viewer.id()) {
            Some(scene) => scene,
            None => Scene::new(&self.device, viewer)?,
        };
        scene.prepare(&self.device, &self.queue, encoder, viewer)?;
        Ok(scene)
    }

    fn draw_picture(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        viewer: &Viewer,
        scene: &Scene,
        surface: &Surface,
        target: &wgpu::TextureView,
    ) {
        let is_cut_open = viewer.options().section.is_some();
        let part = viewer.fading().map(|fading| fading.part);
        let by_alpha = viewer.options().transition == Transition::Alpha;
        let frame = viewer
            .frame()
            .unwrap_or(<Frame as bytemuck::Zeroable>::zeroed());
        self.grid.set_frame(&self.queue, Layer::Steady, &frame);
        let mut picture = Picture {
            target,
            layers: &[Layer::Steady],
            discards: is_cut_open,
            is_first: true,
            is_last: true,
        };
        let Some(part) = part else {
            self.draw_layers(encoder, viewer, scene, surface, &picture);
            return;
        };
        let masks = if by_alpha {
            [frame, frame]
        } else {
            [frame.masked(part, 2.0), frame.masked(-1.0, part)]
        };
        for (layer, frame) in [Layer::Leaving, Layer::Arriving].into_iter().zip(masks) {
            self.grid.set_frame(&self.queue, layer, &frame);
        }
        if !by_alpha {
            picture.layers = &[Layer::Steady, Layer::Leaving, Layer::Arriving];
            picture.discards = true;
            self.draw_layers(encoder, viewer, scene, surface, &picture);
            return;
        }
        let blend = match self
            .blend
            .take()
            .filter(|blend| blend.size() == surface.size)
        {
            Some(blend) => blend,
            None => BlendPass::new(&self.device, surface.size, self.format),
        };
        let old = Picture {
            layers: &[Layer::Steady, Layer::Leaving],
            is_last: false,
            ..picture
        };
        let new = Picture {
            target: blend.arriving(),
            layers: &[Layer::Steady, Layer::Arriving],
            is_first: false,
            ..picture
        };
        self.draw_layers(encoder, viewer, scene, surface, &old);
        self.draw_layers(encoder, viewer, scene, surface, &new);
        blend.mix(&self.device, encoder, target, part);
        self.blend = Some(blend);
    }

    fn draw_layers(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        viewer: &Viewer,
        scene: &Scene,
        surface: &Surface,
        picture: &Picture<'_>,
    ) {
        let background = clear_colour(viewer.options().background.0, self.format.is_srgb());
        let timer = self.timer.as_ref();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surface"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &surface.colour,
                depth_slice: None,
                resolve_target: Some(picture.target),
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
            timestamp_writes: timer
                .and_then(|timer| timer.writes(picture.is_first, picture.is_last)),
            ..Default::default()
        });
        let (textures, morphs) = (scene.textures.view(), scene.morphs.view());
        let bind = |layer, texels| {
            let (atlas, tiles) = (&scene.atlas, &scene.tiles);
            self.grid
                .bind(&self.device, layer, atlas, tiles, &morphs, texels)
        };
        for layer in picture.layers {
            let Some((list, clusters, first)) = Scene::layer(viewer, *layer) else {
                continue;
            };
            let samples = bind(*layer, None);
            self.grid.draw(
                &mut pass,
                &samples,
                &scene.instances,
                Drawing { list, first },
                viewer.options().shade,
                picture.discards,
            );
            pass.set_bind_group(0, &bind(*layer, Some(&textures)), &[]);
            self.cluster.draw(
                &self.grid,
                &mut pass,
                &scene.clusters,
                clusters,
                viewer.options().shade,
                picture.discards,
            );
        }
    }

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
            textures: ClusterTextures::new(device),
            morphs: ClusterMorphs::new(device),
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
        if self
            .textures
            .grow(device, encoder, viewer.cluster_texture_parts())
        {
            submit_before_uploads(device, queue, encoder);
        }
        for change in viewer.take_texture_changes() {
            self.textures.apply(queue, &self.clusters, &change);
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
        self.morphs.write(queue, &viewer.cluster_lists());
        let lists = viewer.draw_lists();
        let slices = lists.iter().map(|list| list.instances.as_slice());
        let instances: Vec<_> = slices.flatten().copied().collect();
        let bytes: &[u8] = bytemuck::cast_slice(&instances);
        let needed = u64::try_from(bytes.len()).unwrap_or(u64::MAX);
        if self.instances.size() < needed {
            self.instances = instance_buffer(device, needed.next_power_of_two());
        }
        queue.write_buffer(&self.instances, 0, bytes);
        Ok(())
    }

    /// The instances and the clusters of `layer`, and where the former start in the buffer.
    fn layer(viewer: &Viewer, layer: Layer) -> Option<(&DrawList, &ClusterList, u32)> {
        let index = match layer {
            Layer::Steady => 0,
            Layer::Leaving => 1,
            Layer::Arriving => 2,
        };
        let lists = viewer.draw_lists();
        let before = lists.iter().take(index).map(|list| list.instances.len());
        let first = u32::try_from(before.sum::<usize>()).ok()?;
        Some((
            *lists.get(index)?,
            *viewer.cluster_lists().get(index)?,
            first,
        ))
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

/// Layers to make an array texture of that needs `layers`.
///
/// With OpenGL wgpu takes one layer for a plain texture and every multiple of six for a cube, which cannot be bound as arrays.
fn array_layers(device: &wgpu::Device, layers: u32) -> u32 {
    if device.adapter_info().backend == wgpu::Backend::Gl {
        some_layers(layers)
    } else {
        layers
    }
}

/// The next number from `layers` on that is neither 1 nor a multiple of six.
fn some_layers(layers: u32) -> u32 {
    let several = layers.max(2);
    several + u32::from(several.is_multiple_of(6))
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
pub fn clear_colour(rgb: [u8; 3], is_srgb: bool) -> wgpu::Color {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_never_taken_for_a_plain_texture_or_a_cube() {
        assert_eq!(
            [1, 2, 5, 6, 7, 12, 252, 256].map(some_layers),
            [2, 2, 5, 7, 7, 13, 253, 256]
        );
    }
}
