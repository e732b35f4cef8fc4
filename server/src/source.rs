//! What is served: named files, and the `.marq` files found in folders.
//!
//! A name is a path relative to the served folder, `/` between its parts and without the extension; see
//! [`FileName`]. Every look-up asks the file system for the file's [`Version`] and opens it anew when
//! that changed, so a replaced file is served from the next request on, while responses under way keep
//! the handle they began with.
//!
//! Limit: a symbolic link is followed only where it stays inside the served folder; whoever can change
//! that folder *between* the check and the opening can get round it.

mod file;
mod name;
mod scan;

pub(crate) use file::{OpenFile, PagesError};
pub(crate) use name::FileName;

use crate::error::ServerError;
use file::Version;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Open files kept for the next request; each holds a handle, its charts and the index read so far.
const KEPT_OPEN: usize = 64;

/// Everything that is served. Its methods block on the disk.
#[derive(Debug)]
pub(crate) struct Sources {
    roots: Vec<Root>,
    kept: Mutex<Kept>,
}

#[derive(Debug)]
enum Root {
    /// One file, under its own name.
    File { name: FileName, path: PathBuf },
    /// All `.marq` files below a folder; the path is canonical.
    Folder(PathBuf),
}

/// What was learnt of files, by path.
#[derive(Debug, Default)]
struct Kept {
    /// Open files with the time of their last use, in look-ups.
    open: BTreeMap<PathBuf, (u64, Arc<OpenFile>)>,
    look_ups: u64,
    /// What the catalogue says of each version; `None` for a file that cannot be served.
    facts: BTreeMap<PathBuf, (Version, Option<Arc<Facts>>)>,
}

/// What the catalogue says of a file.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) bytes: u64,
    pub(crate) content_id: String,
    pub(crate) metadata: marquetry_format::Metadata,
}

/// No file could be opened by a name.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LookUpError {
    #[error("no such file")]
    Unknown,
    #[error("{}: {source}", path.display())]
    Unusable {
        path: PathBuf,
        source: marquetry_format::Error,
    },
}

impl Sources {
    /// Takes the paths to serve; every file named here must open.
    pub(crate) fn new(paths: &[PathBuf]) -> Result<Self, ServerError> {
        let roots = paths
            .iter()
            .map(|path| Root::new(path))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            roots,
            kept: Mutex::default(),
        })
    }

    /// The current version of the file called `name`.
    pub(crate) fn open(&self, name: &FileName) -> Result<Arc<OpenFile>, LookUpError> {
        let path = self
            .roots
            .iter()
            .find_map(|root| root.path_of(name))
            .ok_or(LookUpError::Unknown)?;
        self.open_path(&path)
            .map_err(|source| LookUpError::Unusable { path, source })
    }

    /// All files that can be served, by name. One that cannot is logged, once a version.
    pub(crate) fn list(&self) -> BTreeMap<FileName, Arc<Facts>> {
        let mut found = BTreeMap::new();
        for root in &self.roots {
            for (name, path) in root.files() {
                if found.contains_key(&name) {
                    continue;
                }
                if let Some(facts) = self.facts(&path) {
                    found.insert(name, facts);
                }
            }
        }
        found
    }

    fn facts(&self, path: &Path) -> Option<Arc<Facts>> {
        let version = Version::of_path(path).ok()?;
        if let Some((known, facts)) = self.kept().facts.get(path)
            && *known == version
        {
            return facts.clone();
        }
        let facts = match self.open_path(path) {
            Ok(file) => Some(Arc::new(file.facts())),
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "not served");
                None
            }
        };
        self.kept()
            .facts
            .insert(path.to_owned(), (version, facts.clone()));
        facts
    }

    /// Opens, or takes what is open if the file has not changed since.
    fn open_path(&self, path: &Path) -> Result<Arc<OpenFile>, marquetry_format::Error> {
        let version = Version::of_path(path).map_err(marquetry_format::SourceError::from)?;
        if let Some(file) = self.kept().recall(path, version) {
            return Ok(file);
        }
        // Without the lock: two requests may open the same file, which costs time but harms nothing.
        let file = Arc::new(OpenFile::open(path)?);
        self.kept().keep(path, &file);
        Ok(file)
    }

    fn kept(&self) -> std::sync::MutexGuard<'_, Kept> {
        // The map is valid after every single operation on it, so a panic elsewhere does no harm.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn recall(&mut self, path: &Path, version: Version) -> Option<Arc<OpenFile>> {
        self.look_ups += 1;
        let (used, file) = self.open.get_mut(path)?;
        *used = self.look_ups;
        (file.version() == version).then(|| Arc::clone(file))
    }

    fn keep(&mut self, path: &Path, file: &Arc<OpenFile>) {
        self.open
            .insert(path.to_owned(), (self.look_ups, Arc::clone(file)));
        while self.open.len() > KEPT_OPEN {
            let oldest = self.open.iter().min_by_key(|(_, (used, _))| *used);
            let Some(path) = oldest.map(|(path, _)| path.clone()) else {
                break;
            };
            self.open.remove(&path);
        }
    }
}

