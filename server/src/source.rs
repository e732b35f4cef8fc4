//! What is served: named files, the `.marq` files found in folders, and objects of remote stores.
//!
//! A name is a path relative to the served folder or prefix, `/` between its parts and without the extension; see
//! [`FileName`]. A look-up asks the file system for the file's version, each time, and an object store at most every
//! few seconds. A file that changed is opened anew, so a replaced one is served from the next request on, while
//! responses under way keep the version they began with. A file that is not yet written to its end does not open, and
//! is tried again once it has changed.
//!
//! Folders are thus watched by looking, not by events: this works on network file systems and in containers too, and
//! nothing is listed that was not just seen.

mod cache;
mod hot;
mod local;
mod name;
mod open_file;
mod remote;
mod roots;
mod scan;

pub(crate) use name::FileName;
pub(crate) use open_file::{Facts, OpenFile, PagesError};

use crate::config::Upstream;
use crate::error::ServerError;
use crate::metrics::Metrics;
use cache::BlockCache;
use futures_util::StreamExt;
use futures_util::future::{BoxFuture, FutureExt, Shared};
use hot::HotBlocks;
use hyper::body::Bytes;
use marquetry_format::Error;
use remote::RemoteVersion;
use roots::{Place, Root};
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::{Duration, Instant};

/// Files kept open for the next request; each holds a handle, its charts and the index read so far.
const KEPT_OPEN: usize = 256;
/// Names remembered that no remote source has, so that asking for them again costs nothing.
const KEPT_MISSING: usize = 10_000;
/// Files opened at once for a catalogue.
const OPENED_AT_ONCE: usize = 8;
/// Bytes of a file's sidecar.
const MAX_ABOUT: u64 = 64 * 1024;

/// Bytes cannot be had.
#[derive(Debug, Clone, thiserror::Error)]
pub(crate) enum ReadError {
    #[error("the file was changed while it was read")]
    Changed,
    #[error("bytes {}..{} of {length}", range.start, range.end)]
    OutOfRange { range: Range<u64>, length: u64 },
    #[error("{0}")]
    Io(Arc<std::io::Error>),
    #[error("{0}")]
    Upstream(Arc<object_store::Error>),
    #[error("upstream gave no answer in time")]
    TimedOut,
    #[error(
        "upstream gives neither a strong entity tag nor a date, so versions cannot be told apart"
    )]
    NoVersion,
    #[error("{0}")]
    Corrupt(Arc<Error>),
    #[error("the task was interrupted")]
    Interrupted,
}

impl From<std::io::Error> for ReadError {
    fn from(error: std::io::Error) -> Self {
        Self::Io(Arc::new(error))
    }
}

/// No file could be opened by a name.
#[derive(Debug, Clone, thiserror::Error)]
pub(crate) enum LookUpError {
    #[error("no such file")]
    Unknown,
    #[error("{place}: {source}")]
    Unusable {
        place: String,
        source: ReadError,
        /// Whether it was logged before.
        old: bool,
    },
}

type LookUp = Result<Arc<OpenFile>, LookUpError>;
type Judged = (Version, Option<Arc<Facts>>);
type Flight = Shared<BoxFuture<'static, LookUp>>;

/// Everything that is served.
#[derive(Debug)]
pub(crate) struct Sources {
    roots: Vec<Root>,
    hot: Arc<HotBlocks>,
    refresh: Duration,
    known: RwLock<HashMap<String, Arc<Known>>>,
    /// Remote look-ups under way, by name.
    flights: Mutex<HashMap<String, Flight>>,
    /// What the catalogue says of each version; nothing of one that cannot be served.
    facts: Mutex<BTreeMap<Place, Judged>>,
    clock: AtomicU64,
    start: Instant,
}

/// What is known of a name.
#[derive(Debug)]
struct Known {
    what: What,
    place: Option<Place>,
    /// When upstream was last asked, milliseconds after the start.
    asked: AtomicU64,
    /// Number of the look-up that used it last.
    used: AtomicU64,
}

#[derive(Debug)]
enum What {
    Open(Arc<OpenFile>),
    /// This version cannot be served.
    Unusable(Version, ReadError),
    /// No remote source has it.
    Missing,
}

/// What tells one version from the next.
#[derive(Debug, Clone, PartialEq)]
enum Version {
    Local(local::Version),
    Remote(RemoteVersion),
}

impl OpenFile {
    fn version(&self) -> Option<Version> {
        self.as_local()
            .map(|file| Version::Local(file.version()))
            .or_else(|| self.remote_version().cloned().map(Version::Remote))
    }
}

