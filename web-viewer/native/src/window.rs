//! `marquetry view`: a window with the same controls as the page.

use crate::NativeError;
use crate::clicks::Clicks;
use crate::decoders::Decoders;
use crate::headless::device_of;
use crate::loader::Loader;
use marquetry_engine::{
    InputEvent, Key, Modifiers, PointerButton, PointerKind, Renderer, Viewer, ViewerOptions,
    Viewport, wgpu,
};
use marquetry_format::{ByteSource, Document, Limits};
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::{
    ElementState, MouseButton, MouseScrollDelta, StartCause, TouchPhase, WindowEvent,
};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{Key as LogicalKey, ModifiersState};
use winit::window::{Window, WindowId};

/// Pointer id of the mouse; fingers count from 1.
const MOUSE: u64 = 0;
/// Pixels of a trackpad's scroll that count as one notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 100.0;
/// How often to look again while only a retry or a rest is waited for.
const IDLE_TICK: Duration = Duration::from_millis(50);

/// Shows the file in `source` until the window is closed.
///
/// # Errors
/// When the file cannot be opened or shown, or there is no display or adapter.
pub fn view(source: &Arc<dyn ByteSource>, options: ViewerOptions) -> Result<(), NativeError> {
    let document = Document::open(source.as_ref(), Limits::default())?;
    let title = format!("{} – Marquetry", document.metadata.source_name);
    let mut viewer = Viewer::new(document, options)?;
    let window_error = |error: &dyn std::fmt::Display| NativeError::Window(error.to_string());
    let events = EventLoop::<Wake>::with_user_event()
        .build()
        .map_err(|error| window_error(&error))?;
    let proxy: EventLoopProxy<Wake> = events.create_proxy();
    let wake = move || {
        // Fails only when the window is gone, and then nobody waits.
        let _ = proxy.send_event(Wake);
    };
    let loader = Loader::new(source, wake.clone());
    let decoders = Decoders::new(wake);
    decoders.adopt(&mut viewer);
    let mut app = App {
        title,
        viewer,
        loader,
        decoders,
        shown: None,
        failure: None,
        cursor: [0.0; 2],
        clicks: Clicks::default(),
        modifiers: ModifiersState::empty(),
        last_update: Instant::now(),
    };
    events
        .run_app(&mut app)
        .map_err(|error| window_error(&error))?;
    app.failure.map_or(Ok(()), Err)
}

/// Something was read or decoded.
#[derive(Debug, Clone, Copy)]
struct Wake;

#[derive(Debug)]
struct App {
    title: String,
    viewer: Viewer,
    loader: Loader,
    decoders: Decoders,
    shown: Option<Shown>,
    failure: Option<NativeError>,
    cursor: [f64; 2],
    clicks: Clicks,
    modifiers: ModifiersState,
    last_update: Instant,
}

#[derive(Debug)]
struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    renderer: Renderer,
    view_format: wgpu::TextureFormat,
}

impl Shown {
    fn new(events: &ActiveEventLoop, title: &str) -> Result<Self, NativeError> {
        let attributes = Window::default_attributes()
            .with_title(title)
            .with_inner_size(LogicalSize::new(1280, 720));
        let window = events
            .create_window(attributes)
            .map_err(|error| NativeError::Window(error.to_string()))?;
        let window = Arc::new(window);
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(
                Box::new(events.owned_display_handle()),
            ));
        let surface = instance
            .create_surface(Arc::clone(&window))
            .map_err(|error| NativeError::Window(error.to_string()))?;
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|error| NativeError::NoAdapter(error.to_string()))?;
        let (device, queue) = device_of(&adapter)?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| {
                NativeError::Window("the adapter cannot draw to this window".to_owned())
            })?;
        let view_format = config.format.add_srgb_suffix();
        if view_format != config.format {
            config.view_formats.push(view_format);
        }
        surface.configure(&device, &config);
        let renderer = Renderer::new(&device, &queue, view_format);
        Ok(Self {
            window,
            surface,
            config,
            device,
            queue,
            renderer,
            view_format,
        })
    }

    fn viewport(&self) -> Viewport {
        Viewport::new(self.config.width, self.config.height)
    }

    fn resize(&mut self, width: u32, height: u32) {
        let most = self.device.limits().max_texture_dimension_2d;
        self.config.width = width.clamp(1, most);
        self.config.height = height.clamp(1, most);
        self.surface.configure(&self.device, &self.config);
    }

    fn draw(&mut self, viewer: &mut Viewer) -> Result<(), NativeError> {
        use wgpu::CurrentSurfaceTexture as Current;
        let frame = match self.surface.get_current_texture() {
            Current::Success(frame) | Current::Suboptimal(frame) => frame,
            Current::Outdated | Current::Lost => {
                self.surface.configure(&self.device, &self.config);
                self.window.request_redraw();
                return Ok(());
            }
            // Hidden, or the system is busy: the next redraw tries again.
            _ => return Ok(()),
        };
        let view = frame.texture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(self.view_format),
            ..Default::default()
        });
        self.renderer.render(viewer, &view)?;
        self.window.pre_present_notify();
        self.queue.present(frame);
        Ok(())
    }
}

impl App {
    fn fail(&mut self, events: &ActiveEventLoop, failure: NativeError) {
        self.failure.get_or_insert(failure);
        events.exit();
    }

