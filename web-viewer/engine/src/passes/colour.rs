//! The texture of colour tiles, and the map of what each place shows.

use super::array_layers;
use crate::EngineError;
use crate::colour::map::{ROW_ENTRIES, TileMap};
use crate::colour::slots::{LAYER_SIZE, MAX_LAYERS, MIPS};
use crate::colour::upload::{Mip, TileUpload};

/// Textures of the tiles of one viewer; tiny ones where the file has none.
#[derive(Debug)]
pub struct TileTextures {
    texels: wgpu::Texture,
    map: wgpu::Texture,
    sampler: wgpu::Sampler,
    layers: u32,
}

impl TileTextures {
    /// Without any tile yet.
    pub fn new(device: &wgpu::Device) -> Self {
        Self {
            texels: texel_texture(device, 1, 1),
            map: map_texture(device, 1),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("tiles"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
            layers: 0,
        }
    }

    /// The binding types of texels, sampler and map, from `first` on.
    pub fn layout(first: u32) -> [wgpu::BindGroupLayoutEntry; 3] {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let texture = |filterable, view_dimension| wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable },
            view_dimension,
            multisampled: false,
        };
        [
            entry(first, texture(true, wgpu::TextureViewDimension::D2Array)),
            entry(
                first + 1,
                wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            ),
            entry(first + 2, texture(false, wgpu::TextureViewDimension::D2)),
        ]
    }

    /// Views of texels and map.
    pub fn views(&self) -> [wgpu::TextureView; 2] {
        let view = |texture: &wgpu::Texture, dimension| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(dimension),
                ..Default::default()
            })
        };
        [
            view(&self.texels, wgpu::TextureViewDimension::D2Array),
            view(&self.map, wgpu::TextureViewDimension::D2),
        ]
    }

    /// The sampler.
    pub fn sampler(&self) -> &wgpu::Sampler {
        &self.sampler
    }

    /// Makes room for `layers`, keeping what is there; whether commands were added that have to run before uploads.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn grow(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        layers: u32,
    ) -> Result<bool, EngineError> {
        if layers <= self.layers {
            return Ok(false);
        }
        let available = device.limits().max_texture_array_layers.min(MAX_LAYERS);
        if layers > available {
            return Err(EngineError::DeviceTooSmall {
                needed: layers,
                available,
            });
        }
        // By half: a doubled texture of a large cache would be a large waste.
        let wanted = layers.max(self.layers + self.layers / 2).min(available);
        let larger = texel_texture(device, LAYER_SIZE, wanted);
        let had = self.layers;
        if had > 0 {
            copy_layers(encoder, &self.texels, &larger, had);
        }
        (self.texels, self.layers) = (larger, wanted);
        Ok(had > 0)
    }

    /// Writes one tile to its slot.
    pub fn write(&self, queue: &wgpu::Queue, upload: &TileUpload) {
        let slot = upload.slot;
        let corner = [slot.x, slot.y, slot.layer];
        write_mips(queue, &self.texels, corner, &upload.mips);
    }

    /// Writes the map of a picture.
    pub fn write_map(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, map: &TileMap) {
        let count = u32::try_from(map.entries.len()).unwrap_or(u32::MAX);
        let rows = count.div_ceil(ROW_ENTRIES);
        if rows == 0 {
            return;
        }
        if self.map.height() < rows {
            let most = device.limits().max_texture_dimension_2d;
            self.map = map_texture(device, rows.next_power_of_two().min(most));
        }
        // What does not fit is not shown: its entries read as zeros, that is as the samples' colours.
        let rows = rows.min(self.map.height());
        let mut entries = map.entries.clone();
        let whole = usize::try_from(rows * ROW_ENTRIES).unwrap_or(usize::MAX);
        entries.resize(whole, [0.0; 8]);
        queue.write_texture(
            self.map.as_image_copy(),
            bytemuck::cast_slice(&entries),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(ROW_ENTRIES * 32),
                rows_per_image: Some(rows),
            },
            wgpu::Extent3d {
                width: 2 * ROW_ENTRIES,
                height: rows,
                depth_or_array_layers: 1,
            },
        );
    }
}

/// Copies all mips of the first `layers` layers.
pub(super) fn copy_layers(
    encoder: &mut wgpu::CommandEncoder,
    from: &wgpu::Texture,
    to: &wgpu::Texture,
    layers: u32,
) {
    for mip_level in 0..MIPS {
        let place = |texture| wgpu::TexelCopyTextureInfo {
            texture,
            mip_level,
            origin: wgpu::Origin3d::ZERO,
            aspect: wgpu::TextureAspect::All,
        };
        let size = wgpu::Extent3d {
            width: from.width() >> mip_level,
            height: from.height() >> mip_level,
            depth_or_array_layers: layers,
        };
        encoder.copy_texture_to_texture(place(from), place(to), size);
    }
}

/// Writes an image with its mips at a column, row and layer.
pub(super) fn write_mips(
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    [x, y, layer]: [u32; 3],
    mips: &[Mip],
) {
    for (mip_level, mip) in (0u32..).zip(mips) {
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level,
                origin: wgpu::Origin3d {
                    x: x >> mip_level,
                    y: y >> mip_level,
                    z: layer,
                },
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(&mip.rgba),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * mip.width),
                rows_per_image: Some(mip.height),
            },
            wgpu::Extent3d {
                width: mip.width,
                height: mip.height,
                depth_or_array_layers: 1,
            },
        );
    }
}

/// Layers of texels with their mips.
pub(super) fn texel_texture(device: &wgpu::Device, side: u32, layers: u32) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("tiles"),
        size: wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: array_layers(device, layers),
        },
        mip_level_count: if side > 1 { MIPS } else { 1 },
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn map_texture(device: &wgpu::Device, rows: u32) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("tile map"),
        size: wgpu::Extent3d {
            width: 2 * ROW_ENTRIES,
            height: rows,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}
