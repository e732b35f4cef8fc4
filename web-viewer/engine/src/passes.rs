//! Drawing with wgpu.

use crate::{EngineError, Viewer};

/// Draws a [`Viewer`] on one device. 4× multisampled; depth is reversed, 32-bit float.
#[derive(Debug)]
pub struct Renderer {}

impl Renderer {
    /// Limits to ask a device for: WebGPU's defaults (or the WebGL2 ones where the adapter has no more), with the
    /// adapter's texture limits.
    pub fn limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
        let _ = adapter;
        unimplemented!()
    }

    /// Makes the pipelines. `format` is that of the views given to [`Renderer::render`]; it should be an sRGB format
    /// (`surface_format.add_srgb_suffix()`, listed in the surface's `view_formats`): others show too dark.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, format: wgpu::TextureFormat) -> Self {
        let _ = (device, queue, format);
        unimplemented!()
    }

    /// Uploads what has been decoded since and draws the viewer's present state to `target`, whose size is the viewer's viewport.
    ///
    /// # Errors
    /// [`EngineError::DeviceTooSmall`].
    pub fn render(&mut self, viewer: &mut Viewer, target: &wgpu::TextureView) -> Result<(), EngineError> {
        let _ = (viewer, target);
        unimplemented!()
    }
}
