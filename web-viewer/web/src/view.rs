//! A file on a canvas.

use crate::decoder::Away;
use crate::gpu::{Context, Gpu};
use crate::opener::Opener;
use crate::report::{FrameTimes, stats_json};
use marquetry_engine::{
    Camera, Decoding, InputEvent, Key, Modifiers, PointerButton, PointerKind, Renderer, Request,
    RequestId, RequestKind, Shade, Viewer, ViewerOptions, Viewport,
};
use std::rc::Rc;
use wasm_bindgen::prelude::*;

/// Bits of the modifier keys as JavaScript passes them.
const SHIFT: u8 = 1;
const CONTROL: u8 = 2;
const ALT: u8 = 4;

/// A file on a canvas. JavaScript calls [`View::frame`] whenever the browser wants a picture.
#[wasm_bindgen]
#[derive(Debug)]
pub struct View {
    pub(crate) viewer: Viewer,
    pub(crate) away: Away,
    renderer: Renderer,
    gpu: Rc<Context>,
    viewport: Viewport,
    requests: Vec<Request>,
    /// The canvas does not show what was drawn last.
    is_stale: bool,
    times: FrameTimes,
}

#[wasm_bindgen]
impl View {
    /// Shows what `opener` opened.
    ///
    /// # Errors
    /// When it is not open, or holds what this version does not show.
    #[wasm_bindgen(constructor)]
    pub fn new(gpu: &Gpu, opener: Opener) -> Result<View, JsError> {
        let document = opener
            .into_document()
            .ok_or_else(|| JsError::new("the file is not open"))?;
        let mut viewer = Viewer::new(document, ViewerOptions::default())?;
        viewer.set_decoding(Decoding::Elsewhere);
        let gpu = Rc::clone(&gpu.context);
        let renderer = Renderer::new(&gpu.device, &gpu.queue, gpu.format);
        let viewport = Viewport::new(1, 1);
        Ok(Self {
            viewer,
            away: Away::default(),
            renderer,
            gpu,
            viewport,
            requests: Vec::new(),
            is_stale: true,
            times: FrameTimes::default(),
        })
    }

    /// Sets an option by the name of its attribute: `error-px`, `transition`, `shade`, `background`, `cache`, `section`
    /// (empty for none), `freeze` (`true` or `false`).
    ///
    /// # Errors
    /// When the value is not one of the option's; the old one stays.
    #[wasm_bindgen(js_name = setOption)]
    pub fn set_option(&mut self, name: &str, value: &str) -> Result<(), JsError> {
        let mut options = self.viewer.options().clone();
        let wrong =
            |expected: &str| JsError::new(&format!("{name} is `{value}`; it must be {expected}"));
        match name {
            "error-px" => {
                options.error_px = value
                    .trim()
                    .parse()
                    .ok()
                    .ok_or_else(|| wrong("a number of pixels above 0"))?;
            }
            "transition" => options.transition = value.parse()?,
            "shade" => options.shade = value.parse()?,
            "background" => options.background = value.parse()?,
            "section" if matches!(value.trim(), "" | "none") => options.section = None,
            "section" => options.section = Some(value.parse()?),
            "freeze" => options.freeze = value == "true",
            "cache" => {
                options.cache_bytes = value
                    .trim()
                    .parse()
                    .ok()
                    .ok_or_else(|| wrong("a number of bytes"))?;
            }
            _ => return Err(JsError::new(&format!("there is no option {name}"))),
        }
        Ok(self.viewer.set_options(options)?)
    }

    /// What the surface's colour shows: `lit`, `normal`, `lod`, `wire` or `unlit`. Keys change it too.
    #[wasm_bindgen(getter)]
    pub fn shade(&self) -> String {
        match self.viewer.options().shade {
            Shade::Lit => "lit",
            Shade::Normal => "normal",
            Shade::Lod => "lod",
            Shade::Wire => "wire",
            Shade::Unlit => "unlit",
        }
        .to_owned()
    }

    /// How resolutions change: `none`, `alpha`, `dither` or `geomorph`.
    #[wasm_bindgen(getter)]
    pub fn transition(&self) -> String {
        self.viewer.options().transition.name().to_owned()
    }

    /// Where the model is cut open, as the attribute has it; empty where it is not.
    #[wasm_bindgen(getter)]
    pub fn section(&self) -> String {
        let section = self.viewer.options().section;
        section.map_or_else(String::new, |section| section.to_string())
    }

    /// Whether what is drawn stays as it is. A key changes it too.
    #[wasm_bindgen(getter)]
    pub fn freeze(&self) -> bool {
        self.viewer.options().freeze
    }

