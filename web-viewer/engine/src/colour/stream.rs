//! Fetching the colour directory, index blocks and tiles.
//!
//! What fails is asked for again, after pauses that double up to a limit.

use crate::residency::fetch::{Request, RequestId, RequestKind};
use marquetry_format::{ColourIndex, PageId, TileId};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Set in the ids of these requests, and in no other's.
const ID_BIT: u64 = 1 << 52;
/// Most bytes of tiles in one request, unless a single one is longer.
const RUN_BYTES: u64 = 96 << 10;
/// Most tiles in one request.
const RUN_TILES: u32 = 64;
/// Most tiles that wait to be decoded before no more are asked for.
const MOST_WAITING: usize = 256;
/// Seconds before the first retry, and between later ones.
const FIRST_PAUSE: f64 = 0.25;
const LONGEST_PAUSE: f64 = 30.0;

/// Something to fetch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    /// The directory.
    Directory,
    /// An index block.
    Block(u32),
    /// A tile.
    Tile(TileId),
}

#[derive(Debug, Clone, Copy)]
struct Retry {
    failures: i32,
    not_before: f64,
}

#[derive(Debug)]
struct Flight {
    items: Vec<Item>,
    range: Range<u64>,
}

/// Requests under way, and tiles that wait to be decoded.
#[derive(Debug, Default)]
pub struct TileStream {
    in_flight: BTreeMap<u64, Flight>,
    pending: BTreeSet<Item>,
    retries: BTreeMap<Item, Retry>,
    arrived: BTreeMap<TileId, Vec<u8>>,
    decoding: BTreeSet<TileId>,
    words: Vec<String>,
    next_id: u64,
    failures: u64,
    requested: u64,
    bytes: u64,
}

impl TileStream {
    /// Whether a request is one of these.
    pub fn owns(id: RequestId) -> bool {
        id.0 & ID_BIT != 0
    }

    /// Requests for what is wanted and neither under way nor pausing, until `limit` are under way. `tiles` are in order of
    /// importance and have index entries.
    pub fn schedule(
        &mut self,
        now: f64,
        limit: usize,
        index: &ColourIndex,
        blocks: &BTreeSet<u32>,
        tiles: &[TileId],
    ) -> Vec<Request> {
        let mut requests = Vec::new();
        if !index.has_directory() {
            if self.may_ask(now, Item::Directory) {
                let range = index.directory_range();
                requests.extend(self.ask(RequestKind::Bytes, range, vec![Item::Directory]));
            }
            return requests;
        }
        for &block in blocks {
            let item = Item::Block(block);
            if self.in_flight.len() < limit && self.may_ask(now, item) {
                let range = index.block_range(block);
                requests.extend(self.ask(RequestKind::Bytes, range, vec![item]));
            }
        }
        let mut open: BTreeSet<TileId> = tiles
            .iter()
            .copied()
            .filter(|&tile| self.may_ask(now, Item::Tile(tile)))
            .collect();
        for &tile in tiles {
            if self.in_flight.len() >= limit || self.arrived.len() >= MOST_WAITING {
                break;
            }
            let Some((run, range)) = run_from(index, &open, tile) else {
                continue;
            };
            let items: Vec<TileId> = (run.start..run.end).map(TileId).collect();
            for tile in &items {
                open.remove(tile);
            }
            let numbers = [run.start, run.end - 1].map(|tile| index.page_number(TileId(tile)));
            let [Some(first), Some(last)] = numbers else {
                continue;
            };
            self.requested += items.len() as u64;
            let kind = RequestKind::Pages {
                first: PageId(first),
                last: PageId(last),
            };
            requests.extend(self.ask(kind, range, items.into_iter().map(Item::Tile).collect()));
        }
        requests
    }

    /// Takes the answer to a request. What is not a tile is given back with its bytes.
    pub fn deliver(
        &mut self,
        now: f64,
        index: &ColourIndex,
        id: RequestId,
        answer: Result<Vec<u8>, String>,
    ) -> Option<(Item, Vec<u8>)> {
        let Flight { items, range } = self.in_flight.remove(&id.0)?;
        for item in &items {
            self.pending.remove(item);
        }
        let expected = range.end - range.start;
        let answer = answer.and_then(|bytes| {
            let count = bytes.len() as u64;
            if count == expected {
                Ok(bytes)
            } else {
                Err(format!("{count} bytes came, {expected} were asked for"))
            }
        });
        let bytes = match answer {
            Ok(bytes) => bytes,
            Err(reason) => {
                let words = format!("bytes {}..{}: {reason}", range.start, range.end);
                self.fail(now, &items, words);
                return None;
            }
        };
        self.bytes += expected;
        let mut rest = bytes.as_slice();
        for item in &items {
            let Item::Tile(tile) = *item else {
                return Some((*item, bytes));
            };
            let length = index.tile(tile).map_or(0, |entry| entry.length);
            let length = usize::try_from(length).unwrap_or(usize::MAX);
            let Some((own, after)) = rest.split_at_checked(length) else {
                break;
            };
            rest = after;
            self.arrived.insert(tile, own.to_vec());
        }
        None
    }