impl Sources {
    /// Takes the paths and URLs to serve; every file on disk that is named here must open.
    pub(crate) async fn new(
        paths: &[PathBuf],
        upstream: &Upstream,
        metrics: &Arc<Metrics>,
    ) -> Result<Self, ServerError> {
        let cache = Arc::new(BlockCache::new(upstream.cache, Arc::clone(metrics)));
        let hot = Arc::<HotBlocks>::default();
        let mut roots = Vec::new();
        for path in paths {
            roots.push(Root::new(path, upstream, &cache, &hot, metrics).await?);
        }
        Ok(Self {
            roots,
            hot,
            refresh: upstream.refresh,
            known: RwLock::default(),
            flights: Mutex::default(),
            facts: Mutex::default(),
            clock: AtomicU64::new(0),
            start: Instant::now(),
        })
    }

    /// The current version of the file called `name`, with or without the extension.
    pub(crate) async fn open(self: &Arc<Self>, name: &str) -> LookUp {
        match self.open_now(name) {
            Some(file) => Ok(file),
            None => self.open_later(name).await,
        }
    }

    /// As [`Sources::open`], where nothing has to be waited for: the file is open, and unchanged.
    pub(crate) fn open_now(&self, name: &str) -> Option<Arc<OpenFile>> {
        let name = name.strip_suffix(name::EXTENSION).unwrap_or(name);
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        let known = Arc::clone(known.get(name)?);
        let What::Open(file) = &known.what else {
            return None;
        };
        let current = match known.place.as_ref()? {
            Place::Local(path) => {
                file.as_local()?.version() == local::Version::of_path(path).ok()?
            }
            Place::Remote(..) => self.is_fresh(&known),
        };
        if !current {
            return None;
        }
        known.used.store(self.clock.fetch_add(1, Relaxed), Relaxed);
        Some(Arc::clone(file))
    }

    fn now_ms(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    fn is_fresh(&self, known: &Known) -> bool {
        let age = self.now_ms().saturating_sub(known.asked.load(Relaxed));
        u128::from(age) < self.refresh.as_millis()
    }

    async fn open_later(self: &Arc<Self>, name: &str) -> LookUp {
        let name = FileName::parse(name).ok_or(LookUpError::Unknown)?;
        let key = name.to_string();
        if let Some(known) = self.known(&key)
            && matches!(known.what, What::Missing)
            && self.is_fresh(&known)
            && !self.on_disk(&name)
        {
            return Err(LookUpError::Unknown);
        }
        let flight = {
            let mut flights = lock(&self.flights);
            if let Some(flight) = flights.get(&key) {
                flight.clone()
            } else {
                let (sources, text) = (Arc::clone(self), key.clone());
                // A task of its own: a client that hangs up does not undo what the next one waits for.
                let task = tokio::spawn(async move {
                    let result = sources.look_up(&name).await;
                    lock(&sources.flights).remove(&text);
                    result
                });
                let flight = async {
                    task.await.unwrap_or_else(|_| {
                        Err(LookUpError::Unusable {
                            place: "look-up".to_owned(),
                            source: ReadError::Interrupted,
                            old: false,
                        })
                    })
                }
                .boxed()
                .shared();
                flights.insert(key, flight.clone());
                flight
            }
        };
        flight.await
    }

    fn known(&self, name: &str) -> Option<Arc<Known>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        known.get(name).cloned()
    }

    fn on_disk(&self, name: &FileName) -> bool {
        self.roots
            .iter()
            .any(|root| root.path_of(name).is_some_and(|path| path.exists()))
    }

