//! A file being looked at: camera, cut, residency and streaming, without I/O and without a clock.
//!
//! An update does, in this order: decode what arrived (boundedly), plan (which cut, which pages), animate, and say what to
//! fetch. Planning is skipped while nothing it depends on has changed.

mod colour;
mod fade;
mod glide;
mod jobs;
mod pick;
mod plan;
mod stream;

use crate::camera::View;
use crate::colour::layer::ColourLayer;
use crate::colour::stream::TileStream;
use crate::controls::{Action, Controls};
use crate::gpu_types::{ClusterList, DrawList, DrawnCluster, Frame, Instance};
use crate::lod::animate::Drawn;
use crate::lod::cluster::morph;
use crate::lod::cut::{Cut, Leaf};
use crate::lod::desire::{Forest, Wanted};
use crate::lod::edge_morph::{morph_of, side_modes};
use crate::numbers::{NumberMap, NumberSet};
use crate::options::Shade;
use crate::residency::fetch::{Delivery, Fetcher, Item};
use crate::residency::page_table::PageTable;
use crate::residency::textures::{Key, TextureChange};
use crate::residency::upload::{ClusterUpload, MAX_LAYERS, Upload};
use crate::section::HalfSpace;
use crate::stats::{CacheStats, PageStats};
use crate::{Camera, EngineError, InputEvent, Request, RequestId, Stats, ViewerOptions, Viewport};
use marquetry_format::{
    ClusterGroup, ClusterGroupId, ClusterId, ContentKind, Document, NodeId, PageId,
};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};

/// Seconds without a camera move after which hysteresis ends, so that a settled picture depends on the view alone.
const REST_SECONDS: f64 = 0.25;
/// Longest step of time that one update makes, seconds: after a stall morphs go on from where they were.
const LONGEST_STEP: f64 = 0.25;
/// Which pages may be fetched.
pub type PageFilter = Box<dyn Fn(PageId) -> bool + Send + Sync>;

/// A file being looked at. See the [crate] documentation for how a shell drives it.
pub struct Viewer {
    id: u64,
    document: Document,
    forest: Forest,
    options: ViewerOptions,
    camera: Camera,
    /// The standard view that shows the whole model, until the camera is moved: it follows the shape of the picture.
    framed: Option<usize>,
    controls: Controls,
    viewport: Viewport,
    filter: Option<PageFilter>,

    clock: f64,
    moved_at: f64,
    view: Option<View>,
    stale: Stale,
    /// Whether the camera rested when the plan was made.
    planned_resting: bool,

    budget_step: u32,
    wanted: Wanted,
    /// What that takes; `None` before the first plan, and where the index has grown since.
    planned_size: Option<plan::PlanSize>,
    needed: Vec<Needed>,
    needed_index: NumberMap,
    pinned: NumberSet,
    /// What these are the pages of, and how many it needs, where it is drawn and nothing else.
    pinned_for: Option<(Cut, usize)>,
    /// What is drawn towards: what is there of what is wanted.
    target: Drawn,
    drawn: Drawn,
    draw_list: DrawList,
    cluster_list: ClusterList,
    /// The clusters of the cut that was drawn last.
    drawn_clusters: Option<(Cut, Vec<ClusterId>)>,
    fade: Option<fade::Fade>,
    fading: Option<fade::Fading>,
    glide: Option<glide::Glide>,

    table: PageTable,
    fetcher: Fetcher,
    fetched: u64,
    jobs: jobs::Jobs,
    colour: Option<ColourLayer>,
    /// Whether tiles were fading in at the last update.
    was_fading: bool,
    /// Clusters with textures that are in the picture, those with the longest texels first, and how often theirs are halved.
    seen_textures: Vec<(Key, u8)>,
    /// Whether some of them have no texture yet that will get one.
    textures_wait: bool,
}