    /// Notes that items failed.
    pub fn fail(&mut self, now: f64, items: &[Item], words: String) {
        for item in items {
            let failures = self.retries.get(item).map_or(0, |retry| retry.failures);
            let pause = (FIRST_PAUSE * 2f64.powi(failures.min(16))).min(LONGEST_PAUSE);
            let retry = Retry {
                failures: failures.saturating_add(1),
                not_before: now + pause,
            };
            self.retries.insert(*item, retry);
        }
        self.failures += 1;
        if self.words.len() < 32 {
            self.words.push(words);
        }
    }

    /// Notes that an item came and was valid.
    pub fn succeed(&mut self, item: Item) {
        self.retries.remove(&item);
    }

    /// The first tile that waits to be decoded.
    pub fn first_arrived(&self) -> Option<TileId> {
        self.arrived.keys().next().copied()
    }

    /// Forgets the bytes of a tile that waits.
    pub fn forget(&mut self, tile: TileId) {
        self.arrived.remove(&tile);
    }

    /// The bytes of a tile that waits, for decoding; it is not asked for until that has ended.
    pub fn begin_decoding(&mut self, tile: TileId) -> Vec<u8> {
        self.decoding.insert(tile);
        self.arrived.remove(&tile).unwrap_or_default()
    }

    /// Notes that a tile was decoded, or will not be.
    pub fn end_decoding(&mut self, tile: TileId) {
        self.decoding.remove(&tile);
    }

    /// Whether tiles wait to be decoded.
    pub fn has_arrived(&self) -> bool {
        !self.arrived.is_empty()
    }

    /// Whether something that failed waits for its pause to end.
    pub fn is_pausing(&self) -> bool {
        self.retries.keys().any(|item| !self.pending.contains(item))
    }

    /// Forgets failures of tiles that are not wanted any more.
    pub fn want_only(&mut self, is_wanted: impl Fn(TileId) -> bool) {
        self.retries
            .retain(|item, _| !matches!(item, Item::Tile(tile) if !is_wanted(*tile)));
    }

    /// Failures in words, oldest first.
    pub fn take_failures(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    /// Failed fetches so far.
    pub fn failure_count(&self) -> u64 {
        self.failures
    }

    /// Tiles asked for so far.
    pub fn requested(&self) -> u64 {
        self.requested
    }

    /// Bytes that came so far.
    pub fn received_bytes(&self) -> u64 {
        self.bytes
    }

    fn may_ask(&self, now: f64, item: Item) -> bool {
        let waiting = matches!(item, Item::Tile(tile)
            if self.arrived.contains_key(&tile) || self.decoding.contains(&tile));
        let retry = self.retries.get(&item);
        !waiting
            && !self.pending.contains(&item)
            && retry.is_none_or(|retry| retry.not_before <= now)
    }

    fn ask(&mut self, kind: RequestKind, range: Range<u64>, items: Vec<Item>) -> Option<Request> {
        if range.is_empty() {
            return None;
        }
        let id = ID_BIT | self.next_id;
        self.next_id += 1;
        self.pending.extend(&items);
        let flight = Flight {
            items,
            range: range.clone(),
        };
        self.in_flight.insert(id, flight);
        Some(Request {
            id: RequestId(id),
            kind,
            range,
        })
    }
}

/// Open tiles from `tile` on that lie side by side in the file, and their bytes.
fn run_from(
    index: &ColourIndex,
    open: &BTreeSet<TileId>,
    tile: TileId,
) -> Option<(Range<u32>, Range<u64>)> {
    if !open.contains(&tile) {
        return None;
    }
    let mut range = index.tile_range(tile)?;
    let mut run = tile.0..tile.0.checked_add(1)?;
    while run.end - run.start < RUN_TILES && open.contains(&TileId(run.end)) {
        let next = index.tile_range(TileId(run.end))?;
        if next.start != range.end || next.end - range.start > RUN_BYTES {
            break;
        }
        (run.end, range.end) = (run.end + 1, next.end);
    }
    Some((run, range))
}
