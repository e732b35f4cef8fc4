//! An open file.

use super::opening::{FIRST_READ_BYTES, Opening, Step};
use crate::cluster::{ClusterId, ClusterNode, Clusters, directory as cluster_directory};
use crate::codec::page::Coding;
use crate::codec::payload::PartBytes;
use crate::header::{Header, SectionKind, check, checksum};
use crate::index::BLOCK_PAGES;
use crate::index::block::{Block, BlockPlace};
use crate::index::directory::Directory;
use crate::{
    ByteSource, BytesByPart, Chart, ChartId, Error, Limits, Metadata, NodeId, PageEntry, PageId,
    PageSamples, Quadrant,
};
use std::fmt::Write as _;
use std::ops::Range;

/// An open file: everything at its front, and the index blocks read so far. Holds no source.
#[derive(Debug)]
pub struct Document {
    /// Content id: names this content, and seeds every checksum.
    pub content_id: [u8; 16],
    /// Metadata.
    pub metadata: Metadata,
    /// Charts with their glue.
    pub charts: Vec<Chart>,
    /// Resolution that the base holds every chart at (or its own, where that is less).
    pub base_resolution: u8,
    /// The base: per chart its samples at `min(chart.resolution, base_resolution)`.
    pub base: Vec<PageSamples>,
    /// The clusters, if the file has any.
    pub clusters: Option<Clusters>,
    header: Header,
    limits: Limits,
    directory: Directory,
    base_parts: PartBytes,
    /// By chart.
    resolutions: Vec<u8>,
    blocks: Vec<Option<Block>>,
}