/// What has to be made anew, each because of something before it.
#[derive(Debug, Clone, Copy)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "four results, each of them up to date or not"
)]
struct Stale {
    /// What is wanted.
    plan: bool,
    /// What is drawn towards.
    target: bool,
    /// The instances.
    picture: bool,
    /// What the renderer last drew.
    frame: bool,
}

/// A page that the plan needs.
#[derive(Debug, Clone, Copy)]
struct Needed {
    page: PageId,
    /// The page that must be there before.
    parent: Option<PageId>,
    /// Its node in a chart; `None` for a cluster.
    node: Option<NodeId>,
    /// The group that a cluster is a child of.
    group: Option<ClusterGroupId>,
    /// Screen-space error that is shown without it, pixels.
    importance_px: f64,
    /// Whether the filter lets it and everything above it pass.
    allowed: bool,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewer")
            .field("file", &self.document.metadata.source_name)
            .field("camera", &self.camera)
            .field("options", &self.options)
            .field("stats", &self.stats())
            .finish_non_exhaustive()
    }
}

impl Viewer {
    /// Shows `document` from the front.
    ///
    /// # Errors
    /// An option outside its range, or content that this version does not show.
    pub fn new(document: Document, options: ViewerOptions) -> Result<Self, EngineError> {
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        options.check()?;
        match document.metadata.kind {
            ContentKind::Scan => {}
            ContentKind::Terrain => return Err(EngineError::UnsupportedContent("terrain")),
            ContentKind::Scene => return Err(EngineError::UnsupportedContent("scene")),
        }
        let table = PageTable::new(&document).ok_or(EngineError::DeviceTooSmall {
            needed: MAX_LAYERS + 1,
            available: MAX_LAYERS,
        })?;
        let coarsest = Cut::coarsest(document.charts.len());
        let viewport = Viewport::new(1, 1);
        Ok(Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            forest: Forest::new(&document),
            camera: Camera::framing(&document.metadata, 0, viewport)?,
            framed: Some(0),
            controls: Controls::new(&document.metadata),
            options,
            viewport,
            filter: None,
            clock: 0.0,
            moved_at: f64::NEG_INFINITY,
            view: None,
            stale: Stale {
                plan: true,
                target: true,
                picture: true,
                frame: true,
            },
            planned_resting: true,
            budget_step: 0,
            wanted: Wanted {
                cut: coarsest.clone(),
                blocks: BTreeSet::new(),
            },
            planned_size: None,
            needed: Vec::new(),
            needed_index: NumberMap::default(),
            pinned: NumberSet::default(),
            pinned_for: None,
            target: Drawn::of(coarsest.clone()),
            drawn: Drawn::of(coarsest),
            draw_list: DrawList::default(),
            cluster_list: ClusterList::default(),
            drawn_clusters: None,
            fade: None,
            fading: None,
            glide: None,
            table,
            fetcher: Fetcher::default(),
            fetched: 0,
            jobs: jobs::Jobs::default(),
            colour: ColourLayer::new(&document)?,
            was_fading: false,
            seen_textures: Vec::new(),
            textures_wait: false,
            document,
        })
    }

    /// The file.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The options now.
    pub fn options(&self) -> &ViewerOptions {
        &self.options
    }

    /// Changes options; takes effect at the next update.
    ///
    /// # Errors
    /// An option outside its range; the old ones stay.
    pub fn set_options(&mut self, options: ViewerOptions) -> Result<(), EngineError> {
        options.check()?;
        if options != self.options {
            self.options = options;
            self.stale.plan = true;
            self.stale.picture = true;
        }
        Ok(())
    }

    /// The camera now.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Looks from elsewhere, at once. A camera that is not finite, or whose eye is its target, is ignored.
    pub fn set_camera(&mut self, camera: Camera) {
        let finite = camera.eye.is_finite() && camera.target.is_finite() && camera.up.is_finite();
        if finite && camera.eye != camera.target {
            self.camera = camera;
            self.framed = None;
            self.glide = None;
        }
    }

    /// Shows the whole model from a standard view, and keeps doing so while the picture changes shape.
    ///
    /// # Errors
    /// [`EngineError::NoSuchView`] above 25; the camera stays.
    pub fn frame_model(&mut self, view: usize) -> Result<(), EngineError> {
        self.set_camera(Camera::framing(
            &self.document.metadata,
            view,
            self.viewport,
        )?);
        self.framed = Some(view);
        Ok(())
    }

    /// Whether keys fly instead of orbiting.
    pub fn is_flying(&self) -> bool {
        self.controls.is_flying()
    }

    /// Starts or ends flying, as the key `g` does.
    pub fn set_flying(&mut self, on: bool) {
        self.controls.set_flying(on);
    }

    /// Takes input; whether it meant something (a shell then keeps the event from scrolling the page).
    pub fn handle(&mut self, event: InputEvent) -> bool {
        let mut camera = self.camera;
        let below = self
            .controls
            .place_of_interest(&event, self.viewport)
            .and_then(|place| Some(self.pick_from(&camera, place)?.world));
        let action = self
            .controls
            .handle(event, &mut camera, self.viewport, below);
        if camera != self.camera {
            self.set_camera(camera);
        } else if action != Action::Ignored {
            self.glide = None;
        }
        match action {
            Action::Ignored => false,
            Action::Taken => true,
            Action::Focus(point) => {
                self.framed = None;
                self.glide = Some(glide::Glide::to(self.camera, point));
                true
            }
            Action::Frame(view) => self.frame_model(view).is_ok(),
            Action::ToggleFreeze => {
                self.options.freeze = !self.options.freeze;
                self.stale.plan = true;
                true
            }
            Action::ToggleShade(shade) => {
                self.options.shade = if self.options.shade == shade {
                    Shade::Lit
                } else {
                    shade
                };
                self.stale.picture = true;
                true
            }
        }
    }

    /// Advances by `seconds`: decodes what was delivered, chooses the cut, morphs, and says what to fetch now.
    pub fn update(&mut self, seconds: f64, viewport: Viewport) -> Vec<Request> {
        let seconds = if seconds.is_finite() {
            seconds.max(0.0)
        } else {
            0.0
        };
        self.clock += seconds;
        self.move_camera(seconds);
        let view = self.look(viewport);
        self.decode_arrived();
        if !self.options.freeze && (self.stale.plan || self.planned_resting != self.is_resting()) {
            self.plan(&view);
            self.plan_colour(&view);
        }
        if !self.options.freeze && self.stale.target {
            self.stale.target = false;
            self.target = self.aim(&view);
        }
        self.animate(seconds);
        self.fade_colour();
        if self.stale.picture {
            self.stale.picture = false;
            self.stale.frame = true;
            self.find_drawn_clusters();
            self.collect_both(&view);
            self.see_textures(&view);
            self.collect_clusters(&view);
        }
        self.show_textures();
        self.schedule()
    }

    /// Takes the answer to a request: exactly the bytes of its range, or why there are none.
    ///
    /// A failure (also bytes that are too few, too many or corrupt) is asked for again later, ever more slowly;
    /// see [`Viewer::take_failures`]. Unknown ids are ignored.
    pub fn deliver(&mut self, id: RequestId, answer: Result<Vec<u8>, String>) {
        if TileStream::owns(id) {
            return self.deliver_colour(id, answer);
        }
        if let Delivery::Block(block, bytes) =
            self.fetcher.deliver(self.clock, &self.document, id, answer)
        {
            match self.document.load_index_block(block, &bytes) {
                Ok(()) => {
                    self.fetcher.succeed(Item::Block(block));
                    self.planned_size = None;
                    self.stale.plan = true;
                }
                Err(error) => {
                    let words = format!("index block {block}: {error}");
                    self.fetcher.fail(self.clock, &[Item::Block(block)], &words);
                }
            }
        }
    }

    /// What failed since this was last called, in words, oldest first (at most 32).
    pub fn take_failures(&mut self) -> Vec<String> {
        let mut words = self.fetcher.take_failures();
        words.extend(self.table.take_texture_failures());
        if let Some(layer) = &mut self.colour {
            words.extend(layer.take_failures());
        }
        words
    }

    /// Whether there is a picture: true from the first update on, because the base is in memory.
    pub fn is_ready(&self) -> bool {
        self.view.is_some()
    }

    /// Whether nothing is missing for this view (or nothing more fits the budget) and every morph is at rest.
    pub fn is_settled(&self) -> bool {
        let is_complete = !self.stale.plan
            && !self.stale.target
            && self.planned_resting
            && self.wanted.blocks.is_empty()
            && self.missing().all(|needed| !needed.allowed)
            && self.is_colour_settled()
            && !self.textures_wait;
        self.is_ready()
            && (is_complete || self.options.freeze)
            && self.is_resting()
            && !self.is_animating()
    }

    /// Whether the picture has changed since [`Renderer::render`](crate::Renderer::render) last drew it.
    pub fn needs_redraw(&self) -> bool {
        self.stale.frame
    }

    /// Whether something in the picture is on its way to another resolution, so that every frame differs.
    pub fn is_animating(&self) -> bool {
        self.fade.is_some()
            || self.glide.is_some()
            || self.controls.is_moving()
            || self.drawn != self.target
    }

    /// Whether calling [`Viewer::update`] again has a point before input or a delivery comes (morphs, retries, decodes).
    pub fn needs_update(&self) -> bool {
        let is_choosing = self.stale.plan || self.stale.target || !self.planned_resting;
        !self.is_ready()
            || (is_choosing && !self.options.freeze)
            || self.stale.picture
            || !self.is_resting()
            || self.jobs.need_update(self.decoding_waits())
            || self.fetcher.is_pausing()
            || self.colour_needs_update()
            || self.is_animating()
    }

    /// What is drawn and what it took.
    pub fn stats(&self) -> Stats {
        let tiles = self
            .colour
            .as_ref()
            .map(ColourLayer::stats)
            .unwrap_or_default();
        let lists = || self.draw_lists().into_iter();
        let clusters = || self.cluster_lists().into_iter();
        Stats {
            triangles: lists().map(DrawList::triangles).sum::<u64>()
                + clusters().map(|list| list.triangles).sum::<u64>(),
            nodes: lists().map(|list| list.instances.len() as u64).sum::<u64>()
                + clusters().map(|list| list.nodes).sum::<u64>(),
            draw_calls: (lists().map(|list| list.draws().count()).sum::<usize>()
                + clusters().map(|list| list.runs.len()).sum::<usize>())
                as u64,
            pages: PageStats {
                requested: self.fetcher.requested(),
                fetched: self.fetched,
                bytes: self.fetcher.received_bytes(),
                missing: self.missing().count() as u64,
            },
            tiles,
            cache: CacheStats {
                capacity_bytes: self.options.cache_bytes,
                used_bytes: self.table.used_bytes() + self.table.texture_bytes() + tiles.used_bytes,
                pinned_bytes: self.table.pinned_bytes(),
                evictions: self.table.evictions(),
            },
            failures: self.fetcher.failure_count() + tiles.failures,
            error_px: self.paged_error_px(self.budget_step),
        }
    }

    /// How much of what the view wants is there, 0..=1; 1 when nothing is missing.
    pub fn progress(&self) -> f64 {
        let (tiles, missing_tiles) = self.colour.as_ref().map_or((0, 0), ColourLayer::progress);
        let missing = self.missing().count() + self.wanted.blocks.len() + missing_tiles;
        let all = self.needed.len() + self.wanted.blocks.len() + tiles;
        if missing == 0 {
            1.0
        } else {
            (all - missing) as f64 / all as f64
        }
    }

    /// Lets only pages that pass the filter be fetched: for tests of arbitrary cache states. `None` lifts it.
    /// A view then counts as settled when nothing *allowed* is missing.
    pub fn set_page_filter(&mut self, filter: Option<PageFilter>) {
        self.filter = filter;
        self.stale.plan = true;
    }

    /// A number that no other viewer has, so that a renderer knows whose samples it holds.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// What is drawn now, by node.
    pub fn drawn(&self) -> &Drawn {
        &self.drawn
    }

    pub(crate) fn fading(&self) -> Option<&fade::Fading> {
        self.fading.as_ref()
    }

    /// Everything that is drawn: what stays, what goes, what comes.
    pub(crate) fn draw_lists(&self) -> Vec<&DrawList> {
        let fading = self.fading.as_ref();
        let others = fading.map(|fading| [&fading.leaving, &fading.arriving]);
        std::iter::once(&self.draw_list)
            .chain(others.into_iter().flatten())
            .collect()
    }

    /// The clusters of each of [`Viewer::draw_lists`].
    pub(crate) fn cluster_lists(&self) -> Vec<&ClusterList> {
        let fading = self.fading.as_ref();
        let others = fading.map(|fading| [&fading.leaving_clusters, &fading.arriving_clusters]);
        std::iter::once(&self.cluster_list)
            .chain(others.into_iter().flatten())
            .collect()
    }

    pub(crate) fn frame(&self) -> Option<Frame> {
        let view = self.view.as_ref()?;
        let frame = Frame::new(view, self.options.shade, self.document.metadata.has_colours);
        Some(match self.section() {
            Some(section) => frame.cut_open(view, section),
            None => frame,
        })
    }

    /// The half-space that is shown, lattice coordinates.
    pub(crate) fn section(&self) -> Option<HalfSpace> {
        let metadata = &self.document.metadata;
        let section = self.options.section?;
        Some(section.plane(metadata).on_lattice(&metadata.lattice))
    }

    pub(crate) fn viewport(&self) -> Viewport {
        self.viewport
    }

    pub(crate) fn texture_layers(&self) -> u32 {
        self.table.layers().max(1)
    }

    pub(crate) fn take_uploads(&mut self) -> Vec<Upload> {
        self.table.take_uploads()
    }

    pub(crate) fn take_cluster_uploads(&mut self) -> Vec<ClusterUpload> {
        self.table.take_cluster_uploads()
    }

    pub(crate) fn cluster_texture_parts(&self) -> u32 {
        self.table.texture_parts()
    }

    pub(crate) fn take_texture_changes(&mut self) -> Vec<TextureChange> {
        self.table.take_texture_changes()
    }

    pub(crate) fn cluster_slots(&self) -> u32 {
        self.table.cluster_slots()
    }

    pub(crate) fn mark_drawn(&mut self) {
        self.stale.frame = false;
    }

    /// Whether meshes and images are there that could be decoded.
    fn decoding_waits(&self) -> [bool; 2] {
        let tiles_wait = self.colour.as_ref().is_some_and(ColourLayer::has_arrived);
        [self.fetcher.has_arrived(), tiles_wait || self.textures_wait]
    }

    fn is_resting(&self) -> bool {
        self.clock - self.moved_at >= REST_SECONDS
    }

    fn missing(&self) -> impl Iterator<Item = &Needed> {
        self.needed
            .iter()
            .filter(|needed| !self.table.contains(needed.page))
    }

    /// The view of the present camera; notes whether it is another one than before.
    fn look(&mut self, viewport: Viewport) -> View {
        if self.viewport != viewport {
            self.viewport = viewport;
            if let Some(view) = self.framed {
                let framed = Camera::framing(&self.document.metadata, view, viewport);
                self.camera = framed.unwrap_or(self.camera);
            }
        }
        let view = View::new(&self.camera, &self.document.metadata, viewport);
        if self.view != Some(view) {
            if self.view.is_some() {
                self.moved_at = self.clock;
            }
            self.view = Some(view);
            self.stale.plan = true;
            self.stale.picture = true;
        }
        view
    }

    /// Goes on with what moves the camera by itself.
    fn move_camera(&mut self, seconds: f64) {
        let mut camera = self.camera;
        if let Some(mut glide) = self.glide.take() {
            if self.options.morph_seconds == 0.0 {
                self.camera = glide.end();
                return;
            }
            let (camera, has_arrived) = glide.advance(seconds);
            self.camera = camera;
            self.glide = (!has_arrived).then_some(glide);
        } else if self.controls.is_moving() {
            self.controls.advance(seconds, &mut camera);
            self.set_camera(camera);
        }
    }

    fn animate(&mut self, seconds: f64) {
        if self.fade.is_none() && self.drawn == self.target {
            return;
        }
        let at_once = self.changes_at_once();
        let mut changes = true;
        // Nothing has been shown yet, or nothing is to be seen of the change.
        if at_once || self.draws_nothing() {
            self.fade = None;
            self.drawn = self.target.clone();
        } else {
            #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
            let step = (seconds.min(LONGEST_STEP) / self.options.morph_seconds).min(1.0) as f32;
            if self.fades() {
                self.fade(step);
            } else {
                changes = self.fade.take().is_some() | self.move_on(step);
            }
        }
        if changes {
            self.pin();
        }
        self.stale.picture = true;
    }

    /// Moves what is drawn towards the target, by at most `step` where it is in the picture. Whether other nodes are drawn than before.
    fn move_on(&mut self, step: f32) -> bool {
        let document = &self.document;
        let (view, clusters) = (self.view, document.clusters.as_ref());
        let of_group = |group: &ClusterGroup| {
            let nodes = group.members.iter().filter_map(|&id| clusters?.node(id));
            let is_seen = |bounds| view.is_none_or(|view| view.sees(bounds));
            if nodes.into_iter().any(|node| is_seen(&node.bounds)) {
                step
            } else {
                1.0
            }
        };
        let charts = self.drawn.advance(&self.target, &document.charts, step);
        let drawn = &mut self.drawn;
        charts | drawn.advance_clusters(&self.target, document, of_group)
    }

    fn draws_nothing(&self) -> bool {
        let mut lists = self.draw_lists().into_iter();
        self.cluster_lists().iter().all(|list| list.nodes == 0)
            && lists.all(|list| list.instances.is_empty())
    }

    /// How `leaf` of `drawn` is drawn; `None` where it is not in the picture.
    fn instance(&self, view: &View, drawn: &Drawn, leaf: Leaf) -> Option<Instance> {
        let document = &self.document;
        let bounds = self.forest.bounds(document, leaf.node)?;
        if !view.sees(&bounds) {
            return None;
        }
        let base = usize::try_from(leaf.node.chart.0)
            .ok()
            .and_then(|chart| self.table.base_slot(chart))?;
        let slot = if leaf.node.level == 0 && leaf.resolution <= base.resolution {
            base
        } else {
            self.table.slot(document.page_of_node(leaf.node)?)?
        };
        let sides = side_modes(&drawn.cut, &drawn.morphs, &document.charts, leaf);
        Some(Instance::new(
            leaf,
            slot,
            morph_of(&drawn.morphs, leaf),
            sides,
        ))
    }

    /// How a cluster of `drawn` is drawn; `None` where it is not in the picture.
    fn cluster(&self, view: &View, drawn: &Drawn, id: ClusterId) -> Option<DrawnCluster> {
        let clusters = self.document.clusters.as_ref()?;
        let node = clusters.node(id)?;
        let slot = self.table.cluster_slot(self.document.page_of_cluster(id))?;
        let morph = drawn.cluster_morph(clusters, id);
        // What moves is partly where the members are, beyond its own bounds.
        let is_seen = if morph > 0.0 {
            morph::bounds(clusters, id).is_some_and(|bounds| view.sees(&bounds))
        } else {
            view.sees(&node.bounds)
        };
        is_seen.then_some(DrawnCluster {
            slot,
            triangles: node.triangles,
            morph,
        })
    }
}

#[cfg(test)]
mod tests;
