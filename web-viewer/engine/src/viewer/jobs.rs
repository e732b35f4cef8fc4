//! Jobs of a viewer: handed out, under way, and come back.

use super::Viewer;
use crate::decode::{DecodeJob, DecodeResult, Decoded, Decoding, JobId, JobKind, Work};
use crate::residency::textures::{TEXTURE_BYTES, Ticket};
use marquetry_format::{PageId, TileId};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes, decoded, that jobs of one kind may hold, from the time they are handed out until their results are in place.
const MOST_BYTES_A_KIND: u64 = 8 << 20;

/// What a job is for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Subject {
    Page(PageId),
    Tile(TileId),
    Texture(Ticket),
}

impl Subject {
    fn kind(self) -> JobKind {
        match self {
            Self::Page(_) => JobKind::Mesh,
            Self::Tile(_) | Self::Texture(_) => JobKind::Image,
        }
    }
}

/// A job that was handed out.
#[derive(Debug, Clone, Copy)]
struct Running {
    subject: Subject,
    bytes: u64,
}

/// Jobs under way and results that wait.
#[derive(Debug, Default)]
pub(super) struct Jobs {
    pub(super) decoding: Decoding,
    running: BTreeMap<JobId, Running>,
    /// How many of those that run are meshes and images, and what they take.
    counts: [usize; 2],
    bytes: [u64; 2],
    finished: VecDeque<DecodeResult>,
    /// Whether of an odd number of images the odd one was last a tile.
    was_tile: bool,
}

/// The number of the next job, of any viewer: what comes too late for one must not fit another.
static NEXT: AtomicU64 = AtomicU64::new(0);

impl Jobs {
    /// A job for `subject`, which takes `bytes` decoded.
    pub(super) fn begin(&mut self, subject: Subject, bytes: u64, work: Work) -> DecodeJob {
        let id = JobId(NEXT.fetch_add(1, Ordering::Relaxed));
        self.counts[subject.kind() as usize] += 1;
        self.bytes[subject.kind() as usize] += bytes;
        self.running.insert(id, Running { subject, bytes });
        DecodeJob { id, work }
    }

    /// What the job was for; `None` for one that is not under way.
    fn end(&mut self, id: JobId) -> Option<Subject> {
        let Running { subject, bytes } = self.running.remove(&id)?;
        self.counts[subject.kind() as usize] -= 1;
        self.bytes[subject.kind() as usize] -= bytes;
        Some(subject)
    }

    /// Bytes that more jobs of a kind may take.
    fn room(&self, kind: JobKind) -> u64 {
        MOST_BYTES_A_KIND.saturating_sub(self.bytes[kind as usize])
    }

    /// Whether an update has a point, meshes or images waiting to be decoded or not.
    pub(super) fn need_update(&self, waits: [bool; 2]) -> bool {
        let waits_for_update = match self.decoding {
            Decoding::Inline => waits.contains(&true),
            // What runs makes itself heard; without it, the next update may find what to do.
            Decoding::Elsewhere => {
                let mut idle = waits.iter().zip(self.counts);
                idle.any(|(waits, running)| *waits && running == 0)
            }
        };
        waits_for_update || !self.finished.is_empty()
    }
}

impl Viewer {
    /// Says where pages and images are decoded from now on.
    pub fn set_decoding(&mut self, decoding: Decoding) {
        self.jobs.decoding = decoding;
    }

    /// At most `most` jobs of a kind, where decoding is done elsewhere; none while enough are under way. To be called after each
    /// [`Viewer::update`], and as often as there is somebody to work. Every job wants to be answered with [`Viewer::finish`].
    pub fn take_jobs(&mut self, kind: JobKind, most: usize) -> Vec<DecodeJob> {
        let mut jobs = Vec::new();
        if self.jobs.decoding == Decoding::Inline {
            return jobs;
        }
        match kind {
            JobKind::Mesh => {
                let mut last = None;
                while jobs.len() < most
                    && self.jobs.room(kind) > 0
                    && let Some((job, _)) = self.next_page_job(&mut last)
                {
                    jobs.push(job);
                }
            }
            JobKind::Image => {
                // Half of them tiles, if there are enough of both; of an odd number once the one has more, once the other.
                self.jobs.was_tile = !self.jobs.was_tile;
                let tiles = (most / 2).saturating_add(most % 2 * usize::from(self.jobs.was_tile));
                self.take_tile_jobs(&mut jobs, tiles);
                let room = self.jobs.room(kind).div_ceil(TEXTURE_BYTES);
                let room = usize::try_from(room).unwrap_or(usize::MAX);
                let textures = self.texture_jobs(room.min(most - jobs.len()));
                jobs.extend(textures);
                self.take_tile_jobs(&mut jobs, most);
            }
        }
        jobs
    }

    fn take_tile_jobs(&mut self, jobs: &mut Vec<DecodeJob>, most: usize) {
        while jobs.len() < most
            && self.jobs.room(JobKind::Image) > 0
            && let Some(job) = self.next_tile_job()
        {
            jobs.push(job);
        }
    }

    /// Takes what came of a job; it is put into place by the next updates. Results of unknown jobs are ignored.
    pub fn finish(&mut self, result: DecodeResult) {
        if self.jobs.running.contains_key(&result.id) {
            self.jobs.finished.push_back(result);
        }
    }

    /// Jobs handed out whose results are not in place yet.
    pub fn jobs_under_way(&self) -> usize {
        self.jobs.running.len()
    }

    /// Puts results into place, as many as one update may upload.
    pub(super) fn take_in_finished(&mut self) {
        let mut left = self.options.upload_bytes_per_update;
        while left > 0
            && let Some(result) = self.jobs.finished.pop_front()
        {
            let bytes = result.decoded.as_ref().map_or(0, Decoded::upload_bytes);
            left = left.saturating_sub(bytes);
            self.take_in(result);
        }
    }

    /// Puts a result into place, if what it is for is still wanted.
    pub(super) fn take_in(&mut self, result: DecodeResult) {
        let Some(subject) = self.jobs.end(result.id) else {
            return;
        };
        match subject {
            Subject::Page(page) => self.take_page(page, result.decoded),
            Subject::Tile(tile) => {
                let (now, mips) = (self.clock, mips_of(result.decoded));
                if let Some(layer) = &mut self.colour {
                    self.stale.picture |= layer.take_in(now, tile, mips);
                }
            }
            Subject::Texture(ticket) => {
                self.table.finish_texture(ticket, mips_of(result.decoded));
                // Others may have waited for what it gives back.
                self.textures_wait = true;
            }
        }
    }
}

fn mips_of(decoded: Result<Decoded, String>) -> Result<Vec<crate::colour::upload::Mip>, String> {
    match decoded? {
        Decoded::Image(mips) => Ok(mips),
        Decoded::Samples(_) | Decoded::Cluster(..) => Err("is no image".to_owned()),
    }
}

#[cfg(test)]
mod tests;
