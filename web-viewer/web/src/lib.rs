//! Browser shell of the engine: what JavaScript calls.
//!
//! The division of labour: JavaScript (`js/`) owns the page, that is elements, events, `fetch` and the frame
//! loop; this crate owns everything that is the same in every shell, and the canvas' GPU context.
//! `opener::Opener` turns the first bytes into a document, `gpu::Gpu` a canvas into a device, and
//! `view::View` both into pictures.
//!
//! Images are decoded by workers (`js/decoders.js`), which run the function of `decoder` in a module of their own; meshes here, as long as
//! JavaScript's clock says. What was measured is in `ARCHITECTURE.md`.

pub mod report;
#[cfg(feature = "bench")]
pub mod whole;

#[cfg(target_arch = "wasm32")]
pub mod decoder;
#[cfg(target_arch = "wasm32")]
pub mod gpu;
#[cfg(target_arch = "wasm32")]
pub mod opener;
#[cfg(target_arch = "wasm32")]
pub mod view;

/// Reports panics, which are our bugs, to the console with their place.
#[cfg(target_arch = "wasm32")]
#[wasm_bindgen::prelude::wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|panic| {
        web_sys::console::error_1(&panic.to_string().into());
    }));
}
