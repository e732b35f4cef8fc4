//! Blocks of remote files in memory: bounded in bytes, each fetched by one request however many wait for it.
//!
//! The least recently used block goes first. A fetch that began is finished even if everyone who waited is gone, so
//! that a client cannot make the server ask upstream again and again by hanging up.

use super::ReadError;
use crate::metrics::Metrics;
use futures_util::future::{BoxFuture, FutureExt, Shared};
use hyper::body::Bytes;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Names a block: the number of a version of a file, and that of the block in it.
pub(super) type Key = (u64, u64);

type Fetch = Shared<BoxFuture<'static, Result<Bytes, ReadError>>>;

/// The cache.
#[derive(Debug)]
pub(crate) struct BlockCache {
    capacity: u64,
    metrics: Arc<Metrics>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    blocks: Lru,
    fetching: HashMap<Key, Fetch>,
}

/// Blocks, of which the least recently used goes first.
#[derive(Debug, Default)]
pub(super) struct Lru {
    blocks: HashMap<Key, (u64, Bytes)>,
    /// Key by the time of its last use.
    order: BTreeMap<u64, Key>,
    bytes: u64,
    clock: u64,
}

impl BlockCache {
    /// Keeps at most `capacity` bytes.
    pub(crate) fn new(capacity: u64, metrics: Arc<Metrics>) -> Self {
        Self {
            capacity,
            metrics,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Block `key` if it is here.
    pub(super) fn get(&self, key: Key) -> Option<Bytes> {
        let bytes = self.state().blocks.touch(key)?;
        self.metrics.upstream.hits.add();
        Some(bytes)
    }

    /// Block `key`, made by `fetch` unless it is here or being fetched.
    pub(super) async fn get_or_fetch<F>(
        self: &Arc<Self>,
        key: Key,
        fetch: impl FnOnce() -> F,
    ) -> Result<Bytes, ReadError>
    where
        F: Future<Output = Result<Bytes, ReadError>> + Send + 'static,
    {
        let shared = {
            let mut state = self.state();
            if let Some(bytes) = state.blocks.touch(key) {
                self.metrics.upstream.hits.add();
                return Ok(bytes);
            }
            if let Some(running) = state.fetching.get(&key) {
                self.metrics.upstream.joined.add();
                running.clone()
            } else {
                self.metrics.upstream.misses.add();
                let cache = Arc::clone(self);
                let work = fetch();
                let task = tokio::spawn(async move {
                    let result = work.await;
                    cache.finish(key, result.as_ref().ok());
                    result
                });
                let shared = async { task.await.unwrap_or(Err(ReadError::Interrupted)) }
                    .boxed()
                    .shared();
                state.fetching.insert(key, shared.clone());
                shared
            }
        };
        shared.await
    }

    fn finish(&self, key: Key, bytes: Option<&Bytes>) {
        let mut state = self.state();
        state.fetching.remove(&key);
        if let Some(bytes) = bytes {
            state.blocks.insert(key, bytes.clone(), self.capacity);
        }
        (self.metrics.upstream.cached_bytes).store(state.blocks.bytes, Relaxed);
    }

    /// Forgets block `key`, which turned out to be wrong.
    pub(super) fn forget(&self, key: Key) {
        self.state().blocks.remove(key);
    }
}

impl Lru {
    /// Bytes of all blocks.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Block `key`, which was used now.
    pub(super) fn touch(&mut self, key: Key) -> Option<Bytes> {
        let (used, bytes) = self.blocks.get_mut(&key)?;
        self.clock += 1;
        self.order.remove(used);
        *used = self.clock;
        self.order.insert(self.clock, key);
        Some(bytes.clone())
    }

    /// Keeps block `key`, and lets others go until there are at most `capacity` bytes.
    pub(super) fn insert(&mut self, key: Key, bytes: Bytes, capacity: u64) {
        self.remove(key);
        self.clock += 1;
        self.bytes += bytes.len() as u64;
        self.order.insert(self.clock, key);
        self.blocks.insert(key, (self.clock, bytes));
        while self.bytes > capacity
            && let Some((_, oldest)) = self.order.pop_first()
        {
            if let Some((_, bytes)) = self.blocks.remove(&oldest) {
                self.bytes -= bytes.len() as u64;
            }
        }
    }

    /// Lets all blocks go of the version of a file that has number `version`.
    pub(super) fn remove_version(&mut self, version: u64) {
        let of_it = |key: &&Key| key.0 == version;
        let keys: Vec<Key> = self.blocks.keys().filter(of_it).copied().collect();
        for key in keys {
            self.remove(key);
        }
    }

    fn remove(&mut self, key: Key) {
        if let Some((used, bytes)) = self.blocks.remove(&key) {
            self.order.remove(&used);
            self.bytes -= bytes.len() as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    fn cache(capacity: u64) -> Arc<BlockCache> {
        Arc::new(BlockCache::new(capacity, Arc::default()))
    }

    async fn put(cache: &Arc<BlockCache>, key: Key, size: usize) {
        let bytes = Bytes::from(vec![0; size]);
        let fetch = || async move { Ok(bytes) };
        cache.get_or_fetch(key, fetch).await.unwrap();
    }

    #[tokio::test]
    async fn the_least_recently_used_goes_first_and_bytes_are_bounded() {
        let cache = cache(100);
        for block in 0..3 {
            put(&cache, (1, block), 30).await;
        }
        assert!(cache.get((1, 0)).is_some());
        put(&cache, (1, 3), 30).await;
        assert!(cache.get((1, 1)).is_none());
        for block in [0, 2, 3] {
            assert!(cache.get((1, block)).is_some(), "{block}");
        }
        // Larger than everything: given out, not kept.
        put(&cache, (2, 0), 1000).await;
        {
            let kept = &cache.state().blocks;
            assert!(kept.bytes <= 100);
            assert_eq!(kept.order.len(), kept.blocks.len());
        }
        cache.forget((1, 0));
        assert!(cache.get((1, 0)).is_none());
    }

    #[tokio::test]
    async fn many_that_wait_cause_one_fetch_even_if_the_first_hangs_up() {
        let cache = cache(100);
        let fetches = Arc::new(AtomicUsize::new(0));
        let get = || {
            let (cache, fetches) = (Arc::clone(&cache), Arc::clone(&fetches));
            async move {
                let fetch = || async move {
                    fetches.fetch_add(1, Relaxed);
                    tokio::time::sleep(Duration::from_millis(300)).await;
                    Ok(Bytes::from_static(b"block"))
                };
                cache.get_or_fetch((1, 0), fetch).await
            }
        };
        let first = tokio::time::timeout(Duration::from_millis(20), get()).await;
        assert!(first.is_err());
        let all = futures_util::future::join_all((0..10).map(|_| get())).await;
        assert!(all.iter().all(|result| result.as_ref().unwrap() == "block"));
        assert_eq!(fetches.load(Relaxed), 1);
    }

    #[tokio::test]
    async fn a_failure_is_not_kept() {
        let cache = cache(100);
        let fail = || async { Err(ReadError::Interrupted) };
        assert!(cache.get_or_fetch((1, 0), fail).await.is_err());
        put(&cache, (1, 0), 5).await;
        assert!(cache.get((1, 0)).is_some());
    }
}
