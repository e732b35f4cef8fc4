//! Parts of files on disk that are asked for again and again, in memory.
//!
//! The kernel has them in memory as well, but every read copies them from there: a sixth of what a range of 64 KiB takes.
//! A block comes in once it was asked for [`TOUCHES`] times while few others were, so that a walk through files larger than this does
//! not read blocks for the sake of ranges; and only when the kernel has it, so that nobody waits. The least recently used goes first.
//! A block is of one version of one file, and was read as all is ([`LocalFile::read_now`]); it goes when nobody needs that version any more.

use super::ReadError;
use super::cache::Lru;
use super::local::LocalFile;
use hyper::body::Bytes;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes of a block.
const BLOCK_BYTES: u64 = 1 << 20;
/// Bytes in memory at most.
const CAPACITY_BYTES: u64 = 64 << 20;
/// How often a block is asked for before it comes in.
const TOUCHES: u8 = 8;
/// Blocks whose touches are counted; then all counts begin anew.
const COUNTED: usize = 1024;

/// Blocks of files on disk.
#[derive(Debug, Default)]
pub(crate) struct HotBlocks {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    blocks: Lru,
    touches: HashMap<(u64, u64), u8>,
}

impl HotBlocks {
    /// Where a read from `start` should end at the latest, so that it may copy nothing.
    pub(super) fn end_of_block(start: u64) -> u64 {
        (start / BLOCK_BYTES)
            .saturating_add(1)
            .saturating_mul(BLOCK_BYTES)
    }

    /// As [`LocalFile::read_now`], from memory where the range lies in one block that is here.
    pub(super) fn read_now(
        &self,
        file: &LocalFile,
        range: &Range<u64>,
    ) -> Option<Result<Bytes, ReadError>> {
        match self.block(file, range) {
            Some(bytes) => Some(Ok(bytes)),
            None => file.read_now(range),
        }
    }

    /// `file` is not served any more.
    pub(super) fn forget(&self, file: &LocalFile) {
        self.state().blocks.remove_version(file.serial());
    }

    fn block(&self, file: &LocalFile, range: &Range<u64>) -> Option<Bytes> {
        let number = range.start / BLOCK_BYTES;
        let first = number * BLOCK_BYTES;
        let end = Self::end_of_block(range.start).min(file.length());
        if range.start >= range.end || range.end > end {
            return None;
        }
        let within = |bytes: &Bytes| {
            let at = |place: u64| usize::try_from(place - first).ok();
            let place = at(range.start)?..at(range.end)?;
            bytes
                .get(place.clone())
                .is_some()
                .then(|| bytes.slice(place))
        };
        let key = (file.serial(), number);
        {
            let mut state = self.state();
            if let Some(bytes) = state.blocks.touch(key) {
                return within(&bytes);
            }
            if !state.is_wanted(key) {
                return None;
            }
        }
        let bytes = file.read_now(&(first..end))?.ok()?;
        self.state()
            .blocks
            .insert(key, bytes.clone(), CAPACITY_BYTES);
        within(&bytes)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Counts that block `key` was asked for; whether it was often enough.
    fn is_wanted(&mut self, key: (u64, u64)) -> bool {
        if self.touches.len() >= COUNTED && !self.touches.contains_key(&key) {
            self.touches.clear();
        }
        let count = self.touches.entry(key).or_default();
        *count = count.saturating_add(1);
        if *count < TOUCHES {
            return false;
        }
        self.touches.remove(&key);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes_of(count: u64) -> Vec<u8> {
        (0..count).map(|k| u8::try_from(k % 251).unwrap()).collect()
    }

    #[test]
    fn ranges_are_the_files_before_and_after_their_block_is_here() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let content = bytes_of(BLOCK_BYTES + 1000);
        std::fs::write(&path, &content).unwrap();
        let file = LocalFile::open(&path, None).unwrap();
        let hot = HotBlocks::default();
        let length = file.length();
        let ranges = [
            0..10,
            BLOCK_BYTES - 5..BLOCK_BYTES,
            BLOCK_BYTES - 5..BLOCK_BYTES + 5,
            BLOCK_BYTES..length,
            7..7,
            0..length,
        ];
        for round in 0..2 * TOUCHES {
            for range in &ranges {
                let at = |place: u64| usize::try_from(place).unwrap();
                let place = at(range.start)..at(range.end);
                let read = hot.read_now(&file, range).unwrap().unwrap();
                assert_eq!(read, content[place], "{range:?} in round {round}");
            }
        }
        assert_eq!(hot.state().blocks.bytes(), length);
        for range in [0..length + 1, length..length + 1] {
            assert!(hot.read_now(&file, &range).unwrap().is_err());
        }
    }

    #[test]
    fn what_is_here_is_of_its_version() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let hot = HotBlocks::default();
        for content in ["old", "new"] {
            std::fs::write(folder.path().join("b"), content).unwrap();
            std::fs::rename(folder.path().join("b"), &path).unwrap();
            let file = LocalFile::open(&path, None).unwrap();
            for _ in 0..2 * TOUCHES {
                assert_eq!(hot.read_now(&file, &(0..3)).unwrap().unwrap(), content);
            }
        }
    }

    #[test]
    fn a_file_takes_its_blocks_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let hot = HotBlocks::default();
        let [kept, gone] = ["kept", "gone"].map(|name| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes_of(2 * BLOCK_BYTES)).unwrap();
            let file = LocalFile::open(&path, None).unwrap();
            for start in (0..2).map(|block| block * BLOCK_BYTES) {
                for _ in 0..TOUCHES {
                    hot.read_now(&file, &(start..start + 3)).unwrap().unwrap();
                }
            }
            file
        });
        assert_eq!(hot.state().blocks.bytes(), 4 * BLOCK_BYTES);
        hot.forget(&gone);
        assert_eq!(hot.state().blocks.bytes(), 2 * BLOCK_BYTES);
        hot.forget(&kept);
        assert_eq!(hot.state().blocks.bytes(), 0);
    }

    #[test]
    fn blocks_that_are_asked_for_once_stay_outside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, bytes_of(4 * BLOCK_BYTES)).unwrap();
        let hot = HotBlocks::default();
        for _ in 0..COUNTED {
            // Another version each time, as far as blocks can tell.
            let file = LocalFile::open(&path, None).unwrap();
            hot.read_now(&file, &(0..5)).unwrap().unwrap();
        }
        assert_eq!(hot.state().blocks.bytes(), 0);
        assert!(hot.state().touches.len() <= COUNTED);
    }
}
