//! A file being looked at: camera, cut, residency and streaming, without I/O and without a clock.

use crate::{Camera, EngineError, InputEvent, Request, RequestId, Stats, ViewerOptions, Viewport};
use marquetry_format::{Document, PageId};

/// A file being looked at. See the [crate] documentation for how a shell drives it.
#[derive(Debug)]
pub struct Viewer {}

impl Viewer {
    /// Shows `document` from the front.
    ///
    /// # Errors
    /// An option outside its range, or content that this version does not show.
    pub fn new(document: Document, options: ViewerOptions) -> Result<Self, EngineError> {
        let _ = (document, options);
        unimplemented!()
    }

    /// The file.
    pub fn document(&self) -> &Document {
        unimplemented!()
    }

    /// The options now.
    pub fn options(&self) -> &ViewerOptions {
        unimplemented!()
    }

    /// Changes options; takes effect at the next update.
    ///
    /// # Errors
    /// An option outside its range; the old ones stay.
    pub fn set_options(&mut self, options: ViewerOptions) -> Result<(), EngineError> {
        let _ = options;
        unimplemented!()
    }

    /// The camera now.
    pub fn camera(&self) -> Camera {
        unimplemented!()
    }

    /// Looks from elsewhere, at once.
    pub fn set_camera(&mut self, camera: Camera) {
        let _ = camera;
        unimplemented!()
    }

    /// Takes input; whether it meant something (a shell then keeps the event from scrolling the page).
    pub fn handle(&mut self, event: InputEvent) -> bool {
        let _ = event;
        unimplemented!()
    }

    /// Advances by `seconds`: decodes what was delivered, chooses the cut, morphs, and says what to fetch now.
    pub fn update(&mut self, seconds: f64, viewport: Viewport) -> Vec<Request> {
        let _ = (seconds, viewport);
        unimplemented!()
    }

    /// Takes the answer to a request: exactly the bytes of its range, or why there are none.
    ///
    /// A failure (also bytes that are too few, too many or corrupt) is asked for again later, ever more slowly;
    /// see [`Viewer::take_failures`]. Unknown ids are ignored.
    pub fn deliver(&mut self, id: RequestId, answer: Result<Vec<u8>, String>) {
        let _ = (id, answer);
        unimplemented!()
    }

    /// What failed since this was last called, in words, oldest first (at most 32).
    pub fn take_failures(&mut self) -> Vec<String> {
        unimplemented!()
    }

    /// Whether there is a picture: true from the first update on, because the base is in memory.
    pub fn is_ready(&self) -> bool {
        unimplemented!()
    }

    /// Whether nothing is missing for this view (or nothing more fits the budget) and every morph is at rest.
    pub fn is_settled(&self) -> bool {
        unimplemented!()
    }

    /// Whether the picture has changed since [`Renderer::render`](crate::Renderer::render) last drew it.
    pub fn needs_redraw(&self) -> bool {
        unimplemented!()
    }

    /// Whether calling [`Viewer::update`] again has a point before input or a delivery comes (morphs, retries, decodes).
    pub fn needs_update(&self) -> bool {
        unimplemented!()
    }

    /// What is drawn and what it took.
    pub fn stats(&self) -> Stats {
        unimplemented!()
    }

    /// How much of what the view wants is there, 0..=1.
    pub fn progress(&self) -> f64 {
        unimplemented!()
    }

    /// Lets only pages that pass the filter be fetched: for tests of arbitrary cache states. `None` lifts it.
    /// A view then counts as settled when nothing *allowed* is missing.
    pub fn set_page_filter(&mut self, filter: Option<Box<dyn Fn(PageId) -> bool + Send + Sync>>) {
        let _ = filter;
        unimplemented!()
    }
}
