//! The textures that hold the samples of resident pages.

use super::array_layers;
use crate::EngineError;
use crate::residency::upload::{LAYER_SIZE, MAX_LAYERS, Slot, Upload};

/// Position, normal and colour texels, each a 2D array of the same layers.
#[derive(Debug)]
pub struct AtlasTextures {
    positions: wgpu::Texture,
    normals: wgpu::Texture,
    /// One texel where the file has no colours.
    colours: wgpu::Texture,
    layers: u32,
    has_colours: bool,
}

impl AtlasTextures {
    /// Textures of at least `layers` layers.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn new(device: &wgpu::Device, layers: u32, has_colours: bool) -> Result<Self, EngineError> {
        let available = device.limits().max_texture_array_layers.min(MAX_LAYERS);
        if layers > available {
            return Err(EngineError::DeviceTooSmall {
                needed: layers,
                available,
            });
        }
        let texture = |label, format, size, layers| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width: size,
                    height: size,
                    depth_or_array_layers: array_layers(device, layers),
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_DST
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let (colour_size, colour_layers) = if has_colours {
            (LAYER_SIZE, layers)
        } else {
            (1, 1)
        };
        Ok(Self {
            positions: texture(
                "positions",
                wgpu::TextureFormat::Rgba32Uint,
                LAYER_SIZE,
                layers,
            ),
            normals: texture("normals", wgpu::TextureFormat::R32Uint, LAYER_SIZE, layers),
            colours: texture(
                "colours",
                wgpu::TextureFormat::Rg32Uint,
                colour_size,
                colour_layers,
            ),
            layers,
            has_colours,
        })
    }

    /// Larger textures with the same content, once `encoder`'s commands have run; `None` while these do.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn grown(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        layers: u32,
    ) -> Result<Option<Self>, EngineError> {
        if layers <= self.layers {
            return Ok(None);
        }
        let available = device.limits().max_texture_array_layers.min(MAX_LAYERS);
        let doubled = layers.max(2 * self.layers).min(available.max(layers));
        let larger = Self::new(device, doubled, self.has_colours)?;
        let copies = [
            (&self.positions, &larger.positions),
            (&self.normals, &larger.normals),
            (&self.colours, &larger.colours),
        ];
        for (from, to) in copies {
            encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
        }
        Ok(Some(larger))
    }

    /// Writes one page to its slot.
    pub fn write(&self, queue: &wgpu::Queue, upload: &Upload) {
        write(
            queue,
            &self.positions,
            upload.slot,
            bytemuck::cast_slice(&upload.positions),
        );
        write(
            queue,
            &self.normals,
            upload.slot,
            bytemuck::cast_slice(&upload.normals),
        );
        if self.has_colours {
            write(
                queue,
                &self.colours,
                upload.slot,
                bytemuck::cast_slice(&upload.colours),
            );
        }
    }

    /// Views for binding, in binding order.
    pub fn views(&self) -> [wgpu::TextureView; 3] {
        [&self.positions, &self.normals, &self.colours].map(|texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            })
        })
    }
}

fn write(queue: &wgpu::Queue, texture: &wgpu::Texture, slot: Slot, bytes: &[u8]) {
    let side = slot.side();
    let Some(row_bytes) = u32::try_from(bytes.len())
        .ok()
        .and_then(|len| len.checked_div(side))
        .filter(|n| *n > 0)
    else {
        return;
    };
    queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d {
                x: slot.x,
                y: slot.y,
                z: slot.layer,
            },
            aspect: wgpu::TextureAspect::All,
        },
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_bytes),
            rows_per_image: Some(side),
        },
        wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: 1,
        },
    );
}
