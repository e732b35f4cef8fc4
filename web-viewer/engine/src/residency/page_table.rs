//! The resident pages: their slots, the samples that children are decoded from, and what they cost.
//!
//! The budget is hard: a page that does not fit after evicting everything evictable is not taken. Room is reserved before a
//! page is decoded, so what is under way is in the budget as well. Pinned pages (those of the cut that is drawn or wanted) and
//! pages with a child that is resident or being decoded are not evictable.

use super::ids::IdMap;
use super::lru::Lru;
use super::textures::{Key, Lending, Seen, TextureChange, TexturePool, Ticket};
use super::upload::{
    CLUSTER_SLOT_BYTES, COLOURED_SAMPLE_BYTES, ClusterSlots, ClusterUpload, SAMPLE_BYTES, Slot,
    SlotAllocator, Upload,
};
use crate::colour::upload::Mip;
use crate::lod::cluster::target::{GroupSurface, Targets};
use crate::numbers::{NumberMap, NumberSet};
use marquetry_format::cluster::ClusterTexture;
use marquetry_format::{ClusterGroupId, ClusterMesh, Document, PageId, PageSamples};
use std::collections::VecDeque;
use std::sync::Arc;

/// Bytes of one sample kept for decoding children: positions and normals with targets.
const KEPT_BYTES: u64 = 2 * (12 + 2);
/// The same with colours and targets.
const KEPT_COLOURED_BYTES: u64 = KEPT_BYTES + 2 * 3;
/// Bytes of one sample kept for picking where there are no children: its position.
const PICKED_BYTES: u64 = 12;

/// Surfaces of groups that are held for more of their children, beside the budget: they share meshes, which some may have outlived in the table.
const SURFACES: usize = 32;

/// Where a page is on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Samples, in the textures.
    Texels(Slot),
    /// A cluster, in its buffers.
    Cluster(u32),
}

/// What stays of a page in the CPU's memory.
#[derive(Debug)]
enum Kept {
    /// Everything where the page has children, else the positions alone. Shared with jobs that decode children.
    Samples(Arc<PageSamples>),
    /// Everything, for picking and for where children move to.
    Cluster(Arc<ClusterMesh>),
}

/// A page in memory.
#[derive(Debug)]
struct Resident {
    place: Place,
    kept: Kept,
    parent: Option<PageId>,
    children_here: u32,
    bytes: u64,
}

/// Room for a page that is being decoded.
#[derive(Debug, Clone, Copy)]
struct Reserved {
    place: Place,
    parent: Option<PageId>,
    bytes: u64,
}

/// What pages may take.
#[derive(Debug, Clone, Copy)]
pub struct Budget<'a> {
    /// Most bytes.
    pub capacity_bytes: u64,
    /// Pages that are not evicted.
    pub pinned: &'a NumberSet,
}

/// All resident pages of one file, and the base.
#[derive(Debug, Default)]
pub struct PageTable {
    pages: IdMap<PageId, Resident>,
    /// Their numbers, and the slots of those that are clusters.
    resident: NumberSet,
    slots_of_clusters: NumberMap,
    reserved: IdMap<PageId, Reserved>,
    lru: Lru<PageId>,
    slots: SlotAllocator,
    base: Vec<Slot>,
    uploads: Vec<Upload>,
    cluster_slots: ClusterSlots,
    cluster_uploads: Vec<ClusterUpload>,
    root_cluster: Option<u32>,
    root_mesh: Option<Arc<ClusterMesh>>,
    /// Of the groups whose children were decoded last, the last at the end.
    surfaces: VecDeque<(ClusterGroupId, Arc<GroupSurface>)>,
    /// Whether some cluster has a texture.
    has_textures: bool,
    textures: TexturePool,
    used_bytes: u64,
    pinned_bytes: u64,
    evictions: u64,
}