impl Document {
    #[expect(
        clippy::too_many_arguments,
        reason = "called once, with the parts just read"
    )]
    pub(super) fn new(
        header: Header,
        limits: Limits,
        directory: Directory,
        base_parts: PartBytes,
        metadata: Metadata,
        charts: Vec<Chart>,
        resolutions: Vec<u8>,
        base_resolution: u8,
        base: Vec<PageSamples>,
        clusters: Option<Clusters>,
    ) -> Self {
        let blocks = directory.blocks.iter().map(|_| None).collect();
        Self {
            content_id: header.content_id,
            metadata,
            charts,
            base_resolution,
            base,
            clusters,
            header,
            limits,
            directory,
            base_parts,
            resolutions,
            blocks,
        }
    }

    /// Opens from a blocking source, with at most two reads.
    ///
    /// # Errors
    /// When the source fails or the front of the file is not valid.
    pub fn open(source: &dyn ByteSource, limits: Limits) -> Result<Self, Error> {
        let found = source.length()?;
        let (mut opening, mut range) = Opening::new(limits);
        range.end = range.end.min(found);
        loop {
            match opening.feed(&source.read(range)?)? {
                Step::Need(next, more) => {
                    let expected = next.file_length().unwrap_or(more.end);
                    check_length(expected, found)?;
                    (opening, range) = (next, more);
                }
                Step::Done(document) => {
                    check_length(document.header.file_length, found)?;
                    return Ok(*document);
                }
            }
        }
    }

    /// Content id as lower-case hexadecimal.
    pub fn content_id_hex(&self) -> String {
        self.content_id
            .iter()
            .fold(String::with_capacity(32), |mut hex, byte| {
                // Writing to a string does not fail.
                let _ = write!(hex, "{byte:02x}");
                hex
            })
    }

    /// Header and section table.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Major and minor version of the format that the file was written in.
    pub fn version(&self) -> (u16, u16) {
        (crate::header::MAJOR, self.header.minor)
    }

    /// Length of the whole file, bytes.
    pub fn file_length(&self) -> u64 {
        self.header.file_length
    }

    /// Bytes from the start to the end of the base: what the first image takes.
    pub fn front_bytes(&self) -> u64 {
        self.header.front_length
    }

    /// Bytes of the first read.
    pub fn first_read_bytes(&self) -> u64 {
        FIRST_READ_BYTES.min(self.header.file_length)
    }

    /// Bytes by part, from the front of the file alone.
    pub fn bytes_by_part(&self) -> BytesByPart {
        let length = |kind| {
            self.header
                .section(kind)
                .map_or(0, crate::header::Section::length)
        };
        let root_cluster = self
            .clusters
            .as_ref()
            .and_then(|clusters| clusters.nodes.first())
            .map_or(0, |root| root.range.end.saturating_sub(root.range.start));
        let index = length(SectionKind::Directory)
            .saturating_add(length(SectionKind::Charts))
            .saturating_add(length(SectionKind::IndexBlocks))
            .saturating_add(length(SectionKind::Clusters).saturating_sub(root_cluster));
        let [geometry, normals, colour] = self.directory.part_bytes;
        let [more_geometry, more_normals, more_colour] = self
            .clusters
            .as_ref()
            .map_or([0; 3], |clusters| clusters.part_bytes);
        let sum = |parts: [u64; 3]| {
            parts
                .iter()
                .fold(0u64, |sum, &part| sum.saturating_add(part))
        };
        let geometry = sum([geometry, self.base_parts.geometry, more_geometry]);
        let normals = sum([normals, self.base_parts.normals, more_normals]);
        let tiles =
            length(SectionKind::ColourDirectory).saturating_add(length(SectionKind::ColourTiles));
        let colour = sum([colour, self.base_parts.colours, more_colour]).saturating_add(tiles);
        let thumbnail = length(SectionKind::Thumbnail);
        let total = self.header.file_length;
        let header = [index, geometry, normals, colour, thumbnail]
            .iter()
            .fold(total, |rest, &part| rest.saturating_sub(part));
        BytesByPart {
            total,
            header,
            index,
            geometry,
            normals,
            colour,
            thumbnail,
        }
    }

    /// Pages of the atlas; those of the clusters are numbered after them.
    pub fn page_count(&self) -> u32 {
        self.directory.page_count
    }

    /// Everything that can be fetched as a page: the atlas, then the clusters below the root, in order.
    pub fn stored_page_count(&self) -> u32 {
        let clusters = self.clusters.as_ref().map_or(1, Clusters::count);
        self.page_count().saturating_add(clusters.saturating_sub(1))
    }

    /// The page that holds the mesh of a cluster; `None` for the root, whose mesh is in the front, and beyond the last.
    pub fn page_of_cluster(&self, id: ClusterId) -> Option<PageId> {
        let page = self.page_count().checked_add(id.0.checked_sub(1)?)?;
        (page < self.stored_page_count()).then_some(PageId(page))
    }

    /// The cluster whose mesh `page` holds; `None` for a page of the atlas and beyond the last page.
    pub fn cluster_of_page(&self, page: PageId) -> Option<ClusterId> {
        let below_root = page.0.checked_sub(self.page_count())?;
        (page.0 < self.stored_page_count()).then(|| ClusterId(below_root.saturating_add(1)))
    }

    /// The cluster whose mesh `page` holds.
    pub fn cluster_node_of_page(&self, page: PageId) -> Option<&ClusterNode> {
        self.clusters.as_ref()?.node(self.cluster_of_page(page)?)
    }

    /// Charts of the file; also its root pages.
    pub fn chart_count(&self) -> u32 {
        u32::try_from(self.charts.len()).unwrap_or(u32::MAX)
    }

    /// Index blocks of the file.
    pub fn index_block_count(&self) -> u32 {
        u32::try_from(self.directory.blocks.len()).unwrap_or(u32::MAX)
    }

    /// The index block that holds `page`.
    pub fn index_block_of(&self, page: PageId) -> u32 {
        page.0 / BLOCK_PAGES
    }

    /// Where index block `block` lies in the file; empty when there is no such block.
    pub fn index_block_range(&self, block: u32) -> Range<u64> {
        self.directory
            .blocks
            .get(at(block))
            .map_or(0..0, |record| record.range.clone())
    }

    /// Whether index block `block` was loaded.
    pub fn has_index_block(&self, block: u32) -> bool {
        self.block(block).is_some()
    }

    fn block(&self, block: u32) -> Option<&Block> {
        self.blocks.get(at(block))?.as_ref()
    }

    /// Pages of index block `block`.
    pub fn index_block_pages(&self, block: u32) -> Range<u32> {
        let first = block.saturating_mul(BLOCK_PAGES).min(self.page_count());
        first..first.saturating_add(BLOCK_PAGES).min(self.page_count())
    }

    /// Checks and takes an index block.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode.
    pub fn load_index_block(&mut self, block: u32, bytes: &[u8]) -> Result<(), Error> {
        let missing = Error::NoSuch {
            what: "index block",
            number: block,
        };
        let Some(record) = self.directory.blocks.get(at(block)) else {
            return Err(missing);
        };
        let expected = record.range.end.saturating_sub(record.range.start);
        check_exact("index block", expected, bytes)?;
        check(
            "index block",
            record.range.start,
            &self.content_id,
            bytes,
            record.checksum,
        )?;
        let next = self.directory.blocks.get(at(block).saturating_add(1));
        let pages = self.index_block_pages(block);
        let roots =
            at(pages.start).min(self.resolutions.len())..at(pages.end).min(self.resolutions.len());
        let place = BlockPlace {
            first_page: pages.start,
            page_count: pages.len(),
            root_resolutions: self.resolutions.get(roots).unwrap_or_default(),
            first_page_offset: record.first_page_offset,
            end_offset: match next {
                Some(next) => next.first_page_offset,
                None => self.header.section(SectionKind::Pages)?.range.end,
            },
            first_child: record.first_child,
            end_child: next.map_or(self.page_count(), |next| next.first_child),
        };
        let decoded = Block::parse(&place, bytes, &self.limits)?;
        match self.blocks.get_mut(at(block)) {
            Some(slot) => *slot = Some(decoded),
            None => return Err(missing),
        }
        Ok(())
    }

    /// Loads every index block not yet loaded.
    ///
    /// # Errors
    /// When the source fails or a block is not valid.
    pub fn load_index(&mut self, source: &dyn ByteSource) -> Result<(), Error> {
        for block in 0..self.index_block_count() {
            if !self.has_index_block(block) {
                let bytes = source.read(self.index_block_range(block))?;
                self.load_index_block(block, &bytes)?;
            }
        }
        Ok(())
    }

    /// The entry of `page`; `None` while its index block is not loaded, or beyond the last page.
    pub fn page(&self, page: PageId) -> Option<&PageEntry> {
        self.block(self.index_block_of(page))?
            .entries
            .get(at(page.0 % BLOCK_PAGES))
    }

    /// All entries loaded so far, in page order.
    pub fn entries(&self) -> impl Iterator<Item = (PageId, &PageEntry)> {
        (0..self.page_count())
            .map(PageId)
            .filter_map(|page| Some((page, self.page(page)?)))
    }

    /// First of the four children of `page`; `None` without children or while its block is not loaded.
    pub fn first_child(&self, page: PageId) -> Option<PageId> {
        let first_children = &self.block(self.index_block_of(page))?.first_children;
        first_children
            .get(at(page.0 % BLOCK_PAGES))
            .copied()
            .flatten()
            .map(PageId)
    }

    /// The page of `node`, found from its chart's root; `None` where the tree or the loaded index ends before.
    pub fn page_of_node(&self, node: NodeId) -> Option<PageId> {
        let outside = |c: u32| c.checked_shr(u32::from(node.level)).unwrap_or(0) != 0;
        if node.chart.0 >= self.chart_count() || outside(node.x) || outside(node.y) {
            return None;
        }
        let mut page = PageId(node.chart.0);
        for level in (0..u32::from(node.level)).rev() {
            let bit = |c: u32| c.checked_shr(level).unwrap_or(0) & 1;
            let quadrant = bit(node.x) | bit(node.y) << 1;
            page = PageId(self.first_child(page)?.0.checked_add(quadrant)?);
        }
        Some(page)
    }

    /// The page whose child `page` is, and as which quadrant; `None` for a root, beyond the last page, or while
    /// the parent's index block is not loaded.
    pub fn parent(&self, page: PageId) -> Option<(PageId, Quadrant)> {
        let quadrant = self.quadrant(page)?;
        let first = page.0.checked_sub(u32::from(quadrant.0))?;
        let block = self
            .directory
            .blocks
            .partition_point(|block| block.first_child <= first)
            .checked_sub(1)?;
        let block = u32::try_from(block).ok()?;
        // Children follow their parents' order, and a page without children repeats nobody's first child.
        let first_children = &self.block(block)?.first_children;
        let place = first_children
            .iter()
            .position(|&child| child == Some(first))?;
        let place = u32::try_from(place).ok()?;
        Some((
            PageId(block.checked_mul(BLOCK_PAGES)?.checked_add(place)?),
            quadrant,
        ))
    }

    /// Which quadrant of its parent `page` is; `None` for a root and beyond the last page.
    pub fn quadrant(&self, page: PageId) -> Option<Quadrant> {
        let below = page.0.checked_sub(self.chart_count())?;
        (page.0 < self.page_count()).then_some(Quadrant((below & 3) as u8))
    }

    /// The node that `page` stores; `None` beyond the last page or while an index block above it is not loaded.
    pub fn node_of_page(&self, page: PageId) -> Option<NodeId> {
        let mut quadrants = Vec::new();
        let mut root = page;
        while let Some(quadrant) = self.quadrant(root) {
            quadrants.push(quadrant);
            root = self.parent(root)?.0;
        }
        if root.0 >= self.chart_count() || quadrants.len() > usize::from(crate::quadtree::MAX_LEVEL)
        {
            return None;
        }
        let node = NodeId::root(ChartId(root.0));
        Some(quadrants.into_iter().rev().fold(node, NodeId::child))
    }

    /// Where `page` lies in the file, a page of the atlas or of a cluster; `None` while its index block is not loaded.
    pub fn page_range(&self, page: PageId) -> Option<Range<u64>> {
        if let Some(node) = self.cluster_node_of_page(page) {
            return Some(node.range.clone());
        }
        let entry = self.page(page)?;
        Some(entry.offset..entry.offset.checked_add(u64::from(entry.length))?)
    }

    /// Where pages `first..=last` lie: one run of bytes, since pages are stored in order without gaps.
    ///
    /// `None` also where something lies between the pages of the atlas and those of the clusters, and both are asked for.
    pub fn page_range_bytes(&self, first: PageId, last: PageId) -> Option<Range<u64>> {
        if first.0 < self.page_count() && last.0 >= self.page_count() {
            let atlas = self.header.section(SectionKind::Pages).ok()?;
            let clusters = self.header.section(SectionKind::ClusterPages).ok()?;
            if atlas.range.end != clusters.range.start {
                return None;
            }
        }
        let (first, last) = (self.page_range(first)?, self.page_range(last)?);
        (first.start <= last.start).then_some(first.start..last.end)
    }

    /// Groups `pages` into runs to fetch with one request each: pages in a run are at most `gap_bytes` apart.
    ///
    /// Pages whose index block is not loaded are left out. Runs are in file order.
    pub fn coalesce(&self, pages: &[PageId], gap_bytes: u64) -> Vec<(Range<u64>, Vec<PageId>)> {
        let mut pages = pages.to_vec();
        pages.sort_unstable();
        pages.dedup();
        let mut runs: Vec<(Range<u64>, Vec<PageId>)> = Vec::new();
        for page in pages {
            let Some(range) = self.page_range(page) else {
                continue;
            };
            match runs.last_mut() {
                Some((run, members)) if range.start.saturating_sub(run.end) <= gap_bytes => {
                    run.end = range.end;
                    members.push(page);
                }
                _ => runs.push((range, vec![page])),
            }
        }
        runs
    }

    pub(super) fn coding(&self) -> Coding {
        Coding {
            shift: self.metadata.lattice.shift,
            has_colours: self.metadata.has_colours,
        }
    }

    /// Refuses bytes that are not those of `page`.
    ///
    /// # Errors
    /// When their length or checksum is another, or the page's index block is not loaded.
    pub fn check_page(&self, page: PageId, bytes: &[u8]) -> Result<(), Error> {
        if let Some(node) = self.cluster_node_of_page(page) {
            return cluster_directory::check_node(node, &self.content_id, bytes);
        }
        if page.0 >= self.page_count() {
            return Err(Error::NoSuch {
                what: "page",
                number: page.0,
            });
        }
        let entry = self.page(page).ok_or(Error::IndexNotLoaded {
            block: self.index_block_of(page),
        })?;
        check_exact("page", u64::from(entry.length), bytes)?;
        let computed = checksum(&self.content_id, bytes) & u64::from(u32::MAX);
        let stored = u64::from(entry.checksum);
        if computed != stored {
            return Err(Error::Checksum {
                what: "page",
                offset: entry.offset,
                stored,
                computed,
            });
        }
        Ok(())
    }
}

pub(super) fn at(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

fn check_exact(what: &'static str, expected: u64, bytes: &[u8]) -> Result<(), Error> {
    let found = bytes.len() as u64;
    match found.cmp(&expected) {
        std::cmp::Ordering::Less => Err(Error::Truncated {
            what,
            expected,
            found,
        }),
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Greater => Err(Error::TrailingBytes {
            what,
            expected,
            found,
        }),
    }
}

fn check_length(expected: u64, found: u64) -> Result<(), Error> {
    match found.cmp(&expected) {
        std::cmp::Ordering::Less => Err(Error::Truncated {
            what: "file",
            expected,
            found,
        }),
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Greater => Err(Error::TrailingBytes {
            what: "file",
            expected,
            found,
        }),
    }
}
