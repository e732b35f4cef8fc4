//! A file that appears under its name complete, or not at all.
//!
//! The bytes go to a temporary file in the same folder, `.NAME.XXXXXX.partial`, which is synced and then renamed. It
//! stays locked as long as the process that writes it lives, so whoever next writes the same output can tell what a
//! killed process left behind, and removes it.
//!
//! Limit: where the file system knows no locks, nothing is removed.

use std::ffi::{OsStr, OsString};
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile};

/// Ends the name of a temporary file.
const SUFFIX: &str = ".partial";
/// Characters between the output's name and [`SUFFIX`].
const RANDOM: usize = 6;
/// Bytes of the output's name that are repeated; names may have 255 in all.
const REPEATED: usize = 200;
/// Attempts, each foiled by another process that cleans up at this very moment.
const ATTEMPTS: usize = 16;

/// The file while it is written. Dropped, it leaves nothing behind.
#[derive(Debug)]
pub struct PendingFile {
    file: NamedTempFile,
    output: PathBuf,
}

impl PendingFile {
    /// Begins to write `output`, and removes what killed processes left of it.
    ///
    /// # Errors
    /// When the folder cannot be written to, or `output` is a folder.
    pub fn create(output: &Path) -> io::Result<Self> {
        let Some(name) = output.file_name().filter(|_| !output.is_dir()) else {
            return Err(io::Error::new(
                io::ErrorKind::IsADirectory,
                "this is a folder; name a file",
            ));
        };
        let folder = folder_of(output);
        let prefix = prefix(name);
        remove_stale(folder, &prefix);
        let mut builder = Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
        #[cfg(unix)]
        let permissions = {
            use std::os::unix::fs::PermissionsExt;
            // As public as the umask lets it be, like any other file.
            std::fs::Permissions::from_mode(0o666)
        };
        #[cfg(unix)]
        builder.permissions(permissions);
        for _ in 0..ATTEMPTS {
            let file = builder.tempfile_in(folder)?;
            if lock(file.as_file()) && file.path().exists() {
                return Ok(Self {
                    file,
                    output: output.to_owned(),
                });
            }
        }
        Err(io::Error::other(
            "another process keeps removing its temporary files",
        ))
    }

    /// The file, to be written to.
    pub fn as_file_mut(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// Where the bytes are until [`Self::persist`].
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Syncs the bytes and gives the file its name, in place of any file that has it.
    ///
    /// # Errors
    /// When the disk is full, fails, or the name cannot be taken.
    pub fn persist(self) -> io::Result<()> {
        self.file.as_file().sync_all()?;
        self.file.persist(&self.output).map_err(|e| e.error)?;
        // The name is safe from a power cut once the folder is synced too; not every system can do that.
        if let Ok(folder) = File::open(folder_of(&self.output)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

fn folder_of(output: &Path) -> &Path {
    match output.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn prefix(name: &OsStr) -> OsString {
    let mut prefix = OsString::from(".");
    if name.len() <= REPEATED {
        prefix.push(name);
    } else {
        // A character has at most four bytes.
        let start: String = name.to_string_lossy().chars().take(REPEATED / 4).collect();
        prefix.push(start);
    }
    prefix.push(".");
    prefix
}

/// Whether the lock was taken, as far as the file system has locks.
fn lock(file: &File) -> bool {
    !matches!(file.try_lock(), Err(TryLockError::WouldBlock))
}

/// Removes temporary files that begin with `prefix` and that no process holds. What cannot be removed stays.
fn remove_stale(folder: &Path, prefix: &OsStr) {
    let length = prefix.len() + RANDOM + SUFFIX.len();
    let ours = |name: &OsStr| {
        let bytes = name.as_encoded_bytes();
        name.len() == length
            && bytes.starts_with(prefix.as_encoded_bytes())
            && bytes.ends_with(SUFFIX.as_bytes())
    };
    let Ok(entries) = folder.read_dir() else {
        return;
    };
    for entry in entries.flatten().filter(|e| ours(&e.file_name())) {
        let path = entry.path();
        // Locked while it is removed: its owner, if it is only just beginning, then sees that it must start again.
        if let Ok(file) = File::open(&path)
            && file.try_lock().is_ok()
            && std::fs::remove_file(&path).is_ok()
        {
            tracing::info!(path = %path.display(), "removed what a killed process left behind");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = folder
            .read_dir()
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_has_its_name_only_when_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.marq");
        std::fs::write(&path, b"old").unwrap();
        let mut pending = PendingFile::create(&path).unwrap();
        pending.as_file_mut().write_all(b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        pending.persist().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.marq"]);
    }

    #[test]
    fn a_file_given_up_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        drop(PendingFile::create(&folder.path().join("a.marq")).unwrap());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn leftovers_of_this_output_alone_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let stale = [".a.marq.abcdef.partial", ".a.marq.012345.partial"];
        let others = [
            ".a.marq.partial",
            ".a.marq.abcdefg.partial",
            ".b.marq.abcdef.partial",
            "a.marq.abcdef.partial",
        ];
        for name in stale.iter().chain(&others) {
            std::fs::write(folder.path().join(name), b"x").unwrap();
        }
        drop(PendingFile::create(&folder.path().join("a.marq")).unwrap());
        let mut left = others.map(String::from);
        left.sort();
        assert_eq!(names(folder.path()), left);
    }

    #[test]
    fn a_file_that_is_being_written_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.marq");
        let first = PendingFile::create(&path).unwrap();
        let second = PendingFile::create(&path).unwrap();
        assert!(first.path().exists());
        first.persist().unwrap();
        second.persist().unwrap();
        assert_eq!(names(folder.path()), ["a.marq"]);
    }

    #[test]
    fn long_names_and_folders_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("ä".repeat(120));
        PendingFile::create(&long).unwrap().persist().unwrap();
        assert!(long.exists());
        assert!(PendingFile::create(folder.path()).is_err());
        assert!(PendingFile::create(&folder.path().join("absent/a.marq")).is_err());
    }
}