impl PageTable {
    /// A table with the base resident; `None` where the textures cannot hold it.
    pub fn new(document: &Document) -> Option<Self> {
        let mut table = Self::default();
        let mut nodes = document.clusters.iter().flat_map(|tree| &tree.nodes);
        table.has_textures = nodes.any(|node| node.texel.is_some());
        for samples in &document.base {
            let slot = table.slots.allocate(samples.resolution)?;
            table.uploads.push(Upload::pack(slot, samples));
            table.base.push(slot);
            table.pinned_bytes += bytes_of(samples.resolution, true, !samples.colours.is_empty());
        }
        if let Some(tree) = &document.clusters {
            let slot = table.cluster_slots.allocate()?;
            table.cluster_uploads.push(ClusterUpload::pack(
                slot,
                0,
                &tree.root,
                &Targets::default(),
            ));
            table.root_cluster = Some(slot);
            table.root_mesh = Some(Arc::new(tree.root.clone()));
            table.pinned_bytes += CLUSTER_SLOT_BYTES;
        }
        Some(table)
    }

    /// Whether some cluster has a texture.
    pub fn has_textures(&self) -> bool {
        self.has_textures
    }

    /// Whether `page` is resident.
    pub fn contains(&self, page: PageId) -> bool {
        self.resident.contains(page.0)
    }

    /// The slot of `page`.
    pub fn slot(&self, page: PageId) -> Option<Slot> {
        match self.pages.get(&page)?.place {
            Place::Texels(slot) => Some(slot),
            Place::Cluster(_) => None,
        }
    }

    /// The slot of the cluster whose mesh `page` holds; of the root for `None`.
    pub fn cluster_slot(&self, page: Option<PageId>) -> Option<u32> {
        cluster_slot_of(&self.slots_of_clusters, self.root_cluster, page)
    }

    /// The slot of the base of chart `index`.
    pub fn base_slot(&self, index: usize) -> Option<Slot> {
        self.base.get(index).copied()
    }

    /// The samples of a resident page; of one without children, the positions alone.
    pub fn samples(&self, page: PageId) -> Option<&Arc<PageSamples>> {
        match &self.pages.get(&page)?.kept {
            Kept::Samples(samples) => Some(samples),
            Kept::Cluster(_) => None,
        }
    }

    /// The cluster whose mesh `page` holds; the root for `None`.
    pub fn cluster_mesh(&self, page: Option<PageId>) -> Option<&Arc<ClusterMesh>> {
        let Some(page) = page else {
            return self.root_mesh.as_ref();
        };
        match &self.pages.get(&page)?.kept {
            Kept::Samples(_) => None,
            Kept::Cluster(mesh) => Some(mesh),
        }
    }

    /// What the members of a group show, all of which are resident; `None` where one is not.
    pub fn group_surface(
        &mut self,
        document: &Document,
        id: ClusterGroupId,
    ) -> Option<Arc<GroupSurface>> {
        let known = self.surfaces.iter().position(|&(known, _)| known == id);
        let known = known.and_then(|place| self.surfaces.remove(place));
        let surface = if let Some((_, surface)) = known {
            surface
        } else {
            let group = document.clusters.as_ref()?.group(id)?;
            let mesh = |&id: &_| self.cluster_mesh(document.page_of_cluster(id)).cloned();
            let members = group.members.iter().map(mesh).collect::<Option<Vec<_>>>()?;
            Arc::new(GroupSurface::new(members))
        };
        if self.surfaces.len() >= SURFACES {
            self.surfaces.pop_front();
        }
        self.surfaces.push_back((id, Arc::clone(&surface)));
        Some(surface)
    }

    /// Lends parts to clusters that are `seen`, the most important first, with how often the sides of their images are halved; see
    /// [`TexturePool::lend`].
    pub fn lend_textures(
        &mut self,
        document: &Document,
        seen: &[(Key, u8)],
        capacity_bytes: u64,
        most: usize,
    ) -> Lending {
        let root = document
            .clusters
            .as_ref()
            .and_then(|tree| tree.root.texture.as_ref());
        let seen: Vec<Seen<'_>> = seen
            .iter()
            .filter_map(|&(key, halvings)| {
                let texture = match key {
                    None => root,
                    Some(page) => texture_of(&self.pages, page),
                }?;
                let slot = cluster_slot_of(&self.slots_of_clusters, self.root_cluster, key)?;
                Some(Seen {
                    key,
                    slot,
                    halvings,
                    texture,
                })
            })
            .collect();
        self.textures.lend(&seen, capacity_bytes, most)
    }

    /// Marks textures that are `seen` as used, where all of them are served; whether they are.
    pub fn touch_served(&mut self, seen: &[(Key, u8)]) -> bool {
        let textures = &mut self.textures;
        let is_all = (seen.iter()).all(|&(key, halvings)| textures.is_served(key, halvings));
        if is_all {
            for &(key, _) in seen {
                textures.touch(key);
            }
        }
        is_all
    }

