//! What to fetch, in which order, and what to do when it fails.

//!
//! Index blocks come before pages; pages by importance, with neighbours in the file joined to one request. A fetch that
//! failed (also by a wrong checksum) is tried again after a pause that doubles each time. No clock: the caller says what
//! time it is.

use marquetry_format::{Document, PageId};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::{Bound, Range};

/// Most pages in one request.
const RUN_PAGES: u32 = 64;
/// Most bytes in one request, unless a single page is larger.
const RUN_BYTES: u64 = 256 * 1024;
/// Pause after a first failure, seconds; doubles with each further one.
const FIRST_PAUSE: f64 = 0.25;
/// Longest pause, seconds.
const LONGEST_PAUSE: f64 = 8.0;
/// Pages that may wait to be decoded before no more are asked for.
const MOST_WAITING: usize = 1024;
/// Failures kept in words.
const FAILURES_KEPT: usize = 32;

/// Names a [`Request`] until it is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RequestId(pub u64);

/// What a request is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestKind {
    /// One block of the index; to be had as a byte range only.
    IndexBlock(u32),
    /// Something else, to be had as a byte range only.
    Bytes,
    /// The pages `first..=last`, or colour tiles under the numbers after the pages, side by side in the file: as a byte range, or as `/pages/NAME/CID/FIRST-LAST`.
    Pages {
        /// First page.
        first: PageId,
        /// Last page, included.
        last: PageId,
    },
}

/// Bytes that the engine wants. Answer with [`Viewer::deliver`](crate::Viewer::deliver), exactly once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// To answer with.
    pub id: RequestId,
    /// What is asked for.
    pub kind: RequestKind,
    /// The same as bytes of the file; never empty.
    pub range: Range<u64>,
}

/// One thing to fetch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    /// An index block.
    Block(u32),
    /// A page.
    Page(PageId),
}

#[derive(Debug, Clone, Copy)]
struct Retry {
    failures: i32,
    not_before: f64,
}

/// What a delivered request brought.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Delivery {
    /// Nothing: it failed, or was unknown.
    Nothing,
    /// The bytes of an index block.
    Block(u32, Vec<u8>),
    /// Pages, now waiting: see [`Fetcher::next_arrived`].
    Pages,
}

/// Requests under way, pages that wait to be decoded, and what failed.
#[derive(Debug, Default)]
pub struct Fetcher {
    in_flight: BTreeMap<RequestId, Request>,
    pending: BTreeSet<Item>,
    next_id: u64,
    retries: BTreeMap<Item, Retry>,
    arrived: BTreeMap<PageId, Vec<u8>>,
    decoding: BTreeSet<PageId>,
    words: VecDeque<String>,
    failures: u64,
    requested: u64,
    bytes: u64,
}

impl Fetcher {
    /// Requests for what is wanted and neither under way nor pausing, until `limit` are under way.
    ///
    /// `pages` are in order of importance; those without an index entry, or without bytes, are passed over.
    pub fn schedule(
        &mut self,
        now: f64,
        limit: usize,
        document: &Document,
        blocks: &BTreeSet<u32>,
        pages: &[PageId],
    ) -> Vec<Request> {
        let mut requests = Vec::new();
        for block in blocks {
            if self.in_flight.len() >= limit {
                return requests;
            }
            if self.may_ask(now, Item::Block(*block)) {
                let range = document.index_block_range(*block);
                requests.extend(self.ask(
                    RequestKind::IndexBlock(*block),
                    range,
                    [Item::Block(*block)].into_iter(),
                ));
            }
        }
        self.forget_old_failures(blocks, pages);
        if self.in_flight.len() >= limit || self.arrived.len() >= MOST_WAITING {
            return requests;
        }
        let mut open: BTreeSet<PageId> = pages
            .iter()
            .copied()
            .filter(|page| self.may_ask(now, Item::Page(*page)))
            .collect();
        for page in pages {
            if self.in_flight.len() >= limit {
                break;
            }
            if let Some((run, range)) = run_around(document, &open, *page) {
                let pages = (run.start..run.end).map(PageId);
                pages.clone().for_each(|page| {
                    open.remove(&page);
                });
                self.requested += u64::from(run.end - run.start);
                let kind = RequestKind::Pages {
                    first: PageId(run.start),
                    last: PageId(run.end - 1),
                };
                requests.extend(self.ask(kind, range, pages.map(Item::Page)));
            }
        }
        requests
    }

