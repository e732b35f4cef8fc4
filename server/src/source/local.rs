//! One version of a file on disk.
//!
//! Reads are positioned and never mapped: a mapped file that another process shortens kills the server. Bytes that
//! the kernel has in memory are read without leaving the async worker (`preadv2` with `RWF_NOWAIT`, Linux); where it
//! would have to wait for the disk, a blocking thread waits.

use super::ReadError;
use hyper::body::Bytes;
use std::fs::{File, Metadata};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::SystemTime;

/// What tells one version of a file from the next. Two versions written within the resolution of the
/// file system's clock, in place and to the same length, cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Version {
    length: u64,
    modified: Option<SystemTime>,
    /// Device and inode. Not the time of the inode's last change: replacing a file changes that of the old one.
    identity: (u64, u64),
}

impl Version {
    /// The version now under `path`.
    pub(crate) fn of_path(path: &Path) -> io::Result<Self> {
        std::fs::metadata(path).map(|metadata| Self::of(&metadata))
    }

    fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let identity = {
            use std::os::unix::fs::MetadataExt;
            (metadata.dev(), metadata.ino())
        };
        #[cfg(not(unix))]
        let identity = (0, 0);
        Self {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            identity,
        }
    }
}

/// A handle on one version of a file: a read fails once the file was changed in place.
#[derive(Debug)]
pub(crate) struct LocalFile {
    file: File,
    version: Version,
    serial: u64,
}

/// Files opened so far.
static OPENED: AtomicU64 = AtomicU64::new(0);

impl LocalFile {
    /// Opens `path`. With a `root`, refuses what lies outside of it, wherever links lead.
    pub(crate) fn open(path: &Path, root: Option<&Path>) -> io::Result<Self> {
        let mut options = File::options();
        options.read(true);
        #[cfg(unix)]
        {
            use std::os::unix::fs::OpenOptionsExt;
            // A pipe by the name of a file must not be waited for.
            let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
            options.custom_flags(i32::try_from(flags.bits()).unwrap_or(0));
        }
        let file = options.open(path)?;
        let metadata = file.metadata()?;
        if !metadata.is_file() {
            return Err(io::Error::new(
                io::ErrorKind::NotFound,
                "not a regular file",
            ));
        }
        let version = Version::of(&metadata);
        if let Some(root) = root {
            // What was opened counts, not what the path leads to by now.
            let canonical = path.canonicalize()?;
            if !canonical.starts_with(root) || Version::of_path(&canonical)? != version {
                return Err(io::ErrorKind::NotFound.into());
            }
        }
        Ok(Self {
            file,
            version,
            serial: OPENED.fetch_add(1, Relaxed),
        })
    }

    /// A number that no other handle has.
    pub(super) fn serial(&self) -> u64 {
        self.serial
    }

    pub(crate) fn version(&self) -> Version {
        self.version
    }

    pub(crate) fn length(&self) -> u64 {
        self.version.length
    }

    pub(crate) fn modified(&self) -> Option<SystemTime> {
        self.version.modified
    }

    fn buffer(&self, range: &Range<u64>) -> Result<Vec<u8>, ReadError> {
        let length = self.version.length;
        if range.start > range.end || range.end > length {
            return Err(ReadError::OutOfRange {
                range: range.clone(),
                length,
            });
        }
        let size = usize::try_from(range.end - range.start)
            .map_err(|error| ReadError::from(io::Error::other(error)))?;
        Ok(vec![0; size])
    }

    fn unchanged(&self) -> Result<(), ReadError> {
        let now = Version::of(&self.file.metadata()?);
        if now == self.version {
            Ok(())
        } else {
            Err(ReadError::Changed)
        }
    }

