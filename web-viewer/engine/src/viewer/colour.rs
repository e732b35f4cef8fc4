//! What a viewer does about colour tiles and the textures of clusters.

use super::Viewer;
use super::jobs::Subject;
use crate::camera::View;
use crate::colour::layer::ColourLayer;
use crate::colour::slots::MARGIN;
use crate::decode::{DecodeJob, Decoding, ImageWork, Work};
use crate::residency::textures::{Key, Lending, SIZES, bytes_of_texture};
use crate::{RequestId, Transition};
use marquetry_format::colour::GUTTER;

/// Pages that a tile counts for in [`ViewerOptions::pages_per_update`](crate::ViewerOptions::pages_per_update).
const PAGES_A_TILE: usize = 4;
/// The same of a cluster's texture, which has the texels of up to four tiles.
const PAGES_A_TEXTURE: usize = 8;
/// Below this length of a texel, pixels, a cluster is so small that the colours of its vertices will do.
const LEAST_TEXEL_PX: f64 = 0.06;

impl Viewer {
    /// Bytes that pages may take: all of the cache, or half of it beside colour tiles and textures.
    pub(super) fn page_capacity(&self) -> u64 {
        self.options.cache_bytes - self.tile_capacity() - self.texture_capacity()
    }

    fn tile_capacity(&self) -> u64 {
        match (&self.colour, self.table.has_textures()) {
            (Some(_), false) => self.options.cache_bytes / 2,
            (Some(_), true) => self.options.cache_bytes / 8,
            (None, _) => 0,
        }
    }

    fn texture_capacity(&self) -> u64 {
        if self.table.has_textures() {
            self.options.cache_bytes / 2
        } else {
            0
        }
    }

    /// Notes which textures of clusters the picture shows.
    pub(super) fn see_textures(&mut self, view: &View) {
        self.seen_textures.clear();
        let Some(tree) = self
            .document
            .clusters
            .as_ref()
            .filter(|_| self.table.has_textures())
        else {
            return;
        };
        let mut seen: Vec<(f64, Key)> = (self.drawn_clusters())
            .filter_map(|id| {
                let node = tree.node(id)?;
                let texel = node.texel.filter(|_| view.sees(&node.bounds))?;
                let texel_px = view.error_px(texel, &node.bounds);
                let page = self.document.page_of_cluster(id);
                (texel_px >= LEAST_TEXEL_PX).then_some((texel_px, page))
            })
            .collect();
        let halvings = |texel_px: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "casts saturate"
            )]
            let halvings = (-texel_px.log2()).max(0.0) as u8;
            halvings
        };
        // Beyond the smallest size all are alike.
        let mut counts = [0u64; SIZES as usize];
        for &(texel_px, _) in &seen {
            counts[usize::from(halvings(texel_px).min(SIZES - 1))] += 1;
        }
        let bytes = |bias: u8| -> u64 {
            let counts = (0..SIZES).zip(counts);
            counts
                .map(|(k, count)| count * bytes_of_texture(k + bias))
                .sum()
        };
        // As sharp as there is room for all of them.
        let capacity = self.texture_capacity();
        let bias = (0..SIZES).find(|&bias| bytes(bias) <= capacity);
        let bias = bias.unwrap_or(SIZES);
        let sized = |&(texel_px, key): &(f64, Key)| {
            let halvings = halvings(texel_px).saturating_add(bias);
            (key, halvings)
        };
        self.seen_textures.extend(seen.iter().map(sized));
        self.textures_wait = !self.table.touch_served(&self.seen_textures);
        if self.textures_wait {
            // The longest texels first.
            seen.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            self.seen_textures.clear();
            self.seen_textures.extend(seen.iter().map(sized));
        }
    }

    /// Decodes some of the textures that the picture shows and that are not there.
    pub(super) fn show_textures(&mut self) {
        if self.textures_wait && self.jobs.decoding == Decoding::Inline {
            let most = self.options.pages_per_update.div_ceil(PAGES_A_TEXTURE);
            let jobs = self.texture_jobs(most);
            for job in jobs {
                self.take_in(job.run());
            }
        }
        self.stale.frame |= self.table.has_texture_changes();
    }

    /// The next textures to decode, parts being lent for them.
    pub(super) fn texture_jobs(&mut self, most: usize) -> Vec<DecodeJob> {
        if !self.textures_wait || most == 0 {
            return Vec::new();
        }
        let capacity = self.texture_capacity();
        let seen = &self.seen_textures;
        let Lending { images, waits } =
            self.table
                .lend_textures(&self.document, seen, capacity, most);
        self.textures_wait = waits;
        let begin = |(ticket, work): (_, ImageWork)| {
            let (subject, bytes) = (Subject::Texture(ticket), work.decoded_bytes());
            self.jobs.begin(subject, bytes, Work::Image(work))
        };
        images.into_iter().map(begin).collect()
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

    /// Decodes some of the tiles that arrived.
    pub(super) fn decode_tiles(&mut self) {
        let most = self.options.pages_per_update.div_ceil(PAGES_A_TILE);
        for _ in 0..most {
            let Some(job) = self.next_tile_job() else {
                break;
            };
            self.take_in(job.run());
        }
    }

    /// The next tile to decode, room being made for it.
    pub(super) fn next_tile_job(&mut self) -> Option<DecodeJob> {
        let (capacity, now) = (self.tile_capacity(), self.clock);
        let (tile, task) = self.colour.as_mut()?.next_task(now, capacity)?;
        let work = ImageWork {
            task,
            margin: MARGIN - GUTTER,
            skipped: 0,
        };
        let (subject, bytes) = (Subject::Tile(tile), work.decoded_bytes());
        Some(self.jobs.begin(subject, bytes, Work::Image(work)))
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
        let pauses = self.colour.as_ref().is_some_and(ColourLayer::is_pausing);
        pauses || self.was_fading || self.is_fading()
    }

    /// The colour tiles, for the renderer.
    pub(crate) fn colour_layer(&mut self) -> Option<&mut ColourLayer> {
        self.colour.as_mut()
    }
}