    /// Takes what came of an image; see [`TexturePool::finish`].
    pub fn finish_texture(&mut self, ticket: Ticket, decoded: Result<Vec<Mip>, String>) {
        self.textures.finish(ticket, decoded);
    }

    /// Whether changes of textures wait.
    pub fn has_texture_changes(&self) -> bool {
        self.textures.has_changes()
    }

    /// Changes of textures that have not been taken yet, in order.
    pub fn take_texture_changes(&mut self) -> Vec<TextureChange> {
        self.textures.take_changes()
    }

    /// Textures that did not decode, in words.
    pub fn take_texture_failures(&mut self) -> Vec<String> {
        self.textures.take_failures()
    }

    /// Parts that textures of clusters take.
    pub fn texture_parts(&self) -> u32 {
        self.textures.count()
    }

    /// Bytes of the textures of clusters on the GPU.
    pub fn texture_bytes(&self) -> u64 {
        self.textures.used_bytes()
    }

    /// Marks pages as used.
    pub fn touch(&mut self, pages: impl Iterator<Item = PageId>) {
        for page in pages {
            self.lru.touch_known(page);
        }
    }

    /// Makes room for a page of samples that is to be decoded and takes `bytes`, evicting what was used longest ago and is
    /// not in `pinned`. Whether it fits.
    pub fn reserve_samples(
        &mut self,
        page: PageId,
        parent: Option<PageId>,
        resolution: u8,
        bytes: u64,
        budget: Budget<'_>,
    ) -> bool {
        let place = |table: &mut Self| table.slots.allocate(resolution).map(Place::Texels);
        self.reserve(page, parent, bytes, budget, place)
    }

    /// Makes room for the mesh of a cluster, as [`PageTable::reserve_samples`].
    pub fn reserve_cluster(
        &mut self,
        page: PageId,
        parent: Option<PageId>,
        bytes: u64,
        budget: Budget<'_>,
    ) -> bool {
        let place = |table: &mut Self| table.cluster_slots.allocate().map(Place::Cluster);
        self.reserve(page, parent, bytes, budget, place)
    }

    fn reserve(
        &mut self,
        page: PageId,
        parent: Option<PageId>,
        bytes: u64,
        budget: Budget<'_>,
        place: impl FnOnce(&mut Self) -> Option<Place>,
    ) -> bool {
        // Before room is made, so that the parent stays.
        self.count_child(parent, true);
        let fits = self.make_room(bytes, budget);
        let Some(place) = fits.then(|| place(self)).flatten() else {
            self.count_child(parent, false);
            return false;
        };
        self.used_bytes += bytes;
        let reserved = Reserved {
            place,
            parent,
            bytes,
        };
        self.reserved.insert(page, reserved);
        true
    }

    /// Gives up the room of a page that is not to come.
    pub fn release(&mut self, page: PageId) {
        if let Some(reserved) = self.reserved.remove(&page) {
            self.count_child(reserved.parent, false);
            self.used_bytes = self.used_bytes.saturating_sub(reserved.bytes);
            match reserved.place {
                Place::Texels(slot) => self.slots.free(slot),
                Place::Cluster(slot) => self.cluster_slots.free(slot),
            }
        }
    }

    /// Takes a decoded page to the room that was reserved for it; false where that is room for something else.
    pub fn insert(&mut self, page: PageId, samples: PageSamples, has_children: bool) -> bool {
        let Some(&Reserved {
            place: Place::Texels(slot),
            ..
        }) = self.reserved.get(&page)
        else {
            return false;
        };
        if slot.resolution != samples.resolution {
            return false;
        }
        self.uploads.push(Upload::pack(slot, &samples));
        let kept = if has_children {
            samples
        } else {
            PageSamples {
                resolution: samples.resolution,
                positions: samples.positions,
                ..PageSamples::default()
            }
        };
        self.keep(page, Kept::Samples(Arc::new(kept)));
        true
    }