    /// Goes through the roots in order.
    async fn look_up(&self, name: &FileName) -> LookUp {
        let known = self.known(&name.to_string());
        for root in &self.roots {
            let Some(place) = root.place_of(name) else {
                continue;
            };
            let failed = |source, old| LookUpError::Unusable {
                place: place.to_string(),
                source,
                old,
            };
            let version = match root.version_at(&place).await {
                Ok(Some(version)) => version,
                Ok(None) => continue,
                Err(error) => {
                    // What is served already stays in service while upstream does not answer.
                    if let Some(known) = &known
                        && known.place.as_ref() == Some(&place)
                        && let What::Open(file) = &known.what
                        && file.as_local().is_none()
                    {
                        tracing::warn!(%place, %error, "upstream cannot be asked; the version known goes on");
                        known.asked.store(self.now_ms(), Relaxed);
                        return Ok(Arc::clone(file));
                    }
                    return Err(failed(error, false));
                }
            };
            if let Some(known) = &known
                && known.place.as_ref() == Some(&place)
            {
                match &known.what {
                    What::Open(file) if file.version().as_ref() == Some(&version) => {
                        known.asked.store(self.now_ms(), Relaxed);
                        return Ok(Arc::clone(file));
                    }
                    What::Unusable(bad, error) if *bad == version => {
                        return Err(failed(error.clone(), true));
                    }
                    _ => {}
                }
            }
            return match root.open(&place, &version, &self.hot).await {
                Ok(Some(file)) => {
                    let file = Arc::new(file);
                    self.keep(name, Some(place), What::Open(Arc::clone(&file)));
                    Ok(file)
                }
                Ok(None) => continue,
                Err(error) => {
                    // An upstream that fails may recover; a file that is wrong stays so until it changes.
                    if matches!(error, ReadError::Corrupt(_)) {
                        let what = What::Unusable(version, error.clone());
                        self.keep(name, Some(place.clone()), what);
                    }
                    Err(failed(error, false))
                }
            };
        }
        if self.roots.iter().any(Root::is_remote) {
            self.keep(name, None, What::Missing);
        } else {
            let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
            known.remove(&name.to_string());
        }
        Err(LookUpError::Unknown)
    }

    fn keep(&self, name: &FileName, place: Option<Place>, what: What) {
        let new = Known {
            what,
            place,
            asked: AtomicU64::new(self.now_ms()),
            used: AtomicU64::new(self.clock.fetch_add(1, Relaxed)),
        };
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        known.insert(name.to_string(), Arc::new(new));
        for (limit, open) in [(KEPT_OPEN, true), (KEPT_MISSING, false)] {
            let of_kind = |known: &Known| matches!(known.what, What::Open(_)) == open;
            let count = known.values().filter(|known| of_kind(known)).count();
            if count > limit {
                let oldest = (known.iter())
                    .filter(|(_, known)| of_kind(known))
                    .min_by_key(|(_, known)| known.used.load(Relaxed));
                if let Some(name) = oldest.map(|(name, _)| name.clone()) {
                    known.remove(&name);
                }
            }
        }
    }

    /// Takes note that a read found `file` changed: the next look-up asks upstream, however fresh it seems.
    pub(crate) fn doubt(&self, name: &str) {
        let name = name.strip_suffix(name::EXTENSION).unwrap_or(name);
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        known.remove(name);
    }

    /// All files that can be served, by name. One that cannot is logged, once a version.
    pub(crate) async fn list(self: &Arc<Self>) -> BTreeMap<FileName, Arc<Facts>> {
        let mut found = BTreeMap::new();
        for root in &self.roots {
            let files = match root.list().await {
                Ok(files) => files,
                Err(error) => {
                    tracing::warn!(source = root.label(), %error, "cannot be listed");
                    self.opened_from(root)
                }
            };
            let facts = futures_util::stream::iter(files.into_iter().map(
                async |(name, place, version)| {
                    let facts = self.facts(root, &place, version).await?;
                    Some((name, facts))
                },
            ))
            .buffer_unordered(OPENED_AT_ONCE)
            .collect::<Vec<_>>()
            .await;
            for (name, facts) in facts.into_iter().flatten() {
                found.entry(name).or_insert(facts);
            }
        }
        found
    }

    /// The files of a root that cannot be listed which somebody asked for already.
    fn opened_from(&self, root: &Root) -> Vec<(FileName, Place, Version)> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        (known.iter())
            .filter_map(|(name, known)| {
                let name = FileName::parse(name)?;
                let place = known.place.clone()?;
                let What::Open(file) = &known.what else {
                    return None;
                };
                (root.place_of(&name).as_ref() == Some(&place)).then_some((
                    name,
                    place,
                    file.version()?,
                ))
            })
            .collect()
    }

    async fn facts(&self, root: &Root, place: &Place, version: Version) -> Option<Arc<Facts>> {
        if let Some((known, facts)) = lock(&self.facts).get(place)
            && *known == version
        {
            return facts.clone();
        }
        let facts = match root.open(place, &version, &self.hot).await {
            Ok(file) => Some(Arc::new(file?.facts())),
            Err(error) => {
                tracing::warn!(%place, %error, "not served");
                if !matches!(error, ReadError::Corrupt(_)) {
                    return None;
                }
                None
            }
        };
        lock(&self.facts).insert(place.clone(), (version, facts.clone()));
        facts
    }

    /// What stands beside the file called `name`: `NAME.json`.
    pub(crate) async fn about(&self, name: &FileName) -> Option<Bytes> {
        for root in &self.roots {
            if let Some(about) = root.about(name, MAX_ABOUT).await {
                return Some(about);
            }
        }
        None
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What these hold is valid after every single operation.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