    /// Takes the answer to a request, splitting it into pages.
    pub fn deliver(
        &mut self,
        now: f64,
        document: &Document,
        id: RequestId,
        answer: Result<Vec<u8>, String>,
    ) -> Delivery {
        let Some(request) = self.in_flight.remove(&id) else {
            return Delivery::Nothing;
        };
        let items: Vec<Item> = match request.kind {
            RequestKind::IndexBlock(block) => vec![Item::Block(block)],
            // Not asked for here.
            RequestKind::Bytes => Vec::new(),
            RequestKind::Pages { first, last } => (first.0..=last.0)
                .map(|page| Item::Page(PageId(page)))
                .collect(),
        };
        for item in &items {
            self.pending.remove(item);
        }
        let expected = request.range.end - request.range.start;
        let answer = answer.and_then(|bytes| {
            if u64::try_from(bytes.len()) == Ok(expected) {
                Ok(bytes)
            } else {
                Err(format!(
                    "{} bytes came, {expected} were asked for",
                    bytes.len()
                ))
            }
        });
        let bytes = match answer {
            Ok(bytes) => bytes,
            Err(reason) => {
                self.fail(
                    now,
                    &items,
                    &format!(
                        "bytes {}..{}: {reason}",
                        request.range.start, request.range.end
                    ),
                );
                return Delivery::Nothing;
            }
        };
        self.bytes += expected;
        let mut rest = bytes.as_slice();
        for item in items {
            let Item::Page(page) = item else { continue };
            let length = document
                .page_range(page)
                .and_then(|range| usize::try_from(range.end - range.start).ok())
                .unwrap_or(0);
            let Some((own, after)) = rest.split_at_checked(length) else {
                break;
            };
            rest = after;
            if length > 0 {
                self.arrived.insert(page, own.to_vec());
            }
        }
        match request.kind {
            RequestKind::IndexBlock(block) => Delivery::Block(block, bytes),
            RequestKind::Pages { .. } | RequestKind::Bytes => Delivery::Pages,
        }
    }

    /// Notes that items failed, so that they are asked for again after a pause.
    pub fn fail(&mut self, now: f64, items: &[Item], words: &str) {
        for item in items {
            let failures = self
                .retries
                .get(item)
                .map_or(0, |retry| retry.failures)
                .saturating_add(1);
            let pause = (FIRST_PAUSE * 2f64.powi((failures - 1).min(16))).min(LONGEST_PAUSE);
            self.retries.insert(
                *item,
                Retry {
                    failures,
                    not_before: now + pause,
                },
            );
        }
        self.failures += 1;
        if self.words.len() == FAILURES_KEPT {
            self.words.pop_front();
        }
        self.words.push_back(words.to_owned());
    }

    /// Notes that an item came and was valid.
    pub fn succeed(&mut self, item: Item) {
        self.retries.remove(&item);
    }

    /// The first page behind `last` whose bytes wait to be decoded; parents come before children.
    pub fn next_arrived(&self, last: Option<PageId>) -> Option<PageId> {
        let from = last.map_or(Bound::Unbounded, Bound::Excluded);
        let mut behind = self.arrived.range((from, Bound::Unbounded));
        behind.next().map(|(page, _)| *page)
    }

    /// Whether pages wait to be decoded.
    pub fn has_arrived(&self) -> bool {
        !self.arrived.is_empty()
    }

    /// Forgets the bytes of pages that wait and are not wanted any more.
    pub fn want_only(&mut self, is_wanted: impl Fn(PageId) -> bool) {
        self.arrived.retain(|page, _| is_wanted(*page));
    }