    /// Takes the decoded mesh of a cluster of `level` to the room that was reserved for it; false as [`PageTable::insert`].
    pub fn insert_cluster(
        &mut self,
        page: PageId,
        level: u8,
        mesh: ClusterMesh,
        targets: &Targets,
    ) -> bool {
        let Some(&Reserved {
            place: Place::Cluster(slot),
            ..
        }) = self.reserved.get(&page)
        else {
            return false;
        };
        self.cluster_uploads
            .push(ClusterUpload::pack(slot, level, &mesh, targets));
        self.keep(page, Kept::Cluster(Arc::new(mesh)));
        true
    }

    fn keep(&mut self, page: PageId, kept: Kept) {
        let Some(Reserved {
            place,
            parent,
            bytes,
        }) = self.reserved.remove(&page)
        else {
            return;
        };
        self.resident.insert(page.0);
        if let Place::Cluster(slot) = place {
            self.slots_of_clusters.insert(page.0, slot);
        }
        self.pages.insert(
            page,
            Resident {
                place,
                kept,
                parent,
                children_here: 0,
                bytes,
            },
        );
        self.lru.touch(page);
    }

    /// Counts a child that is resident or being decoded, or that is not any more.
    fn count_child(&mut self, parent: Option<PageId>, is_here: bool) {
        if let Some(parent) = parent.and_then(|parent| self.pages.get_mut(&parent)) {
            parent.children_here = if is_here {
                parent.children_here + 1
            } else {
                parent.children_here.saturating_sub(1)
            };
        }
    }

    fn make_room(&mut self, bytes: u64, budget: Budget<'_>) -> bool {
        while self.used_bytes.saturating_add(bytes) > budget.capacity_bytes {
            let victim = self
                .lru
                .oldest_first()
                .find(|page| self.is_evictable(*page, budget.pinned));
            let Some(victim) = victim else { return false };
            self.evict(victim);
        }
        true
    }

    /// Uploads that have not been taken yet, in order.
    pub fn take_uploads(&mut self) -> Vec<Upload> {
        std::mem::take(&mut self.uploads)
    }

    /// Clusters that have not been taken yet, in order.
    pub fn take_cluster_uploads(&mut self) -> Vec<ClusterUpload> {
        std::mem::take(&mut self.cluster_uploads)
    }

    /// Slots of clusters in use.
    pub fn cluster_slots(&self) -> u32 {
        self.cluster_slots.count()
    }

    /// Whether uploads wait.
    pub fn has_uploads(&self) -> bool {
        !self.uploads.is_empty() || !self.cluster_uploads.is_empty()
    }

    /// Texture layers in use.
    pub fn layers(&self) -> u32 {
        self.slots.layers()
    }

    /// Bytes of evictable pages, those that are being decoded included.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// Bytes of the base.
    pub fn pinned_bytes(&self) -> u64 {
        self.pinned_bytes
    }

    /// Pages evicted so far.
    pub fn evictions(&self) -> u64 {
        self.evictions
    }

    fn is_evictable(&self, page: PageId, pinned: &NumberSet) -> bool {
        !pinned.contains(page.0)
            && self
                .pages
                .get(&page)
                .is_some_and(|resident| resident.children_here == 0)
    }

    fn evict(&mut self, page: PageId) {
        self.lru.remove(page);
        self.resident.remove(page.0);
        self.slots_of_clusters.remove(page.0);
        let Some(resident) = self.pages.remove(&page) else {
            return;
        };
        self.count_child(resident.parent, false);
        match resident.place {
            Place::Texels(slot) => {
                self.uploads.retain(|upload| upload.slot != slot);
                self.slots.free(slot);
            }
            Place::Cluster(slot) => {
                self.cluster_uploads.retain(|upload| upload.slot != slot);
                self.cluster_slots.free(slot);
                self.textures.forget(Some(page));
            }
        }
        self.used_bytes = self.used_bytes.saturating_sub(resident.bytes);
        self.evictions += 1;
    }
}

fn cluster_slot_of(slots: &NumberMap, root: Option<u32>, page: Option<PageId>) -> Option<u32> {
    page.map_or(root, |page| slots.get(page.0))
}

fn texture_of(pages: &IdMap<PageId, Resident>, page: PageId) -> Option<&ClusterTexture> {
    match &pages.get(&page)?.kept {
        Kept::Samples(_) => None,
        Kept::Cluster(mesh) => mesh.texture.as_ref(),
    }
}

/// What a page with a cluster takes, given how long it is stored: its slot, and its texture as it is stored.
pub fn bytes_of_cluster(stored: u64) -> u64 {
    CLUSTER_SLOT_BYTES + stored
}

