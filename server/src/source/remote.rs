//! Objects of an object store, and files of an HTTP origin.
//!
//! Every read states the version that it belongs to (`If-Match`, or `If-Unmodified-Since` where there is no strong
//! entity tag) and checks it in the answer, so an object replaced half-way is an error, not a mixture. A read that
//! fails otherwise is tried once more. What was read is kept in blocks.
//!
//! Limits: an origin that gives neither a strong entity tag nor a date is refused. Plain HTTP servers have no
//! listing that all understand; where `WebDAV`'s is not there, only files that were asked for are listed.

use super::ReadError;
use super::cache::BlockCache;
use super::name::{EXTENSION, FileName};
use crate::config::Upstream;
use crate::error::ServerError;
use crate::metrics::Metrics;
use futures_util::TryStreamExt;
use hyper::body::Bytes;
use object_store::path::Path;
use object_store::{
    ClientOptions, GetOptions, GetRange, ObjectMeta, ObjectStore, ObjectStoreExt, RetryConfig,
};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, SystemTime};
use tokio::sync::Semaphore;

/// Bytes of a block: a few dozen pages, which lie near each other in space as well.
const BLOCK_BYTES: u64 = 256 * 1024;
/// Pause before the second attempt.
const RETRY_PAUSE: Duration = Duration::from_millis(50);
/// Objects of a listing that are looked at.
const MAX_LISTED: usize = 10_000;
/// Schemes of remote sources.
const SCHEMES: [&str; 7] = [
    "s3://", "s3a://", "gs://", "az://", "azure://", "http://", "https://",
];

/// Whether `text` names a remote source.
pub(crate) fn is_remote(text: &str) -> bool {
    SCHEMES.iter().any(|scheme| text.starts_with(scheme))
}

/// A bucket, or a part of one, or an HTTP origin.
pub(crate) struct Store {
    objects: Arc<dyn ObjectStore>,
    /// What is served lies below it, or (with a `single` name) is it.
    prefix: Path,
    pub(crate) single: Option<FileName>,
    label: String,
    cache: Arc<BlockCache>,
    metrics: Arc<Metrics>,
    permits: Semaphore,
    timeout: Duration,
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Store").field(&self.label).finish()
    }
}

/// Version of an object: what upstream says of it.
#[derive(Debug, Clone)]
pub(crate) struct RemoteVersion(ObjectMeta);

impl PartialEq for RemoteVersion {
    fn eq(&self, other: &Self) -> bool {
        // Dates of listings are finer than those of answers.
        let same = match (self.strong_tag(), other.strong_tag()) {
            (Some(tag), Some(other)) => tag == other,
            _ => self.0.e_tag == other.0.e_tag && self.0.last_modified == other.0.last_modified,
        };
        same && self.0.size == other.0.size
    }
}

impl RemoteVersion {
    /// The strong entity tag, without its quotes, which Azure's listings do not give.
    fn strong_tag(&self) -> Option<&str> {
        let tag = self.0.e_tag.as_deref()?;
        (!tag.starts_with("W/")).then(|| tag.trim_matches('"'))
    }

    fn has_date(&self) -> bool {
        self.0.last_modified.timestamp() > 0
    }

    fn can_be_told_apart(&self) -> bool {
        self.strong_tag().is_some() || self.has_date()
    }

    /// Bytes of the whole object.
    pub(crate) fn length(&self) -> u64 {
        self.0.size
    }

    /// Date of the last change.
    pub(crate) fn modified(&self) -> Option<SystemTime> {
        self.has_date().then(|| self.0.last_modified.into())
    }
}

impl Store {
    /// A store by its URL.
    pub(crate) fn from_url(
        url: &str,
        settings: &Upstream,
        cache: &Arc<BlockCache>,
        metrics: &Arc<Metrics>,
    ) -> Result<Self, ServerError> {
        let wrong = |message: String| ServerError::Url {
            url: url.to_owned(),
            message,
        };
        let (objects, path) = build(url, settings).map_err(|error| wrong(error.to_string()))?;
        let single = (path.filename())
            .filter(|name| name.ends_with(EXTENSION))
            .and_then(FileName::parse);
        Ok(Self {
            objects,
            prefix: path,
            single,
            label: url.split('?').next().unwrap_or(url).to_owned(),
            cache: Arc::clone(cache),
            metrics: Arc::clone(metrics),
            permits: Semaphore::new(settings.concurrency),
            timeout: settings.timeout,
        })
    }