    /// Whether keys fly instead of orbiting. A key changes it too.
    #[wasm_bindgen(getter)]
    pub fn flying(&self) -> bool {
        self.viewer.is_flying()
    }

    /// Starts or ends flying.
    #[wasm_bindgen(js_name = setFlying)]
    pub fn set_flying(&mut self, on: bool) {
        self.viewer.set_flying(on);
    }

    /// The camera, as `marquetry render --camera` takes it.
    #[wasm_bindgen(getter)]
    pub fn camera(&self) -> String {
        self.viewer.camera().to_string()
    }

    /// Looks from elsewhere.
    ///
    /// # Errors
    /// When `text` is no camera.
    #[wasm_bindgen(js_name = setCamera)]
    pub fn set_camera(&mut self, text: &str) -> Result<(), JsError> {
        let camera = Camera::parse(&self.viewer.document().metadata, text)?;
        self.viewer.set_camera(camera);
        Ok(())
    }

    /// The canvas has `width` × `height` physical pixels now.
    pub fn resize(&mut self, width: u32, height: u32) {
        let viewport = Viewport::new(width, height);
        self.viewport = viewport;
        self.is_stale = true;
        self.gpu.configure(viewport.width, viewport.height);
    }

    /// Advances by `seconds` and draws if the picture changed, or if `always`; whether it drew.
    ///
    /// # Errors
    /// When the device is lost or cannot hold the picture; there is no use in calling again.
    pub fn frame(&mut self, seconds: f64, always: bool) -> Result<bool, JsError> {
        if let Some(fault) = self.gpu.fault() {
            return Err(JsError::new(fault));
        }
        let mut requests = self.viewer.update(seconds, self.viewport);
        self.requests.append(&mut requests);
        if !always && !self.is_stale && !self.viewer.needs_redraw() {
            return Ok(false);
        }
        let Self {
            viewer, renderer, ..
        } = self;
        let shown = self.gpu.show(|target| renderer.render(viewer, target))?;
        self.is_stale = !shown;
        if !shown {
            // A canvas whose pictures are gone wants to be set up again.
            self.gpu
                .configure(self.viewport.width, self.viewport.height);
        }
        Ok(shown)
    }

    /// Whether the device is gone: the next [`View::frame`] fails, and a new [`Gpu`] may help.
    #[wasm_bindgen(getter, js_name = isLost)]
    pub fn is_lost(&self) -> bool {
        self.gpu.is_lost()
    }

    /// Whether [`View::frame`] should be called again before anything happens.
    #[wasm_bindgen(getter, js_name = wantsFrame)]
    pub fn wants_frame(&self) -> bool {
        self.is_stale || self.viewer.needs_update() || self.viewer.needs_redraw()
    }

    /// Whether nothing is missing for this view.
    #[wasm_bindgen(getter, js_name = isSettled)]
    pub fn is_settled(&self) -> bool {
        self.viewer.is_settled()
    }

    /// How much of what the view wants is there, 0 to 1.
    #[wasm_bindgen(getter)]
    pub fn progress(&self) -> f64 {
        self.viewer.progress()
    }

    /// What to fetch, six numbers a request: id, 1 for pages or 0 for a part of the index, first and last page (or
    /// the index block, twice), first byte, one past the last byte.
    #[wasm_bindgen(js_name = takeRequests)]
    pub fn take_requests(&mut self) -> Vec<u64> {
        let numbers = |request: Request| {
            let (pages, first, last) = match request.kind {
                RequestKind::Pages { first, last } => (1, first.0, last.0),
                RequestKind::IndexBlock(block) => (0, block, block),
                RequestKind::Bytes => (0, 0, 0),
            };
            [
                request.id.0,
                pages,
                u64::from(first),
                u64::from(last),
                request.range.start,
                request.range.end,
            ]
        };
        self.requests.drain(..).flat_map(numbers).collect()
    }

    /// The answer to request `id`.
    pub fn deliver(&mut self, id: u64, bytes: Vec<u8>) {
        self.viewer.deliver(RequestId(id), Ok(bytes));
    }

    /// There is no answer to request `id`, because of `reason`. It will be asked for again.
    pub fn fail(&mut self, id: u64, reason: String) {
        self.viewer.deliver(RequestId(id), Err(reason));
    }

    /// What failed since the last call, in words.
    #[wasm_bindgen(js_name = takeFailures)]
    pub fn take_failures(&mut self) -> Vec<String> {
        self.viewer.take_failures()
    }

