//! Textures of plain meshes, with all mips.

use crate::Headless;
use marquetry_engine::wgpu;

/// What happens to texture coordinates outside 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every second time mirrored.
    Mirror,
    /// The outermost texel.
    Clamp,
}

/// An image, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshTexture {
    /// Texels a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Row by row from the upper left, `width * height` of them.
    pub texels: Vec<[u8; 3]>,
    /// Along u and v.
    pub wrap: [Wrap; 2],
}

impl MeshTexture {
    /// What a part without a texture has: nothing is there to be seen of it.
    pub(super) const WHITE: Self = Self {
        width: 1,
        height: 1,
        texels: Vec::new(),
        wrap: [Wrap::Clamp; 2],
    };
}

/// A texture on the device, ready to be bound.
#[derive(Debug)]
pub(super) struct BoundTexture {
    binding: wgpu::BindGroup,
}

impl BoundTexture {
    /// Uploads `texture`. What is larger than the device can hold is halved until it is not.
    pub(super) fn new(
        headless: &Headless,
        layout: &wgpu::BindGroupLayout,
        texture: &MeshTexture,
    ) -> Self {
        let device = headless.device();
        let most = device.limits().max_texture_dimension_2d;
        let mut mips = mips(texture);
        mips.retain(|mip| mip.width.max(mip.height) <= most);
        let size = |mip: &Mip| wgpu::Extent3d {
            width: mip.width,
            height: mip.height,
            depth_or_array_layers: 1,
        };
        let uploaded = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("mesh texture"),
            size: mips.first().map(size).unwrap_or_default(),
            mip_level_count: u32::try_from(mips.len()).unwrap_or(1),
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (mip_level, mip) in (0..).zip(&mips) {
            headless.queue().write_texture(
                wgpu::TexelCopyTextureInfo {
                    mip_level,
                    ..uploaded.as_image_copy()
                },
                &mip.rgba,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * mip.width),
                    rows_per_image: Some(mip.height),
                },
                size(mip),
            );
        }
        // Else the queue keeps a copy of all textures until the first frame.
        headless.queue().submit([]);
        let address = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => wgpu::AddressMode::Repeat,
            Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
            Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("mesh texture"),
            address_mode_u: address[0],
            address_mode_v: address[1],
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            anisotropy_clamp: 16,
            ..Default::default()
        });
        let view = uploaded.create_view(&wgpu::TextureViewDescriptor::default());
        let binding = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("mesh texture"),
            layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::Sampler(&sampler),
                },
            ],
        });
        Self { binding }
    }

    pub(super) fn binding(&self) -> &wgpu::BindGroup {
        &self.binding
    }
}

/// Where a texture and its sampler are bound.
pub(super) fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty,
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("mesh texture"),
        entries: &[
            entry(
                0,
                wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: true },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
            ),
            entry(
                1,
                wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            ),
        ],
    })
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Mip {
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

/// The image and its halves down to one texel. A texel is the mean, in linear light, of those it stands for.
fn mips(texture: &MeshTexture) -> Vec<Mip> {
    let (width, height) = (texture.width.max(1), texture.height.max(1));
    let count = width as usize * height as usize;
    let mut rgba: Vec<u8> = texture
        .texels
        .iter()
        .take(count)
        .flat_map(|&[r, g, b]| [r, g, b, 255])
        .collect();
    rgba.resize(4 * count, 255);
    let light = Light::new();
    let mut mips = vec![Mip {
        width,
        height,
        rgba,
    }];
    while let Some(last) = mips.last().filter(|mip| mip.width.max(mip.height) > 1) {
        mips.push(halved(last, &light));
    }
    mips
}

/// Half as many texels each way, rounded down but at least 1. Odd sizes: the last row or column counts for the texel before it.
fn halved(mip: &Mip, light: &Light) -> Mip {
    let (width, height) = ((mip.width / 2).max(1), (mip.height / 2).max(1));
    // The texels of a line that texel `place` of half a line stands for.
    let from = |place: u32, halves: u32, whole: u32| {
        let end = if place + 1 == halves {
            whole
        } else {
            2 * place + 2
        };
        2 * place..end
    };
    let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            let mut count = 0.0;
            for row in from(y, height, mip.height) {
                for column in from(x, width, mip.width) {
                    let texel = 4 * (row as usize * mip.width as usize + column as usize);
                    for (sum, byte) in sum.iter_mut().zip(&mip.rgba[texel..texel + 3]) {
                        *sum += light.linear[usize::from(*byte)];
                    }
                    count += 1.0;
                }
            }
            rgba.extend(sum.map(|sum: f32| light.srgb(sum / count)));
            rgba.push(255);
        }
    }
    Mip {
        width,
        height,
        rgba,
    }
}

/// sRGB bytes and linear light.
struct Light {
    linear: Vec<f32>,
}

impl Light {
    fn new() -> Self {
        let linear = (0..=255_u8).map(|byte| {
            let value = f32::from(byte) / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            }
        });
        Self {
            linear: linear.collect(),
        }
    }

    /// The byte nearest to `value`.
    fn srgb(&self, value: f32) -> u8 {
        let above = self.linear.partition_point(|&known| known < value).min(255);
        let below = above.saturating_sub(1);
        let nearest = if value - self.linear[below] < self.linear[above] - value {
            below
        } else {
            above
        };
        u8::try_from(nearest).unwrap_or(u8::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mips_end_at_one_texel_and_average_light() {
        let texture = MeshTexture {
            width: 3,
            height: 2,
            texels: [[0; 3], [255; 3], [255; 3], [255; 3], [0; 3], [255; 3]].to_vec(),
            wrap: [Wrap::Repeat; 2],
        };
        let mips = mips(&texture);
        let sizes: Vec<_> = mips.iter().map(|mip| (mip.width, mip.height)).collect();
        assert_eq!(sizes, [(3, 2), (1, 1)]);
        // Two thirds of the light is 213 in sRGB.
        assert_eq!(mips[1].rgba, [213, 213, 213, 255]);
    }

    #[test]
    fn every_byte_is_its_own_light() {
        let light = Light::new();
        for byte in 0..=255_u8 {
            assert_eq!(light.srgb(light.linear[usize::from(byte)]), byte);
        }
        assert_eq!((light.srgb(-1.0), light.srgb(2.0)), (0, 255));
    }

    #[test]
    fn missing_texels_are_white() {
        assert_eq!(mips(&MeshTexture::WHITE)[0].rgba, [255; 4]);
    }
}
