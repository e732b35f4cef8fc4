//! What a viewer does about colour tiles.

use super::Viewer;
use crate::camera::View;
use crate::colour::layer::ColourLayer;
use crate::{RequestId, Transition};

/// Pages that a tile counts for in [`ViewerOptions::pages_per_update`](crate::ViewerOptions::pages_per_update).
const PAGES_A_TILE: usize = 4;

impl Viewer {
    /// Bytes that pages may take: all of the cache, or half of it beside colour tiles.
    pub(super) fn page_capacity(&self) -> u64 {
        self.options.cache_bytes - self.tile_capacity()
    }

    fn tile_capacity(&self) -> u64 {
        match self.colour {
            Some(_) => self.options.cache_bytes / 2,
            None => 0,
        }
    }

    /// Seconds that a tile fades in for.
    pub(super) fn fade_seconds(&self) -> f64 {
        match self.options.transition {
            Transition::None => 0.0,
            Transition::Alpha | Transition::Dither | Transition::Geomorph => {
                self.options.morph_seconds
            }
        }
    }

    pub(super) fn plan_colour(&mut self, view: &View) {
        let capacity = self.tile_capacity();
        if let Some(layer) = &mut self.colour {
            layer.plan(&self.document, &self.forest, view, capacity);
            self.stale.picture = true;
        }
    }

    pub(super) fn decode_colour(&mut self) {
        let (capacity, now) = (self.tile_capacity(), self.clock);
        let most = self.options.pages_per_update.div_ceil(PAGES_A_TILE);
        if let Some(layer) = &mut self.colour {
            self.stale.picture |= layer.decode_arrived(now, capacity, most);
        }
    }

    /// Draws on while tiles fade in, and once more when they have.
    pub(super) fn fade_colour(&mut self) {
        let fading = self.is_fading();
        self.stale.picture |= fading || self.was_fading;
        self.was_fading = fading;
    }

    fn is_fading(&self) -> bool {
        let seconds = self.fade_seconds();
        let layer = self.colour.as_ref();
        layer.is_some_and(|layer| layer.is_fading(self.clock, seconds))
    }

    pub(super) fn deliver_colour(&mut self, id: RequestId, answer: Result<Vec<u8>, String>) {
        if let Some(layer) = &mut self.colour {
            self.stale.plan |= layer.deliver(self.clock, id, answer);
        }
    }

    pub(super) fn is_colour_settled(&self) -> bool {
        let complete = self.colour.as_ref().is_none_or(ColourLayer::is_complete);
        complete && !self.is_fading() && !self.was_fading
    }

    pub(super) fn colour_needs_update(&self) -> bool {
        let waits = self.colour.as_ref().is_some_and(ColourLayer::needs_update);
        waits || self.was_fading || self.is_fading()
    }

    /// The colour tiles, for the renderer.
    pub(crate) fn colour_layer(&mut self) -> Option<&mut ColourLayer> {
        self.colour.as_mut()
    }
}