    /// Exactly the bytes of `range`, or an error when the file has changed. Blocks on the disk.
    pub(crate) fn read(&self, range: &Range<u64>) -> Result<Bytes, ReadError> {
        let mut bytes = self.buffer(range)?;
        match read_exact_at(&self.file, &mut bytes, range.start) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
                return Err(ReadError::Changed);
            }
            result => result?,
        }
        self.unchanged()?;
        Ok(Bytes::from(bytes))
    }

    /// As [`LocalFile::read`], but `None` where that would have to wait for the disk.
    #[cfg(target_os = "linux")]
    pub(crate) fn read_now(&self, range: &Range<u64>) -> Option<Result<Bytes, ReadError>> {
        use rustix::io::{Errno, ReadWriteFlags, preadv2};
        let mut bytes = match self.buffer(range) {
            Ok(bytes) => bytes,
            Err(error) => return Some(Err(error)),
        };
        let mut done = 0;
        while done < bytes.len() {
            let mut slices = [io::IoSliceMut::new(&mut bytes[done..])];
            let offset = range.start + done as u64;
            match preadv2(&self.file, &mut slices, offset, ReadWriteFlags::NOWAIT) {
                Ok(0) => return Some(Err(ReadError::Changed)),
                Ok(read) => done += read,
                Err(Errno::INTR) => {}
                // It would wait, or this file system cannot say.
                Err(_) => return None,
            }
        }
        Some(self.unchanged().map(|()| Bytes::from(bytes)))
    }

    #[cfg(not(target_os = "linux"))]
    pub(crate) fn read_now(&self, _range: &Range<u64>) -> Option<Result<Bytes, ReadError>> {
        None
    }

    /// As [`LocalFile::read`], on a thread that may block.
    pub(crate) async fn read_later(
        self: &Arc<Self>,
        range: Range<u64>,
    ) -> Result<Bytes, ReadError> {
        let file = Arc::clone(self);
        tokio::task::spawn_blocking(move || file.read(&range))
            .await
            .unwrap_or_else(|error| Err(ReadError::from(io::Error::other(error))))
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        offset += read as u64;
        bytes = &mut bytes[read..];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(file: &LocalFile, range: Range<u64>) -> Result<Bytes, ReadError> {
        let slow = file.read(&range);
        if let Some(fast) = file.read_now(&range) {
            match (&slow, &fast) {
                (Ok(slow), Ok(fast)) => assert_eq!(slow, fast),
                (Err(_), Err(_)) => {}
                _ => panic!("{slow:?} but {fast:?}"),
            }
        }
        slow
    }

    #[test]
    fn a_replaced_file_is_read_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let [path, new] = ["a", "b"].map(|name| folder.path().join(name));
        std::fs::write(&path, b"old").unwrap();
        std::fs::write(&new, b"new").unwrap();
        let file = LocalFile::open(&path, None).unwrap();
        std::fs::rename(&new, &path).unwrap();
        assert_eq!(both(&file, 0..3).unwrap(), "old");
        assert_ne!(Version::of_path(&path).unwrap(), file.version());
    }

    #[test]
    fn a_file_changed_in_place_is_not_read_any_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123456789").unwrap();
        let longer = LocalFile::open(&path, None).unwrap();
        std::fs::write(&path, b"01234567890").unwrap();
        assert!(matches!(both(&longer, 0..3), Err(ReadError::Changed)));
        let shorter = LocalFile::open(&path, None).unwrap();
        std::fs::write(&path, b"0").unwrap();
        assert!(matches!(both(&shorter, 0..3), Err(ReadError::Changed)));
    }

    #[test]
    fn ranges_outside_the_file_are_refused_before_memory_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123").unwrap();
        let file = LocalFile::open(&path, None).unwrap();
        assert_eq!(both(&file, 1..4).unwrap(), "123");
        assert!(both(&file, 4..4).unwrap().is_empty());
        #[expect(
            clippy::reversed_empty_ranges,
            reason = "what a broken index might say"
        )]
        for range in [0..5, 5..6, 3..2, 0..u64::MAX] {
            assert!(matches!(
                both(&file, range),
                Err(ReadError::OutOfRange { .. })
            ));
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_inside_the_root_only_and_pipes_are_not_waited_for() {
        use std::os::unix::fs::symlink;
        let outer = tempfile::tempdir().unwrap();
        let outer = outer.path().canonicalize().unwrap();
        let root = outer.join("served");
        std::fs::create_dir(&root).unwrap();
        std::fs::write(root.join("a"), b"x").unwrap();
        std::fs::write(outer.join("secret"), b"x").unwrap();
        symlink(root.join("a"), root.join("in")).unwrap();
        symlink(outer.join("secret"), root.join("out")).unwrap();
        symlink(&outer, root.join("up")).unwrap();
        let open = |name: &str| LocalFile::open(&root.join(name), Some(&root));
        assert!(open("a").is_ok() && open("in").is_ok());
        assert!(open("out").is_err() && open("up/secret").is_err() && open(".").is_err());
        let pipe = root.join("pipe");
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).unwrap();
        assert!(open("pipe").is_err());
    }
}
