//! Pictures without a window.

use crate::loader::Loader;
use crate::{NativeError, Picture, target};
use marquetry_engine::{Camera, Renderer, Viewer, ViewerOptions, Viewport, wgpu};
use marquetry_format::{ByteSource, Document, Limits};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Format of all headless pictures.
pub(crate) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Time of the model, seconds, between two updates while a view settles. Not time on the clock.
const SETTLE_STEP: f64 = 0.1;
/// Failed fetches of one view after which it is given up.
const FAILURES: u64 = 12;
/// Longest wait for an answer before looking again, so that nothing hangs silently.
const PATIENCE: Duration = Duration::from_millis(200);

/// A graphics device without a window. Made once, used for any number of [`Session`]s.
#[derive(Debug, Clone)]
pub struct Headless {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    is_software: bool,
}

impl Headless {
    /// Finds an adapter: a real one if there is any, else one in software.
    ///
    /// # Errors
    /// [`NativeError::NoAdapter`], [`NativeError::NoDevice`].
    pub fn new() -> Result<Self, NativeError> {
        let adapter = find_adapter(wgpu::Backends::PRIMARY)
            .or_else(|_| find_adapter(wgpu::Backends::all()))?;
        let (device, queue) = device_of(&adapter)?;
        Ok(Self {
            device,
            queue,
            adapter: adapter_name(&adapter),
            is_software: adapter.get_info().device_type == wgpu::DeviceType::Cpu,
        })
    }

    /// Name of the adapter, with its driver.
    pub fn adapter(&self) -> &str {
        &self.adapter
    }

    /// The device, for measurements and tests of their own.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The device's queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Whether the adapter is a program on the processor: its times say nothing of a graphics card's.
    pub fn is_software(&self) -> bool {
        self.is_software
    }

    /// Waits until the GPU has done all that it was given.
    ///
    /// # Errors
    /// [`NativeError::ReadBack`] when the device is lost.
    pub fn wait(&self) -> Result<(), NativeError> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map(|_| ())
            .map_err(|error| NativeError::ReadBack(error.to_string()))
    }

    /// Opens a file to be looked at, with an empty cache.
    ///
    /// # Errors
    /// When the file cannot be opened or shown, or an option is outside its range.
    pub fn session(
        &self,
        source: &Arc<dyn ByteSource>,
        options: ViewerOptions,
    ) -> Result<Session, NativeError> {
        let document = Document::open(source.as_ref(), Limits::default())?;
        Ok(Session {
            viewer: Viewer::new(document, options)?,
            renderer: Renderer::new(&self.device, &self.queue, FORMAT),
            loader: Loader::new(source, || ()),
            headless: self.clone(),
            target: None,
        })
    }
}

/// The best adapter of `backends`, or of those that the environment variable `WGPU_BACKEND` names.
fn find_adapter(backends: wgpu::Backends) -> Result<wgpu::Adapter, NativeError> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::from_env().unwrap_or(backends),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let options = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    pollster::block_on(instance.request_adapter(&options))
        .map_err(|error| NativeError::NoAdapter(error.to_string()))
}

/// A device of `adapter`, with what the engine needs.
pub(crate) fn device_of(
    adapter: &wgpu::Adapter,
) -> Result<(wgpu::Device, wgpu::Queue), NativeError> {
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("marquetry"),
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        required_limits: Renderer::limits(adapter),
        ..Default::default()
    };
    pollster::block_on(adapter.request_device(&descriptor)).map_err(|cause| NativeError::NoDevice {
        adapter: adapter_name(adapter),
        cause,
    })
}

fn adapter_name(adapter: &wgpu::Adapter) -> String {
    let info = adapter.get_info();
    let driver = if info.driver_info.is_empty() {
        info.driver
    } else {
        info.driver_info
    };
    if driver.is_empty() {
        info.name
    } else {
        format!("{} ({driver})", info.name)
    }
}

/// A file being looked at without a window.
#[derive(Debug)]
pub struct Session {
    viewer: Viewer,
    renderer: Renderer,
    loader: Loader,
    headless: Headless,
    target: Option<wgpu::Texture>,
}

impl Session {
    /// The viewer, for its camera, options, filter and statistics.
    pub fn viewer(&mut self) -> &mut Viewer {
        &mut self.viewer
    }

    /// Looks from `camera` until nothing more comes that would change the picture.
    ///
    /// # Errors
    /// [`NativeError::Incomplete`] when pages cannot be fetched, with the reasons.
    pub fn settle(&mut self, camera: Camera, viewport: Viewport) -> Result<(), NativeError> {
        self.viewer.set_camera(camera);
        let before = self.viewer.stats().failures;
        loop {
            self.step(SETTLE_STEP, viewport, PATIENCE);
            if self.viewer.is_settled() {
                return Ok(());
            }
            let stats = self.viewer.stats();
            if stats.failures.saturating_sub(before) >= FAILURES {
                let mut reasons = self.viewer.take_failures();
                reasons.dedup();
                return Err(NativeError::Incomplete {
                    missing: stats.pages.missing,
                    reasons,
                });
            }
        }
    }

    /// Advances by `seconds` and takes what has been read by then; waits for it up to `patience` where there is nothing else to do.
    pub fn step(&mut self, seconds: f64, viewport: Viewport, patience: Duration) {
        let requests = self.viewer.update(seconds, viewport);
        self.loader.ask(requests);
        let idle = self.loader.in_flight() > 0 && !self.viewer.is_settled();
        self.loader.deliver(
            &mut self.viewer,
            if idle { patience } else { Duration::ZERO },
        );
    }

    /// Draws what the viewer shows now, and waits until the GPU is done. The time until it had its commands.
    ///
    /// # Errors
    /// [`NativeError::Size`], or when the GPU fails.
    pub fn draw(&mut self, viewport: Viewport) -> Result<Duration, NativeError> {
        let start = Instant::now();
        let target = target::of_size(&self.headless, viewport, self.target.take())?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        self.renderer.render(&mut self.viewer, &view)?;
        self.target = Some(target);
        let submitted = start.elapsed();
        self.headless.wait()?;
        Ok(submitted)
    }

    /// Milliseconds that the GPU took for what was drawn last; `None` where that cannot be measured.
    pub fn gpu_ms(&self) -> Option<f64> {
        self.renderer.timer()?.wait_ms(&self.headless.device)
    }

    /// The picture that was drawn last.
    ///
    /// # Errors
    /// [`NativeError::ReadBack`].
    pub fn read_back(&self) -> Result<Picture, NativeError> {
        let target = self
            .target
            .as_ref()
            .ok_or_else(|| NativeError::ReadBack("nothing was drawn".to_owned()))?;
        target::read_back(&self.headless, target)
    }

    /// Settles, draws and reads back.
    ///
    /// # Errors
    /// Those of [`Session::settle`], [`Session::draw`] and [`Session::read_back`].
    pub fn picture(&mut self, camera: Camera, viewport: Viewport) -> Result<Picture, NativeError> {
        self.settle(camera, viewport)?;
        self.draw(viewport)?;
        self.read_back()
    }
}
