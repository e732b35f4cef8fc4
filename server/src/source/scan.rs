//! Finding the `.marq` files of a folder.
//!
//! Linked folders are not entered, so there are no cycles; linked files count when they stay inside.

use super::name::{EXTENSION, FileName};
use std::path::{Path, PathBuf};

/// Levels of sub-folders searched.
const MAX_DEPTH: usize = 16;
/// Entries looked at, so that serving `/` by mistake does not hang the catalogue.
const MAX_ENTRIES: usize = 100_000;

/// All `.marq` files below `folder` (canonical), by name. What cannot be read is left out.
pub(crate) fn marq_files(folder: &Path) -> Vec<(FileName, PathBuf)> {
    let mut found = Vec::new();
    let mut entries_left = MAX_ENTRIES;
    let mut pending = vec![(folder.to_owned(), String::new(), 0)];
    while let Some((path, prefix, depth)) = pending.pop() {
        let Ok(entries) = std::fs::read_dir(&path) else {
            tracing::warn!(path = %path.display(), "folder cannot be read");
            continue;
        };
        for entry in entries.flatten() {
            if entries_left == 0 {
                tracing::warn!(path = %folder.display(), "more than {MAX_ENTRIES} entries; the rest is not listed");
                found.sort();
                return found;
            }
            entries_left -= 1;
            let (Ok(kind), Some(part)) = (
                entry.file_type(),
                entry.file_name().to_str().map(str::to_owned),
            ) else {
                continue;
            };
            if part.starts_with('.') {
                continue;
            }
            let name = format!("{prefix}{part}");
            if kind.is_dir() {
                if depth < MAX_DEPTH {
                    pending.push((entry.path(), format!("{name}/"), depth + 1));
                }
            } else if part.ends_with(EXTENSION)
                && let Some(name) = FileName::parse(&name)
                && let Ok(path) = entry.path().canonicalize()
                && path.starts_with(folder)
                && path.is_file()
            {
                found.push((name, path));
            }
        }
    }
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_files_in_sub_folders_sorted_and_skips_the_hidden() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap();
        for file in [
            "b.marq",
            "a.marq",
            "sub/c.marq",
            "sub/.d.marq",
            ".git/e.marq",
            "f.txt",
            ".marq",
        ] {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"x").unwrap();
        }
        let names: Vec<_> = marq_files(&root)
            .iter()
            .map(|(name, _)| name.to_string())
            .collect();
        assert_eq!(names, ["a", "b", "sub/c"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_out_of_the_folder_and_cycles_are_not_followed() {
        use std::os::unix::fs::symlink;
        let outer = tempfile::tempdir().unwrap();
        let root = outer.path().canonicalize().unwrap().join("served");
        std::fs::create_dir(&root).unwrap();
        std::fs::write(root.join("a.marq"), b"x").unwrap();
        std::fs::write(outer.path().join("secret.marq"), b"x").unwrap();
        symlink(&root, root.join("again")).unwrap();
        symlink(outer.path().join("secret.marq"), root.join("out.marq")).unwrap();
        symlink(root.join("a.marq"), root.join("b.marq")).unwrap();
        symlink(root.join("nowhere"), root.join("dangling.marq")).unwrap();
        let names: Vec<_> = marq_files(&root)
            .iter()
            .map(|(name, _)| name.to_string())
            .collect();
        assert_eq!(names, ["a", "b"]);
    }
}
