//! Decoding of images: what workers do, and what a view sends them.

use crate::view::View;
use js_sys::{Array, Uint8Array};
use marquetry_engine::{DecodeJob, DecodeResult, JobKind, Viewer, decode};
use std::collections::BTreeMap;
use wasm_bindgen::prelude::*;

/// Does what a message of [`View::take_images`] says; the answer for [`View::finish_image`]. For workers.
///
/// # Errors
/// Why the image does not decode, in words.
#[wasm_bindgen(js_name = decodeImage)]
pub fn decode_image(message: &[u8]) -> Result<Vec<u8>, JsError> {
    decode::run_message(message).map_err(|reason| JsError::new(&reason))
}

/// Images that workers have.
#[derive(Debug, Default)]
pub(crate) struct Away {
    /// Kept until the answer is there, in case it never comes.
    jobs: BTreeMap<u64, DecodeJob>,
}

impl Away {
    fn send(&mut self, viewer: &mut Viewer, most: usize) -> Array {
        let messages = Array::new();
        for job in viewer.take_jobs(JobKind::Image, most) {
            if let Some(message) = job.message() {
                messages.push(&JsValue::from(job.id().0));
                messages.push(&Uint8Array::from(message.as_slice()));
                self.jobs.insert(job.id().0, job);
            }
        }
        messages
    }

    /// What `answer` makes of image `id`, if it is away.
    fn end(
        &mut self,
        id: u64,
        answer: impl FnOnce(&DecodeJob) -> DecodeResult,
    ) -> Option<DecodeResult> {
        self.jobs.remove(&id).map(|job| answer(&job))
    }
}

#[wasm_bindgen]
impl View {
    /// At most `most` images to decode: for each its id and a message for a worker. Each wants one of [`View::finish_image`],
    /// [`View::fail_image`] and [`View::decode_lost_image`].
    #[wasm_bindgen(js_name = takeImages)]
    pub fn take_images(&mut self, most: usize) -> Array {
        self.away.send(&mut self.viewer, most)
    }

    /// What a worker made of image `id`.
    #[wasm_bindgen(js_name = finishImage)]
    pub fn finish_image(&mut self, id: u64, answer: &[u8]) {
        let result = self.away.end(id, |job| job.read_result(answer));
        if let Some(result) = result {
            self.viewer.finish(result);
        }
    }

    /// Image `id` does not decode, because of `reason`.
    #[wasm_bindgen(js_name = failImage)]
    pub fn fail_image(&mut self, id: u64, reason: String) {
        let result = self.away.end(id, |job| job.fail(reason));
        if let Some(result) = result {
            self.viewer.finish(result);
        }
    }

    /// The worker that had image `id` is gone: decodes it here.
    #[wasm_bindgen(js_name = decodeLostImage)]
    pub fn decode_lost_image(&mut self, id: u64) {
        let result = self.away.end(id, DecodeJob::run);
        if let Some(result) = result {
            self.viewer.finish(result);
        }
    }

    /// Decodes at most `most` meshes, or images, here; how many there were.
    #[wasm_bindgen(js_name = decodeHere)]
    pub fn decode_here(&mut self, images: bool, most: usize) -> usize {
        let kind = if images {
            JobKind::Image
        } else {
            JobKind::Mesh
        };
        let jobs = self.viewer.take_jobs(kind, most);
        for job in &jobs {
            self.viewer.finish(job.run());
        }
        jobs.len()
    }
}
