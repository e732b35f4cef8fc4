//! Textures that headless pictures are drawn into, and the way back from them.

use crate::headless::FORMAT;
use crate::{Headless, NativeError, Picture};
use marquetry_engine::{Viewport, wgpu};

/// A texture of the viewport's size: `known`, if it has it.
///
/// # Errors
/// [`NativeError::Size`].
pub(crate) fn of_size(
    headless: &Headless,
    viewport: Viewport,
    known: Option<wgpu::Texture>,
) -> Result<wgpu::Texture, NativeError> {
    let most = headless.device().limits().max_texture_dimension_2d;
    let Viewport { width, height } = viewport;
    if width == 0 || height == 0 || width > most || height > most {
        return Err(NativeError::Size {
            width,
            height,
            most,
        });
    }
    if let Some(known) = known.filter(|t| t.width() == width && t.height() == height) {
        return Ok(known);
    }
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
    Ok(texture(headless, viewport, FORMAT, 1, usage))
}

/// A texture of one mip.
pub(crate) fn texture(
    headless: &Headless,
    Viewport { width, height }: Viewport,
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    headless.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// The picture in `target`, once the GPU is done with it.
///
/// # Errors
/// [`NativeError::ReadBack`].
pub(crate) fn read_back(
    headless: &Headless,
    target: &wgpu::Texture,
) -> Result<Picture, NativeError> {
    let failed = |reason: &str| NativeError::ReadBack(reason.to_owned());
    let (device, queue) = (headless.device(), headless.queue());
    let (width, height) = (target.width(), target.height());
    let row_bytes = 4 * width;
    let padded = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(padded),
        rows_per_image: Some(height),
    };
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout,
        },
        target.size(),
    );
    queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer
        .slice(..)
        .map_async(wgpu::MapMode::Read, move |result| {
            // The receiver waits below until this was sent.
            let _ = sender.send(result);
        });
    headless.wait()?;
    match receiver.recv() {
        Ok(Ok(())) => {}
        Ok(Err(error)) => return Err(NativeError::ReadBack(error.to_string())),
        Err(_) => return Err(failed("the device was lost")),
    }
    let mapped = buffer
        .slice(..)
        .get_mapped_range()
        .map_err(|error| NativeError::ReadBack(error.to_string()))?;
    let rows = usize::try_from(padded)
        .ok()
        .zip(usize::try_from(row_bytes).ok());
    let (padded, row_bytes) = rows.ok_or_else(|| failed("the picture is too large"))?;
    let mut rgba = Vec::with_capacity(mapped.len());
    for row in mapped.chunks_exact(padded) {
        rgba.extend_from_slice(row.get(..row_bytes).unwrap_or(row));
    }
    Ok(Picture {
        width,
        height,
        rgba,
    })
}