/// What a page takes: its texels, its positions, and all its samples where children are decoded from them.
pub fn bytes_of(resolution: u8, has_children: bool, has_colours: bool) -> u64 {
    let side = (1u64 << resolution) + 1;
    let texels = if has_colours {
        COLOURED_SAMPLE_BYTES
    } else {
        SAMPLE_BYTES
    };
    let kept = match (has_children, has_colours) {
        (false, _) => PICKED_BYTES,
        (true, false) => KEPT_BYTES,
        (true, true) => KEPT_COLOURED_BYTES,
    };
    side * side * (texels + kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(resolution: u8) -> PageSamples {
        let count = ((1usize << resolution) + 1).pow(2);
        PageSamples {
            resolution,
            positions: vec![[0; 3]; count],
            position_targets: vec![[0; 3]; count],
            normals: vec![[0; 2]; count],
            normal_targets: vec![[0; 2]; count],
            ..PageSamples::default()
        }
    }

    fn reserve(
        table: &mut PageTable,
        id: u32,
        parent: Option<u32>,
        capacity_bytes: u64,
        pinned: &NumberSet,
    ) -> bool {
        let budget = Budget {
            capacity_bytes,
            pinned,
        };
        let bytes = bytes_of(5, true, false);
        table.reserve_samples(PageId(id), parent.map(PageId), 5, bytes, budget)
    }

    fn put(
        table: &mut PageTable,
        id: u32,
        parent: Option<u32>,
        capacity: u64,
        pinned: &[u32],
    ) -> bool {
        let pinned = pinned.iter().copied().collect();
        reserve(table, id, parent, capacity, &pinned) && table.insert(PageId(id), page(5), true)
    }

    #[test]
    fn budget_holds_and_the_oldest_goes_first() {
        let mut table = PageTable::default();
        let capacity = 3 * bytes_of(5, true, false);
        for id in 0..10 {
            assert!(put(&mut table, id, None, capacity, &[]));
            assert!(table.used_bytes() <= capacity);
        }
        assert_eq!(table.evictions(), 7);
        assert!((0..10).all(|id| table.contains(PageId(id)) == (id >= 7)));
    }

    #[test]
    fn pinned_pages_and_parents_stay() {
        let mut table = PageTable::default();
        let capacity = 3 * bytes_of(5, true, false);
        assert!(put(&mut table, 0, None, capacity, &[]));
        assert!(put(&mut table, 1, Some(0), capacity, &[]));
        assert!(put(&mut table, 2, None, capacity, &[]));
        assert!(put(&mut table, 3, None, capacity, &[2]));
        assert!(
            table.contains(PageId(0)) && table.contains(PageId(2)) && !table.contains(PageId(1))
        );
        assert!(!put(&mut table, 4, None, capacity, &[0, 2, 3]));
        assert_eq!(table.used_bytes(), capacity);
    }

    #[test]
    fn room_is_taken_before_decoding_and_holds_the_parent() {
        let (mut table, nothing) = (PageTable::default(), NumberSet::default());
        let page_bytes = bytes_of(5, true, false);
        let capacity = 2 * page_bytes;
        assert!(put(&mut table, 0, None, capacity, &[]));
        assert!(reserve(&mut table, 1, Some(0), capacity, &nothing));
        assert_eq!(table.used_bytes(), capacity);
        assert!(!table.contains(PageId(1)));
        // Neither the parent nor what is under way gives way.
        assert!(!reserve(&mut table, 2, None, capacity, &nothing));
        // A page of another size than was said is refused, and its room given back.
        assert!(!table.insert(PageId(1), page(4), false));
        table.release(PageId(1));
        table.release(PageId(1));
        assert_eq!(table.used_bytes(), page_bytes);
        assert!(put(&mut table, 2, None, page_bytes, &[]));
        assert!(!table.contains(PageId(0)) && table.evictions() == 1);
        assert_eq!(table.take_uploads().len(), 1);
    }

    #[test]
    fn evicted_before_its_upload_is_not_uploaded() {
        let mut table = PageTable::default();
        let capacity = bytes_of(5, true, false);
        assert!(put(&mut table, 0, None, capacity, &[]));
        assert!(put(&mut table, 1, None, capacity, &[]));
        assert_eq!(table.take_uploads().len(), 1);
    }
}
