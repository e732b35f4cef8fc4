//! The places that files are looked for in.

use super::cache::BlockCache;
use super::hot::HotBlocks;
use super::local::{self, LocalFile};
use super::name::{self, FileName};
use super::open_file::OpenFile;
use super::remote::{self, Store};
use super::{ReadError, Version, scan};
use crate::config::Upstream;
use crate::error::ServerError;
use crate::metrics::Metrics;
use hyper::body::Bytes;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One of the paths and URLs that are served.
#[derive(Debug)]
pub(super) enum Root {
    /// One file, under its own name.
    File { name: FileName, path: PathBuf },
    /// All `.marq` files below a folder; the path is canonical.
    Folder(PathBuf),
    /// Objects.
    Store(Arc<Store>),
}

/// Where a file would be.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Place {
    /// On disk.
    Local(PathBuf),
    /// In the store of this label, below its prefix.
    Remote(String, String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Local(path) => write!(f, "{}", path.display()),
            Self::Remote(store, relative) => write!(f, "{store} {relative}"),
        }
    }
}

impl Root {
    pub(super) async fn new(
        path: &Path,
        upstream: &Upstream,
        cache: &Arc<BlockCache>,
        hot: &Arc<HotBlocks>,
        metrics: &Arc<Metrics>,
    ) -> Result<Self, ServerError> {
        if let Some(url) = path.to_str().filter(|text| remote::is_remote(text)) {
            let store = Store::from_url(url, upstream, cache, metrics)?;
            return Ok(Self::Store(Arc::new(store)));
        }
        let error = |source| ServerError::Path {
            path: path.to_owned(),
            source,
        };
        if std::fs::metadata(path).map_err(error)?.is_dir() {
            return path.canonicalize().map(Self::Folder).map_err(error);
        }
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .filter(|name| name.ends_with(name::EXTENSION))
            .and_then(FileName::parse)
            .ok_or_else(|| ServerError::Kind {
                path: path.to_owned(),
            })?;
        let file = LocalFile::open(path, None).map_err(error)?;
        OpenFile::local(file, hot)
            .await
            .map_err(|source| ServerError::File {
                path: path.to_owned(),
                message: source.to_string(),
            })?;
        let path = std::path::absolute(path).map_err(error)?;
        Ok(Self::File { name, path })
    }

    pub(super) fn is_remote(&self) -> bool {
        matches!(self, Self::Store(_))
    }

    pub(super) fn label(&self) -> String {
        match self {
            Self::File { path, .. } | Self::Folder(path) => path.display().to_string(),
            Self::Store(store) => store.label().to_owned(),
        }
    }

    /// The path of `name`, whether there is a file or not.
    pub(super) fn path_of(&self, wanted: &FileName) -> Option<PathBuf> {
        match self {
            Self::File { name, path } => (name == wanted).then(|| path.clone()),
            Self::Folder(folder) => Some(folder.join(wanted.relative_path())),
            Self::Store(_) => None,
        }
    }

    /// The place of `name`, whether there is anything or not.
    pub(super) fn place_of(&self, wanted: &FileName) -> Option<Place> {
        match self {
            Self::Store(store) => {
                let here = store.single.as_ref().is_none_or(|name| name == wanted);
                here.then(|| Place::Remote(store.label().to_owned(), wanted.relative_path()))
            }
            _ => self.path_of(wanted).map(Place::Local),
        }
    }

    /// Which version is at `place`, which is one of ours; `None` when there is nothing.
    pub(super) async fn version_at(&self, place: &Place) -> Result<Option<Version>, ReadError> {
        match (self, place) {
            (Self::Store(store), Place::Remote(_, relative)) => {
                Ok(store.version_of(relative).await?.map(Version::Remote))
            }
            (_, Place::Local(path)) => match local::Version::of_path(path) {
                Ok(version) => Ok(Some(Version::Local(version))),
                Err(error) if is_absent(&error) => Ok(None),
                Err(error) => Err(error.into()),
            },
            _ => Ok(None),
        }
    }

    /// Opens `version` of what is at `place`; `None` when that may not be served, or is gone.
    pub(super) async fn open(
        &self,
        place: &Place,
        version: &Version,
        hot: &Arc<HotBlocks>,
    ) -> Result<Option<OpenFile>, ReadError> {
        match (self, place, version) {
            (Self::Store(store), Place::Remote(_, relative), Version::Remote(version)) => {
                OpenFile::remote(store, relative, version.clone())
                    .await
                    .map(Some)
            }
            (_, Place::Local(path), _) => {
                let root = match self {
                    Self::Folder(folder) => Some(folder.clone()),
                    _ => None,
                };
                let path = path.clone();
                let open = move || LocalFile::open(&path, root.as_deref());
                let opened = tokio::task::spawn_blocking(open).await;
                match opened.unwrap_or_else(|error| Err(io::Error::other(error))) {
                    Ok(file) => OpenFile::local(file, hot).await.map(Some),
                    Err(error) if is_absent(&error) => Ok(None),
                    Err(error) => Err(error.into()),
                }
            }
            _ => Ok(None),
        }
    }

    /// Everything here that has the name of a file of ours.
    pub(super) async fn list(&self) -> Result<Vec<(FileName, Place, Version)>, ReadError> {
        match self {
            Self::Store(store) => {
                let files = store.list().await?;
                Ok((files.into_iter())
                    .map(|(name, version)| {
                        let place = Place::Remote(store.label().to_owned(), name.relative_path());
                        (name, place, Version::Remote(version))
                    })
                    .collect())
            }
            Self::File { name, path } => Ok(local_version(name, path).into_iter().collect()),
            Self::Folder(folder) => {
                let folder = folder.clone();
                tokio::task::spawn_blocking(move || {
                    (scan::marq_files(&folder).iter())
                        .filter_map(|(name, path)| local_version(name, path))
                        .collect()
                })
                .await
                .map_err(|_interrupted| ReadError::Interrupted)
            }
        }
    }

    /// The sidecar of `name`, at most `limit` bytes.
    pub(super) async fn about(&self, name: &FileName, limit: u64) -> Option<Bytes> {
        let sidecar = |path: &Path| path.with_extension("json");
        if let Self::Store(store) = self {
            if store.single.is_some() {
                return None;
            }
            let relative = sidecar(Path::new(&name.relative_path()));
            return store.small(relative.to_str()?, limit).await;
        }
        let path = sidecar(&self.path_of(name)?);
        let root = match self {
            Self::Folder(folder) => Some(folder.clone()),
            _ => None,
        };
        let read = move || {
            let file = LocalFile::open(&path, root.as_deref()).ok()?;
            let all = 0..file.length();
            (file.length() <= limit)
                .then(|| file.read(&all).ok())
                .flatten()
        };
        tokio::task::spawn_blocking(read).await.ok().flatten()
    }
}

fn is_absent(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::NotFound
            | io::ErrorKind::NotADirectory
            | io::ErrorKind::InvalidFilename
            | io::ErrorKind::IsADirectory
    ) || is_loop(error)
}

/// Whether links lead in a circle.
fn is_loop(error: &io::Error) -> bool {
    #[cfg(unix)]
    let found = error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error());
    #[cfg(not(unix))]
    let found = false;
    found
}

fn local_version(name: &FileName, path: &Path) -> Option<(FileName, Place, Version)> {
    let version = local::Version::of_path(path).ok()?;
    Some((
        name.clone(),
        Place::Local(path.to_owned()),
        Version::Local(version),
    ))
}