    /// What it is called in logs.
    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    /// Where the object called `name` would lie.
    fn location(&self, relative: &str) -> Result<Path, ReadError> {
        if self.single.is_some() {
            return Ok(self.prefix.clone());
        }
        let relative =
            Path::parse(relative).map_err(|error| ReadError::Upstream(Arc::new(error.into())))?;
        Ok(self.prefix.parts().chain(relative.parts()).collect())
    }

    /// The version now upstream of the object at `relative`; `None` when there is none.
    pub(crate) async fn version_of(
        &self,
        relative: &str,
    ) -> Result<Option<RemoteVersion>, ReadError> {
        let location = self.location(relative)?;
        let head = || async { self.objects.head(&location).await };
        match self.ask(head).await {
            Ok(meta) => {
                let version = RemoteVersion(meta);
                if version.can_be_told_apart() {
                    Ok(Some(version))
                } else {
                    Err(ReadError::NoVersion)
                }
            }
            Err(ReadError::Upstream(error)) if is_missing(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// One small object, whole; `None` when there is none or it is larger than `limit`.
    pub(crate) async fn small(&self, relative: &str, limit: u64) -> Option<Bytes> {
        let location = self.location(relative).ok()?;
        let get = || async {
            let options = GetOptions::default().with_range(Some(GetRange::Bounded(0..limit + 1)));
            self.objects
                .get_opts(&location, options)
                .await?
                .bytes()
                .await
        };
        let bytes = self.ask(get).await.ok()?;
        (bytes.len() as u64 <= limit).then_some(bytes)
    }

    /// All objects whose names say that they are ours.
    pub(crate) async fn list(&self) -> Result<Vec<(FileName, RemoteVersion)>, ReadError> {
        if let Some(name) = &self.single {
            let version = self.version_of("").await?;
            return Ok(version
                .map(|version| (name.clone(), version))
                .into_iter()
                .collect());
        }
        let list = || async {
            let mut objects = self.objects.list(Some(&self.prefix));
            let mut found = Vec::new();
            while let Some(meta) = objects.try_next().await? {
                let Some(rest) = meta.location.prefix_match(&self.prefix) else {
                    continue;
                };
                let name: Vec<_> = rest.map(|part| part.as_ref().to_owned()).collect();
                let name = name.join("/");
                if name.ends_with(EXTENSION)
                    && let Some(name) = FileName::parse(&name)
                {
                    if found.len() == MAX_LISTED {
                        tracing::warn!(
                            source = self.label,
                            "more than {MAX_LISTED} files; the rest is not listed"
                        );
                        break;
                    }
                    found.push((name, RemoteVersion(meta)));
                }
            }
            Ok(found)
        };
        self.ask(list).await
    }

    /// One request, one more if it fails for a reason that may pass, within the time that a request may take.
    async fn ask<T, F>(&self, request: impl Fn() -> F) -> Result<T, ReadError>
    where
        F: Future<Output = object_store::Result<T>>,
    {
        let _permit = self
            .permits
            .acquire()
            .await
            .map_err(|_closed| ReadError::Interrupted)?;
        let metrics = &self.metrics.upstream;
        let mut again = true;
        loop {
            metrics.requests.add();
            let error = match tokio::time::timeout(self.timeout, request()).await {
                Ok(Ok(value)) => return Ok(value),
                Ok(Err(object_store::Error::Precondition { .. })) => {
                    metrics.changed.add();
                    return Err(ReadError::Changed);
                }
                Ok(Err(error)) => ReadError::Upstream(Arc::new(error)),
                Err(_) => ReadError::TimedOut,
            };
            if matches!(&error, ReadError::Upstream(error) if is_missing(error)) {
                return Err(error);
            }
            metrics.errors.add();
            if !std::mem::take(&mut again) {
                return Err(error);
            }
            metrics.retries.add();
            tokio::time::sleep(RETRY_PAUSE).await;
        }
    }
}

fn is_missing(error: &object_store::Error) -> bool {
    matches!(error, object_store::Error::NotFound { .. })
}

/// One version of one object.
#[derive(Debug)]
pub(crate) struct RemoteObject {
    store: Arc<Store>,
    location: Path,
    version: RemoteVersion,
    /// Names the version in the cache.
    number: u64,
}

impl RemoteObject {
    /// `version` of the object at `relative`.
    pub(crate) fn new(
        store: &Arc<Store>,
        relative: &str,
        version: RemoteVersion,
    ) -> Result<Self, ReadError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Ok(Self {
            store: Arc::clone(store),
            location: store.location(relative)?,
            version,
            number: NEXT.fetch_add(1, Relaxed),
        })
    }

    pub(crate) fn version(&self) -> &RemoteVersion {
        &self.version
    }

    /// Exactly the bytes of `range`. No copy is made where one block holds them.
    pub(crate) async fn read(self: &Arc<Self>, range: Range<u64>) -> Result<Bytes, ReadError> {
        if range.start > range.end || range.end > self.version.length() {
            return Err(ReadError::OutOfRange {
                range,
                length: self.version.length(),
            });
        }
        let (first, last) = blocks(&range);
        let mut whole = Vec::new();
        for number in first..=last {
            let block = self.block(number).await?;
            let part = part_of_block(&range, number, &block).ok_or(ReadError::Changed)?;
            if first == last {
                return Ok(part);
            }
            if whole.is_empty() {
                let length = usize::try_from(range.end - range.start).unwrap_or(0);
                whole.reserve_exact(length);
            }
            whole.extend_from_slice(&part);
        }
        Ok(Bytes::from(whole))
    }

    /// As [`RemoteObject::read`], where one block in memory holds the bytes.
    pub(crate) fn read_now(&self, range: &Range<u64>) -> Option<Bytes> {
        let (first, last) = blocks(range);
        if first != last || range.start > range.end {
            return None;
        }
        let block = self.store.cache.get((self.number, first))?;
        part_of_block(range, first, &block)
    }

    /// Forgets the blocks of `range`, which turned out to be wrong.
    pub(crate) fn forget(&self, range: &Range<u64>) {
        let (first, last) = blocks(range);
        for block in first..=last {
            self.store.cache.forget((self.number, block));
        }
    }

    /// The end of the block that holds byte `start`.
    pub(crate) fn end_of_block(start: u64) -> u64 {
        (start / BLOCK_BYTES + 1).saturating_mul(BLOCK_BYTES)
    }

    async fn block(self: &Arc<Self>, number: u64) -> Result<Bytes, ReadError> {
        let object = Arc::clone(self);
        let fetch = || async move { object.fetch(number).await };
        let cache = &self.store.cache;
        cache.get_or_fetch((self.number, number), fetch).await
    }

    async fn fetch(&self, number: u64) -> Result<Bytes, ReadError> {
        let start = number.saturating_mul(BLOCK_BYTES);
        let range = start..start.saturating_add(BLOCK_BYTES).min(self.version.length());
        if range.is_empty() {
            return Ok(Bytes::new());
        }
        let get = || async {
            let mut options = GetOptions {
                range: Some(GetRange::Bounded(range.clone())),
                ..GetOptions::default()
            };
            match self.version.strong_tag() {
                Some(tag) => options.if_match = Some(format!("\"{tag}\"")),
                None => options.if_unmodified_since = Some(self.version.0.last_modified),
            }
            let result = self.store.objects.get_opts(&self.location, options).await?;
            // An upstream that does not know the condition ignores it.
            if RemoteVersion(result.meta.clone()) != self.version {
                return Err(object_store::Error::Precondition {
                    path: self.location.to_string(),
                    source: "the object is another one".into(),
                });
            }
            let answered = result.range.clone();
            let bytes = result.bytes().await?;
            if answered != range || bytes.len() as u64 != range.end - range.start {
                return Err(object_store::Error::Generic {
                    store: "upstream",
                    source: format!("{} bytes of {answered:?} for {range:?}", bytes.len()).into(),
                });
            }
            Ok(bytes)
        };
        let bytes = self.store.ask(get).await?;
        self.store
            .metrics
            .upstream
            .bytes
            .add_many(bytes.len() as u64);
        Ok(bytes)
    }
}

fn blocks(range: &Range<u64>) -> (u64, u64) {
    let last = range.end.saturating_sub(1).max(range.start);
    (range.start / BLOCK_BYTES, last / BLOCK_BYTES)
}

fn part_of_block(range: &Range<u64>, number: u64, block: &Bytes) -> Option<Bytes> {
    let at = |byte: u64| usize::try_from(byte.saturating_sub(number * BLOCK_BYTES)).ok();
    let start = at(range.start)?;
    let end = at(range.end)?.min(usize::try_from(BLOCK_BYTES).ok()?);
    (start <= end && end <= block.len()).then(|| block.slice(start..end))
}

/// Makes the client for `url`, and the path within it.
fn build(url: &str, settings: &Upstream) -> object_store::Result<(Arc<dyn ObjectStore>, Path)> {
    let wrong = |message: String| object_store::Error::Generic {
        store: "URL",
        source: message.into(),
    };
    let retry = RetryConfig {
        // One retry in all, and that is ours.
        max_retries: 0,
        ..RetryConfig::default()
    };
    let mut client = ClientOptions::new()
        .with_timeout(settings.timeout)
        .with_connect_timeout(settings.timeout.min(Duration::from_secs(5)));
    let mut options = settings.options.clone();
    if url.starts_with("http://")
        || options
            .remove("allow_http")
            .is_some_and(|value| value == "true")
    {
        client = client.with_allow_http(true);
    }
    let (scheme, rest) = url.split_once("://").unwrap_or_default();
    let (bucket, path) = rest.split_once('/').unwrap_or((rest, ""));
    if bucket.is_empty() {
        return Err(wrong("no bucket or host in it".to_owned()));
    }
    let root = format!("{scheme}://{bucket}");
    let path = Path::from_url_path(path.trim_matches('/'))?;
    macro_rules! with_options {
        ($builder:expr) => {{
            let mut builder = $builder;
            for (name, value) in &options {
                // Options of another kind of store are none of ours.
                if let Ok(key) = name.to_ascii_lowercase().parse() {
                    builder = builder.with_config(key, value);
                }
            }
            builder
                .with_retry(retry)
                .with_client_options(client)
                .with_url(root)
                .build()
                .map(|store| Arc::new(store) as Arc<dyn ObjectStore>)?
        }};
    }
    let store = match scheme {
        "s3" | "s3a" => with_options!(object_store::aws::AmazonS3Builder::from_env()),
        "gs" => with_options!(object_store::gcp::GoogleCloudStorageBuilder::from_env()),
        "az" | "azure" => with_options!(object_store::azure::MicrosoftAzureBuilder::from_env()),
        "http" | "https" => with_options!(object_store::http::HttpBuilder::new()),
        _ => return Err(wrong(format!("{scheme}:// is not known"))),
    };
    Ok((store, path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_cut_into_blocks() {
        let block = BLOCK_BYTES;
        assert_eq!(blocks(&(0..1)), (0, 0));
        assert_eq!(blocks(&(0..block)), (0, 0));
        assert_eq!(blocks(&(0..block + 1)), (0, 1));
        assert_eq!(blocks(&(block..block)), (1, 1));
        let bytes = Bytes::from(vec![7; usize::try_from(block).unwrap()]);
        let part = part_of_block(&(block - 2..block + 2), 0, &bytes).unwrap();
        assert_eq!(part.len(), 2);
        let part = part_of_block(&(block - 2..block + 2), 1, &bytes).unwrap();
        assert_eq!(part.len(), 2);
        let short = bytes.slice(..10);
        assert!(part_of_block(&(5..11), 0, &short).is_none());
        assert_eq!(part_of_block(&(5..10), 0, &short).unwrap().len(), 5);
    }

    #[test]
    fn urls_are_told_from_paths() {
        for url in ["s3://b/p", "gs://b", "az://c/x.marq", "https://h/a.marq"] {
            assert!(is_remote(url), "{url}");
        }
        for path in ["scans", "/s3:/b", "./s3", "s3:b", "C:\\scans"] {
            assert!(!is_remote(path), "{path}");
        }
    }
}
