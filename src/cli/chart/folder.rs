//! Several files that appear in a folder when all of them are there.

use anyhow::Context;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The files while they are made, in a temporary folder beside the one they are for. Dropped, it leaves nothing behind.
#[derive(Debug)]
pub(super) struct PendingFolder {
    temporary: TempDir,
    output: PathBuf,
    names: Vec<String>,
}

impl PendingFolder {
    /// Begins to write into `output`, which need not exist.
    ///
    /// # Errors
    /// When `output` is no folder, or the one above it cannot be written to.
    pub(super) fn create(output: &Path) -> anyhow::Result<Self> {
        let name = output.display();
        anyhow::ensure!(
            !output.exists() || output.is_dir(),
            "{name}: this is no folder; name one for the chart's files"
        );
        let above = match output.parent() {
            Some(above) if !above.as_os_str().is_empty() => above,
            _ => Path::new("."),
        };
        let prefix = output.file_name().unwrap_or_default().to_string_lossy();
        let temporary = tempfile::Builder::new()
            .prefix(&format!(".{prefix}."))
            .suffix(".partial")
            .tempdir_in(above)
            .with_context(|| format!("{name}: cannot be written"))?;
        Ok(Self {
            temporary,
            output: output.to_owned(),
            names: Vec::new(),
        })
    }

    /// Where there is room for what is not kept.
    pub(super) fn path(&self) -> &Path {
        self.temporary.path()
    }

    /// Writes a file and syncs it.
    ///
    /// # Errors
    /// When the disk is full or fails.
    pub(super) fn write(&mut self, name: &str, text: &str) -> anyhow::Result<()> {
        let failed = || format!("{}: cannot be written", self.output.join(name).display());
        let path = self.temporary.path().join(name);
        std::fs::write(&path, text).with_context(failed)?;
        std::fs::File::open(&path)
            .and_then(|file| file.sync_all())
            .with_context(failed)?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Gives the files their names, in place of any that have them.
    ///
    /// # Errors
    /// When the folder cannot be made or a name cannot be taken.
    pub(super) fn persist(self) -> anyhow::Result<()> {
        let failed = |path: &Path| format!("{}: cannot be written", path.display());
        std::fs::create_dir_all(&self.output).with_context(|| failed(&self.output))?;
        for name in &self.names {
            let to = self.output.join(name);
            std::fs::rename(self.temporary.path().join(name), &to).with_context(|| failed(&to))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = folder
            .read_dir()
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_together_or_not_at_all() {
        let above = tempfile::tempdir().unwrap();
        let output = above.path().join("chart");
        let mut pending = PendingFolder::create(&output).unwrap();
        pending.write("a.txt", "one").unwrap();
        drop(pending);
        assert!(names(above.path()).is_empty());
        let mut pending = PendingFolder::create(&output).unwrap();
        pending.write("a.txt", "one").unwrap();
        pending.write("b.txt", "two").unwrap();
        std::fs::write(pending.path().join("scratch"), "x").unwrap();
        assert!(!output.exists());
        pending.persist().unwrap();
        assert_eq!(names(above.path()), ["chart"]);
        assert_eq!(names(&output), ["a.txt", "b.txt"]);
    }

    #[test]
    fn other_files_of_the_folder_stay() {
        let output = tempfile::tempdir().unwrap();
        std::fs::write(output.path().join("mine"), "kept").unwrap();
        std::fs::write(output.path().join("a.txt"), "old").unwrap();
        let folder = output.path().join("sub").join("..");
        std::fs::create_dir(output.path().join("sub")).unwrap();
        let mut pending = PendingFolder::create(&folder).unwrap();
        pending.write("a.txt", "new").unwrap();
        pending.persist().unwrap();
        let read = |name| std::fs::read_to_string(output.path().join(name)).unwrap();
        assert_eq!((read("a.txt"), read("mine")), ("new".into(), "kept".into()));
        assert!(PendingFolder::create(&output.path().join("mine")).is_err());
    }
}