    /// The bytes of a page that waits, for decoding; it is not asked for until that has ended.
    pub fn begin_decoding(&mut self, page: PageId) -> Vec<u8> {
        self.decoding.insert(page);
        self.arrived.remove(&page).unwrap_or_default()
    }

    /// Notes that a page was decoded, or will not be.
    pub fn end_decoding(&mut self, page: PageId) {
        self.decoding.remove(&page);
    }

    /// Whether something that failed is waiting for its pause to end.
    pub fn is_pausing(&self) -> bool {
        self.retries.keys().any(|item| !self.pending.contains(item))
    }

    /// Failures in words, oldest first.
    pub fn take_failures(&mut self) -> Vec<String> {
        self.words.drain(..).collect()
    }

    /// Requests under way.
    pub fn in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// Failed fetches so far.
    pub fn failure_count(&self) -> u64 {
        self.failures
    }

    /// Pages asked for so far.
    pub fn requested(&self) -> u64 {
        self.requested
    }

    /// Bytes that came so far.
    pub fn received_bytes(&self) -> u64 {
        self.bytes
    }

    /// What is not wanted any more is not waited for either.
    fn forget_old_failures(&mut self, blocks: &BTreeSet<u32>, pages: &[PageId]) {
        if self.retries.is_empty() {
            return;
        }
        let pages: BTreeSet<&PageId> = pages.iter().collect();
        let pending = &self.pending;
        self.retries.retain(|item, _| {
            pending.contains(item)
                || match item {
                    Item::Block(block) => blocks.contains(block),
                    Item::Page(page) => pages.contains(page),
                }
        });
    }

    fn may_ask(&self, now: f64, item: Item) -> bool {
        let waiting = matches!(item, Item::Page(page)
            if self.arrived.contains_key(&page) || self.decoding.contains(&page));
        !waiting
            && !self.pending.contains(&item)
            && self
                .retries
                .get(&item)
                .is_none_or(|retry| retry.not_before <= now)
    }

    fn ask(
        &mut self,
        kind: RequestKind,
        range: Range<u64>,
        items: impl Iterator<Item = Item>,
    ) -> Option<Request> {
        if range.is_empty() {
            return None;
        }
        self.pending.extend(items);
        let request = Request {
            id: RequestId(self.next_id),
            kind,
            range,
        };
        self.next_id += 1;
        self.in_flight.insert(request.id, request.clone());
        Some(request)
    }
}

