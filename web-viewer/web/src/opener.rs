//! From the first bytes of a file to a document, without I/O.

use marquetry_format::{Document, Limits, Opening, Step};
use std::ops::Range;
use wasm_bindgen::prelude::*;

/// A file being opened: while [`Opener::is_open`] is false, fetch bytes [`Opener::start`]..[`Opener::end`] and
/// [`Opener::feed`] them.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Opener {
    state: State,
}

#[derive(Debug)]
enum State {
    Needs(Opening, Range<u64>),
    Open(Box<Document>),
    /// Refused, or handed over.
    Over,
}

impl Default for Opener {
    fn default() -> Self {
        Self::new()
    }
}

#[wasm_bindgen]
impl Opener {
    /// Starts.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        let (opening, range) = Opening::new(Limits::default());
        Self {
            state: State::Needs(opening, range),
        }
    }

    /// First byte wanted.
    #[wasm_bindgen(getter)]
    pub fn start(&self) -> f64 {
        if let State::Needs(_, range) = &self.state {
            range.start as f64
        } else {
            0.0
        }
    }

    /// One past the last byte wanted.
    #[wasm_bindgen(getter)]
    pub fn end(&self) -> f64 {
        if let State::Needs(_, range) = &self.state {
            range.end as f64
        } else {
            0.0
        }
    }

    /// Whether nothing more is wanted.
    #[wasm_bindgen(getter, js_name = isOpen)]
    pub fn is_open(&self) -> bool {
        matches!(self.state, State::Open(_))
    }

    /// Takes the bytes wanted; fewer where the file ends before.
    ///
    /// # Errors
    /// When they are no valid front of a `.marq` file.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(), JsError> {
        let State::Needs(opening, _) = std::mem::replace(&mut self.state, State::Over) else {
            return Err(JsError::new("no bytes were asked for"));
        };
        self.state = match opening.feed(bytes)? {
            Step::Need(opening, range) => State::Needs(opening, range),
            Step::Done(document) => State::Open(document),
        };
        Ok(())
    }

    /// Content id, lower-case hexadecimal; empty while not open.
    #[wasm_bindgen(getter, js_name = contentId)]
    pub fn content_id(&self) -> String {
        if let State::Open(document) = &self.state {
            document.content_id_hex()
        } else {
            String::new()
        }
    }
}

impl Opener {
    /// Hands the document over.
    pub(crate) fn into_document(self) -> Option<Document> {
        if let State::Open(document) = self.state {
            Some(*document)
        } else {
            None
        }
    }
}