    /// A mouse button (0 left, 1 middle, 2 right) or a finger went down. Places are physical pixels.
    #[wasm_bindgen(js_name = pointerDown)]
    pub fn pointer_down(
        &mut self,
        pointer: u32,
        touch: bool,
        button: u8,
        x: f64,
        y: f64,
        modifiers: u8,
    ) -> bool {
        self.viewer.handle(InputEvent::PointerDown {
            pointer: u64::from(pointer),
            kind: if touch {
                PointerKind::Touch
            } else {
                PointerKind::Mouse
            },
            button: match button {
                1 => PointerButton::Middle,
                2 => PointerButton::Secondary,
                _ => PointerButton::Primary,
            },
            position: [x, y],
            modifiers: modifiers_of(modifiers),
        })
    }

    /// A pointer moved.
    #[wasm_bindgen(js_name = pointerMove)]
    pub fn pointer_move(&mut self, pointer: u32, x: f64, y: f64) -> bool {
        self.viewer.handle(InputEvent::PointerMove {
            pointer: u64::from(pointer),
            position: [x, y],
        })
    }

    /// A pointer went up.
    #[wasm_bindgen(js_name = pointerUp)]
    pub fn pointer_up(&mut self, pointer: u32) -> bool {
        self.viewer.handle(InputEvent::PointerUp {
            pointer: u64::from(pointer),
        })
    }

    /// The wheel turned; positive notches zoom out.
    pub fn wheel(&mut self, notches: f64, x: f64, y: f64) -> bool {
        self.viewer.handle(InputEvent::Wheel {
            notches,
            position: [x, y],
        })
    }

    /// A key, by its name in the DOM, went down; whether it means something here.
    pub fn key(&mut self, name: &str, modifiers: u8) -> bool {
        Key::from_name(name).is_some_and(|key| {
            self.viewer.handle(InputEvent::KeyDown {
                key,
                modifiers: modifiers_of(modifiers),
            })
        })
    }

    /// A key, by its name in the DOM, went up.
    #[wasm_bindgen(js_name = keyUp)]
    pub fn key_up(&mut self, name: &str) -> bool {
        Key::from_name(name).is_some_and(|key| self.viewer.handle(InputEvent::KeyUp { key }))
    }

    /// The keyboard is somebody else's now.
    pub fn blur(&mut self) {
        self.viewer.handle(InputEvent::Blur);
    }

    /// Two clicks or taps in quick succession; whether something was there to look at.
    #[wasm_bindgen(js_name = doubleClick)]
    pub fn double_click(&mut self, x: f64, y: f64) -> bool {
        self.viewer
            .handle(InputEvent::DoubleClick { position: [x, y] })
    }

    /// The point of the surface at a place of the picture, physical pixels: its coordinates, its normal, and the most that
    /// the surface drawn there is away from the source; empty on the background.
    pub fn pick(&self, x: f64, y: f64) -> Vec<f64> {
        let Some(pick) = self.viewer.pick([x, y]) else {
            return Vec::new();
        };
        let (world, normal) = (pick.world.to_array(), pick.normal.to_array());
        [world.as_slice(), &normal, &[pick.error]].concat()
    }

    /// Where a point is in the picture, physical pixels, and its depth; empty behind the eye.
    pub fn project(&self, x: f64, y: f64, z: f64) -> Vec<f64> {
        let place = self.viewer.project([x, y, z].into());
        place.map_or_else(Vec::new, |place| place.to_vec())
    }

    /// Whether nothing drawn hides a point on the surface.
    #[wasm_bindgen(js_name = isInSight)]
    pub fn is_in_sight(&self, x: f64, y: f64, z: f64) -> bool {
        self.viewer.is_in_sight([x, y, z].into())
    }

    /// How long the last frame took, for the report.
    #[wasm_bindgen(js_name = setTimes)]
    pub fn set_times(&mut self, frame_ms: f64, cpu_ms: f64) {
        self.times = FrameTimes { frame_ms, cpu_ms };
    }

    /// The report, as JSON with the keys of `marquetry render --json`.
    pub fn stats(&self) -> String {
        stats_json(&self.viewer.stats(), self.times, &self.gpu.adapter)
    }

    /// Facts of the file, as JSON text: source triangles, charts, pages, bounds.
    pub fn facts(&self) -> String {
        let document = self.viewer.document();
        format!(
            r#"{{"source_triangles":{},"charts":{},"pages":{},"bounds":{{"min":{:?},"max":{:?}}}}}"#,
            document.metadata.source_triangles,
            document.charts.len(),
            document.stored_page_count(),
            document.metadata.bounds_min,
            document.metadata.bounds_max,
        )
    }
}

fn modifiers_of(bits: u8) -> Modifiers {
    Modifiers {
        shift: bits & SHIFT != 0,
        control: bits & CONTROL != 0,
        alt: bits & ALT != 0,
    }
}
