//! Cut, residency, streaming and drawing of atlases with wgpu; no window, no browser API.
//!
//! A shell (browser or native) opens a [`marquetry_format::Document`] with
//! [`marquetry_format::Opening`], makes a [`Viewer`] of it and a [`Renderer`] for its device, and then, each frame:
//!
//! 1. passes input to [`Viewer::handle`];
//! 2. calls [`Viewer::update`] with the seconds since the last frame and fetches each [`Request`] it returns,
//!    handing the bytes, or the reason there are none, to [`Viewer::deliver`] whenever they come;
//! 3. where [`Viewer::needs_redraw`], calls [`Renderer::render`].
//!
//! Decoding is part of the update, or, where the shell says so ([`Viewer::set_decoding`]), jobs that it runs on threads or workers
//! of its own: see [`mod@decode`].
//!
//! Nothing here reads a clock, blocks, or starts a thread, so the same code runs in a browser tab. What is drawn once
//! [`Viewer::is_settled`] depends on the file, the camera, the viewport and the options alone: not on timing.
//!
//! Everything but [`passes`] works without a GPU: [`lod::mesh`] is the reference of what the shaders draw.

pub mod camera;
pub mod colour;
pub mod controls;
pub mod decode;
pub mod error;
pub mod gpu_types;
pub mod lod;
pub mod numbers;
pub mod options;
pub mod passes;
pub mod pick;
pub mod residency;
pub mod section;
pub mod stats;
#[cfg(all(any(test, feature = "testing"), not(target_arch = "wasm32")))]
pub mod testing;
pub mod viewer;

pub use camera::Camera;
pub use controls::{InputEvent, Key, Modifiers, PointerButton, PointerKind};
pub use decode::{DecodeJob, DecodeResult, Decoding, JobId, JobKind};
pub use error::EngineError;
pub use options::{Background, Shade, Transition, ViewerOptions, Viewport};
pub use passes::Renderer;
pub use pick::Pick;
pub use residency::fetch::{Request, RequestId, RequestKind};
pub use section::Section;
pub use stats::Stats;
pub use viewer::Viewer;

pub use wgpu;