    fn input(&mut self, event: InputEvent) {
        if self.viewer.handle(event)
            && let Some(shown) = &self.shown
        {
            shown.window.request_redraw();
        }
    }

    fn keys(&self) -> Modifiers {
        Modifiers {
            shift: self.modifiers.shift_key(),
            control: self.modifiers.control_key() || self.modifiers.super_key(),
            alt: self.modifiers.alt_key(),
        }
    }

    fn redraw(&mut self, events: &ActiveEventLoop) {
        let Some(shown) = &mut self.shown else { return };
        let now = Instant::now();
        let seconds = now.duration_since(self.last_update).as_secs_f64();
        self.last_update = now;
        self.loader.deliver(&mut self.viewer, Duration::ZERO);
        self.decoders.collect(&mut self.viewer);
        let requests = self.viewer.update(seconds, shown.viewport());
        self.loader.ask(requests);
        self.decoders.feed(&mut self.viewer);
        for failure in self.viewer.take_failures() {
            // The picture stays, coarser: this is for whoever started the program.
            eprintln!("marquetry: {failure}; trying again");
        }
        if self.viewer.needs_redraw()
            && let Err(failure) = shown.draw(&mut self.viewer)
        {
            self.fail(events, failure);
        }
    }

    fn pointer(&mut self, button: MouseButton, state: ElementState) {
        let button = match button {
            MouseButton::Left => PointerButton::Primary,
            MouseButton::Right => PointerButton::Secondary,
            MouseButton::Middle => PointerButton::Middle,
            _ => return,
        };
        self.click(button == PointerButton::Primary, state, self.cursor);
        self.input(match state {
            ElementState::Released => InputEvent::PointerUp { pointer: MOUSE },
            ElementState::Pressed => InputEvent::PointerDown {
                pointer: MOUSE,
                kind: PointerKind::Mouse,
                button,
                position: self.cursor,
                modifiers: self.keys(),
            },
        });
    }

    /// Notices double clicks, before the release itself is passed on.
    fn click(&mut self, is_primary: bool, state: ElementState, position: [f64; 2]) {
        if !is_primary {
            return;
        }
        if state.is_pressed() {
            self.clicks.press(position);
        } else if self.clicks.release(Instant::now(), position) {
            self.input(InputEvent::DoubleClick { position });
        }
    }

    fn touch(&mut self, touch: winit::event::Touch) {
        let pointer = touch.id.saturating_add(1);
        let position = [touch.location.x, touch.location.y];
        match touch.phase {
            TouchPhase::Started => self.click(true, ElementState::Pressed, position),
            TouchPhase::Ended => self.click(true, ElementState::Released, position),
            TouchPhase::Moved | TouchPhase::Cancelled => {}
        }
        self.input(match touch.phase {
            TouchPhase::Started => InputEvent::PointerDown {
                pointer,
                kind: PointerKind::Touch,
                button: PointerButton::Primary,
                position,
                modifiers: self.keys(),
            },
            TouchPhase::Moved => InputEvent::PointerMove { pointer, position },
            TouchPhase::Ended | TouchPhase::Cancelled => InputEvent::PointerUp { pointer },
        });
    }

    fn key(&mut self, key: &LogicalKey, state: ElementState) {
        let name = match key {
            LogicalKey::Character(text) => text.to_string(),
            LogicalKey::Named(named) => format!("{named:?}"),
            _ => return,
        };
        if let Some(key) = Key::from_name(&name) {
            self.input(match state {
                ElementState::Released => InputEvent::KeyUp { key },
                ElementState::Pressed => InputEvent::KeyDown {
                    key,
                    modifiers: self.keys(),
                },
            });
        }
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.shown.is_some() {
            return;
        }
        match Shown::new(events, &self.title) {
            Ok(shown) => {
                shown.window.request_redraw();
                self.shown = Some(shown);
            }
            Err(failure) => self.fail(events, failure),
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        if let Some(shown) = &self.shown {
            shown.window.request_redraw();
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => self.redraw(events),
            WindowEvent::Resized(size) => {
                if let Some(shown) = &mut self.shown {
                    shown.resize(size.width, size.height);
                    shown.window.request_redraw();
                }
            }
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::CursorMoved { position, .. } => {
                self.cursor = [position.x, position.y];
                self.input(InputEvent::PointerMove {
                    pointer: MOUSE,
                    position: self.cursor,
                });
            }
            WindowEvent::MouseInput { state, button, .. } => self.pointer(button, state),
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => -f64::from(lines),
                    MouseScrollDelta::PixelDelta(pixels) => -pixels.y / PIXELS_PER_NOTCH,
                };
                self.input(InputEvent::Wheel {
                    notches,
                    position: self.cursor,
                });
            }
            WindowEvent::Touch(touch) => self.touch(touch),
            WindowEvent::KeyboardInput { event, .. } => {
                self.key(&event.logical_key, event.state);
            }
            WindowEvent::Focused(false) => self.input(InputEvent::Blur),
            _ => {}
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(shown)) = (cause, &self.shown) {
            shown.window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(shown) = &self.shown else { return };
        if self.viewer.is_animating() {
            // The display's own pace.
            shown.window.request_redraw();
        }
        events.set_control_flow(if self.viewer.needs_update() {
            ControlFlow::WaitUntil(Instant::now() + IDLE_TICK)
        } else {
            ControlFlow::Wait
        });
    }
}
