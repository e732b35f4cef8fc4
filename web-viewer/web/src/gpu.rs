//! A canvas and its GPU.
//!
//! With WebGPU pictures are drawn to a texture of our own, in sRGB, and copied to the canvas. A canvas' texture cannot be sRGB,
//! only views of it can, and software WebGPU (`SwiftShader`) forgets the encoding when it resolves samples into such a
//! view. The copy costs next to nothing and is right everywhere. With WebGL 2 wgpu does the same by itself.

use marquetry_engine::Renderer;
use marquetry_engine::wgpu;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

/// Whether this bundle draws with WebGL 2 instead of WebGPU.
const IS_WEBGL: bool = cfg!(feature = "webgl2");

/// A canvas that can be drawn to.
#[wasm_bindgen]
#[derive(Debug, Clone)]
pub struct Gpu {
    pub(crate) context: Rc<Context>,
}

#[derive(Debug)]
pub(crate) struct Context {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Name of the adapter, as far as the browser tells.
    pub(crate) adapter: String,
    /// Format that is drawn in: the canvas' own, as sRGB.
    pub(crate) format: wgpu::TextureFormat,
    /// What is drawn to; made for the canvas' size.
    picture: RefCell<Option<wgpu::Texture>>,
    surface: wgpu::Surface<'static>,
    surface_format: wgpu::TextureFormat,
    /// The first error that nobody caught, a lost device included.
    fault: Arc<OnceLock<String>>,
    /// Whether the device is gone, and not by our doing.
    lost: Arc<AtomicBool>,
    /// Whether we let go of it ourselves.
    closed: Arc<AtomicBool>,
}

impl Drop for Context {
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
    }
}

#[wasm_bindgen]
impl Gpu {
    /// Asks the browser for a device that draws to `canvas`.
    ///
    /// # Errors
    /// When there is no adapter or no device, in words for the user.
    pub async fn open(canvas: HtmlCanvasElement) -> Result<Gpu, JsError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: if IS_WEBGL {
                wgpu::Backends::GL
            } else {
                wgpu::Backends::BROWSER_WEBGPU
            },
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let surface = instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas))?;
        let adapter = instance
            .request_adapter(&wgpu::RequestAdapterOptions {
                power_preference: wgpu::PowerPreference::HighPerformance,
                compatible_surface: Some(&surface),
                ..wgpu::RequestAdapterOptions::default()
            })
            .await
            .map_err(|error| {
                JsError::new(&format!("the browser offers no graphics adapter ({error})"))
            })?;
        let (device, queue) = adapter
            .request_device(&wgpu::DeviceDescriptor {
                label: Some("marquetry"),
                required_limits: Renderer::limits(&adapter),
                ..wgpu::DeviceDescriptor::default()
            })
            .await
            .map_err(|error| {
                JsError::new(&format!("the graphics adapter gives no device ({error})"))
            })?;
        let fault = Arc::new(OnceLock::new());
        let (lost, closed) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicBool::new(false)),
        );
        let (told, is_lost, is_closed) =
            (Arc::clone(&fault), Arc::clone(&lost), Arc::clone(&closed));
        device.set_device_lost_callback(move |_, message| {
            // When a viewer leaves the page its device goes with it.
            if !is_closed.load(Ordering::Relaxed) {
                is_lost.store(true, Ordering::Relaxed);
                let _ = told.set(format!("the graphics device was lost: {message}"));
            }
        });
        let uncaught = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let _ = uncaught.set(format!("the graphics device reports: {error}"));
        }));
        let surface_format = *surface
            .get_capabilities(&adapter)
            .formats
            .first()
            .ok_or_else(|| JsError::new("the canvas cannot be drawn to"))?;
        let api = if IS_WEBGL { "WebGL 2" } else { "WebGPU" };
        let name = adapter.get_info().name;
        let adapter = match name.as_str() {
            "" => api.to_owned(),
            name if IS_WEBGL => format!("{name} ({api})"),
            _ => name,
        };
        let format = surface_format.add_srgb_suffix();
        Ok(Self {
            context: Rc::new(Context {
                device,
                queue,
                adapter,
                format,
                picture: RefCell::new(None),
                surface,
                surface_format,
                fault,
                lost,
                closed,
            }),
        })
    }

    /// The browser has taken the context of WebGL away. (WebGPU tells that by itself.)
    pub fn lose(&self) {
        self.context.lost.store(true, Ordering::Relaxed);
        let message = "the graphics device was lost: the browser took it away";
        let _ = self.context.fault.set(message.to_owned());
    }

    /// Longest side of a picture, pixels.
    #[wasm_bindgen(getter, js_name = maxSize)]
    pub fn max_size(&self) -> u32 {
        self.context.device.limits().max_texture_dimension_2d
    }
}

impl Context {
    /// What went wrong behind our back, if anything did.
    pub(crate) fn fault(&self) -> Option<&str> {
        self.fault.get().map(String::as_str)
    }

    /// Whether the device is gone, so that only a new one helps.
    pub(crate) fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// Makes the canvas' pictures `width` × `height` pixels.
    pub(crate) fn configure(&self, width: u32, height: u32) {
        self.surface.configure(
            &self.device,
            &wgpu::SurfaceConfiguration {
                usage: if IS_WEBGL {
                    wgpu::TextureUsages::RENDER_ATTACHMENT
                } else {
                    wgpu::TextureUsages::COPY_DST
                },
                format: if IS_WEBGL {
                    self.format
                } else {
                    self.surface_format
                },
                color_space: wgpu::SurfaceColorSpace::default(),
                width,
                height,
                present_mode: wgpu::PresentMode::Fifo,
                desired_maximum_frame_latency: 2,
                alpha_mode: wgpu::CompositeAlphaMode::Opaque,
                view_formats: Vec::new(),
            },
        );
        if IS_WEBGL {
            return;
        }
        let picture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        self.picture.replace(Some(picture));
    }

    /// Shows what `draw` draws; false when the canvas takes no picture just now.
    ///
    /// # Errors
    /// Those of `draw`.
    pub(crate) fn show<E>(
        &self,
        draw: impl FnOnce(&wgpu::TextureView) -> Result<(), E>,
    ) -> Result<bool, E> {
        use wgpu::CurrentSurfaceTexture::{Suboptimal, Success};
        let view =
            |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        if IS_WEBGL {
            let (Success(canvas) | Suboptimal(canvas)) = self.surface.get_current_texture() else {
                return Ok(false);
            };
            draw(&view(&canvas.texture))?;
            self.queue.present(canvas);
            return Ok(true);
        }
        let picture = self.picture.borrow();
        let Some(picture) = picture.as_ref() else {
            return Ok(false);
        };
        draw(&view(picture))?;
        let (Success(canvas) | Suboptimal(canvas)) = self.surface.get_current_texture() else {
            return Ok(false);
        };
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_texture(
            picture.as_image_copy(),
            canvas.texture.as_image_copy(),
            picture.size(),
        );
        self.queue.submit([encoder.finish()]);
        self.queue.present(canvas);
        Ok(true)
    }
}