/// The longest run of open pages around `page` that lie side by side in the file, within the limits of one request.
fn run_around(
    document: &Document,
    open: &BTreeSet<PageId>,
    page: PageId,
) -> Option<(Range<u32>, Range<u64>)> {
    let place = |page: u32| {
        document
            .page_range(PageId(page))
            .filter(|range| !range.is_empty())
    };
    if !open.contains(&page) {
        return None;
    }
    let mut bytes = place(page.0)?;
    let mut pages = page.0..page.0.checked_add(1)?;
    loop {
        let full = |bytes: &Range<u64>| bytes.end - bytes.start > RUN_BYTES;
        if pages.end - pages.start >= RUN_PAGES {
            break;
        }
        if open.contains(&PageId(pages.end))
            && let Some(next) = place(pages.end).filter(|next| next.start == bytes.end)
            && !full(&(bytes.start..next.end))
        {
            pages.end += 1;
            bytes.end = next.end;
            continue;
        }
        if let Some(before) = pages
            .start
            .checked_sub(1)
            .filter(|before| open.contains(&PageId(*before)))
            && let Some(previous) = place(before).filter(|previous| previous.end == bytes.start)
            && !full(&(previous.start..bytes.end))
        {
            pages.start = before;
            bytes.start = previous.start;
            continue;
        }
        break;
    }
    Some((pages, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::residency::needed_pages;
    use crate::lod::uniform::{Fineness, uniform_cut};
    use crate::testing::{Random, Shape, random_finest};

    fn cube() -> (Document, Vec<u8>, Vec<PageId>) {
        let charts = Shape::Cube.charts(5);
        let (document, source) = Shape::Cube
            .open(&random_finest(&mut Random::new(1), &charts, 2, 5))
            .unwrap();
        let cut = uniform_cut(&document, Fineness::Finest).unwrap();
        let pages = needed_pages(&cut, &document)
            .iter()
            .map(|needed| needed.page)
            .collect();
        (document, source, pages)
    }

    #[test]
    fn every_page_is_asked_for_once_and_arrives_whole() {
        let (document, file, pages) = cube();
        let mut fetcher = Fetcher::default();
        let requests = fetcher.schedule(0.0, 1000, &document, &BTreeSet::new(), &pages);
        assert!(requests.len() < pages.len());
        assert!(
            fetcher
                .schedule(0.0, 1000, &document, &BTreeSet::new(), &pages)
                .is_empty()
        );
        for request in requests {
            let bytes = file[usize::try_from(request.range.start).unwrap()
                ..usize::try_from(request.range.end).unwrap()]
                .to_vec();
            assert_eq!(
                fetcher.deliver(0.0, &document, request.id, Ok(bytes)),
                Delivery::Pages
            );
        }
        let mut sorted = pages.clone();
        sorted.sort_unstable();
        let arrived = std::iter::successors(fetcher.next_arrived(None), |last| {
            fetcher.next_arrived(Some(*last))
        });
        assert_eq!(arrived.collect::<Vec<_>>(), sorted);
        for page in &pages {
            let entry = document.page(*page).unwrap();
            let start = usize::try_from(entry.offset).unwrap();
            assert_eq!(
                fetcher.begin_decoding(*page),
                &file[start..start + entry.length as usize]
            );
        }
        // What is being decoded is not asked for, what was decoded and is still wanted is.
        let ask = |fetcher: &mut Fetcher| {
            fetcher.schedule(0.0, 1000, &document, &BTreeSet::new(), &pages)
        };
        assert!(!fetcher.has_arrived() && ask(&mut fetcher).is_empty());
        fetcher.end_decoding(pages[0]);
        assert_eq!(ask(&mut fetcher).len(), 1);
    }

    #[test]
    fn requests_in_flight_are_limited() {
        let (document, _, pages) = cube();
        let mut fetcher = Fetcher::default();
        let scattered: Vec<PageId> = pages.iter().copied().step_by(2).collect();
        assert_eq!(
            fetcher
                .schedule(0.0, 3, &document, &BTreeSet::new(), &scattered)
                .len(),
            3
        );
        assert!(
            fetcher
                .schedule(0.0, 3, &document, &BTreeSet::new(), &scattered)
                .is_empty()
        );
    }

    #[test]
    fn failures_are_tried_again_ever_more_slowly() {
        let (document, _, pages) = cube();
        let mut fetcher = Fetcher::default();
        let (mut now, mut pauses) = (0.0, Vec::new());
        for answer in [
            Err("refused".to_owned()),
            Ok(Vec::new()),
            Ok(vec![0; 1]),
            Err(String::new()),
        ] {
            let mut start = now;
            let request = loop {
                if let Some(request) = fetcher
                    .schedule(now, 1, &document, &BTreeSet::new(), &pages[..1])
                    .pop()
                {
                    break request;
                }
                now += 0.125;
                start = start.min(now);
            };
            pauses.push(now - start);
            assert_eq!(
                fetcher.deliver(now, &document, request.id, answer),
                Delivery::Nothing
            );
        }
        assert_eq!(pauses, [0.0, 0.25, 0.5, 1.0]);
        assert_eq!(fetcher.take_failures().len(), 4);
        assert!(fetcher.is_pausing() && !fetcher.has_arrived());
    }

    #[test]
    fn answers_to_unknown_requests_are_ignored() {
        let (document, ..) = cube();
        let mut fetcher = Fetcher::default();
        assert_eq!(
            fetcher.deliver(0.0, &document, RequestId(7), Ok(vec![1])),
            Delivery::Nothing
        );
        assert_eq!(fetcher.failure_count(), 0);
    }
}