impl Root {
    fn new(path: &Path) -> Result<Self, ServerError> {
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
        OpenFile::open(path).map_err(|source| ServerError::File {
            path: path.to_owned(),
            source,
        })?;
        let path = std::path::absolute(path).map_err(error)?;
        Ok(Self::File { name, path })
    }

    fn path_of(&self, wanted: &FileName) -> Option<PathBuf> {
        match self {
            Self::File { name, path } => (name == wanted).then(|| path.clone()),
            Self::Folder(folder) => {
                let path = folder.join(wanted.relative_path()).canonicalize().ok()?;
                (path.starts_with(folder) && path.is_file()).then_some(path)
            }
        }
    }

    fn files(&self) -> Vec<(FileName, PathBuf)> {
        match self {
            Self::File { name, path } => vec![(name.clone(), path.clone())],
            Self::Folder(folder) => scan::marq_files(folder),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> FileName {
        FileName::parse(text).unwrap()
    }

    #[test]
    fn folders_give_only_what_lies_inside_them() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("served");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        std::fs::write(folder.join("sub/a.marq"), b"x").unwrap();
        std::fs::write(folder.join("not_served.txt"), b"x").unwrap();
        std::fs::write(outer.path().join("secret.marq"), b"x").unwrap();
        let root = Root::new(&folder).unwrap();
        assert!(root.path_of(&name("sub/a.marq")).is_some());
        assert!(root.path_of(&name("sub")).is_none());
        assert!(root.path_of(&name("b.marq")).is_none());
        #[cfg(unix)]
        {
            use std::os::unix::fs::symlink;
            symlink(outer.path().join("secret.marq"), folder.join("out.marq")).unwrap();
            symlink(outer.path(), folder.join("up")).unwrap();
            symlink(folder.join("sub/a.marq"), folder.join("in.marq")).unwrap();
            assert!(root.path_of(&name("out.marq")).is_none());
            assert!(root.path_of(&name("up/secret.marq")).is_none());
            assert!(root.path_of(&name("in.marq")).is_some());
        }
    }

    #[test]
    fn a_file_that_is_no_marq_is_refused_at_start_and_skipped_in_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.marq");
        std::fs::write(&path, b"not a marq file").unwrap();
        assert!(matches!(
            Sources::new(std::slice::from_ref(&path)),
            Err(ServerError::File { .. })
        ));
        let sources = Sources::new(&[folder.path().to_owned()]).unwrap();
        assert!(sources.list().is_empty());
        assert!(matches!(
            sources.open(&name("a")),
            Err(LookUpError::Unusable { .. })
        ));
        assert!(matches!(
            sources.open(&name("b")),
            Err(LookUpError::Unknown)
        ));
    }

    #[test]
    fn what_is_neither_file_nor_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing.marq");
        assert!(matches!(
            Sources::new(&[missing]),
            Err(ServerError::Path { .. })
        ));
        let other = folder.path().join("mesh.ply");
        std::fs::write(&other, b"ply").unwrap();
        assert!(matches!(
            Sources::new(&[other]),
            Err(ServerError::Kind { .. })
        ));
    }
}
