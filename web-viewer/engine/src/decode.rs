//! Decoding as jobs, which a shell may run on any thread, or in a browser's worker.
//!
//! A job holds all that it takes. [`Viewer::take_jobs`](crate::Viewer::take_jobs) hands jobs out, [`DecodeJob::run`] does the work,
//! and [`Viewer::finish`](crate::Viewer::finish) takes the results, in any order. Images can also be sent as bytes
//! ([`DecodeJob::message`], [`run_message`]) to where only bytes go.

mod message;

pub use message::run_message;

use crate::colour::upload::{LightTables, Mip, mips};
use crate::lod::cluster::target::{GroupSurface, Targets};
use marquetry_format::{ClusterMesh, DecodedPage, ImageTask, PageSamples, PageTask};
use std::sync::Arc;

/// Where a viewer's pages and images are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Decoding {
    /// In [`Viewer::update`](crate::Viewer::update), so much at a time.
    #[default]
    Inline,
    /// Wherever the shell runs the jobs that it takes.
    Elsewhere,
}

/// Names a [`DecodeJob`] among those of all viewers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub u64);

/// Kinds of jobs, which take very different times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobKind {
    /// A page of samples, or a cluster.
    Mesh,
    /// A colour tile, or a cluster's texture.
    Image,
}

/// Something to decode.
#[derive(Debug, Clone)]
pub struct DecodeJob {
    pub(crate) id: JobId,
    pub(crate) work: Work,
}

#[derive(Debug, Clone)]
pub(crate) enum Work {
    Page(PageWork),
    Image(ImageWork),
}

/// A page; for a cluster's, the surface that its group takes the place of.
#[derive(Debug, Clone)]
pub(crate) struct PageWork {
    pub(crate) task: PageTask,
    pub(crate) above: Option<Arc<GroupSurface>>,
}

/// An image, and how it is wanted.
#[derive(Debug, Clone)]
pub(crate) struct ImageWork {
    pub(crate) task: ImageTask,
    /// Texels that its edge is repeated by on each side.
    pub(crate) margin: u32,
    /// Finest mips that are left out.
    pub(crate) skipped: u8,
}

/// What came of a [`DecodeJob`].
#[derive(Debug)]
pub struct DecodeResult {
    pub(crate) id: JobId,
    pub(crate) decoded: Result<Decoded, String>,
}

#[derive(Debug)]
pub(crate) enum Decoded {
    Samples(PageSamples),
    Cluster(ClusterMesh, Targets),
    Image(Vec<Mip>),
}

impl DecodeJob {
    /// Its name.
    pub fn id(&self) -> JobId {
        self.id
    }

    /// Decodes.
    pub fn run(&self) -> DecodeResult {
        let decoded = match &self.work {
            Work::Page(work) => work.run(),
            Work::Image(work) => work.run().map(Decoded::Image),
        };
        DecodeResult {
            id: self.id,
            decoded: decoded.map_err(|error| error.to_string()),
        }
    }

    /// That the job cannot be run, because of `reason`. A page or a tile will be fetched again; a cluster is then shown without its
    /// texture.
    pub fn fail(&self, reason: String) -> DecodeResult {
        DecodeResult {
            id: self.id,
            decoded: Err(reason),
        }
    }
}

impl PageWork {
    fn run(&self) -> Result<Decoded, marquetry_format::Error> {
        self.task.decode().map(|page| match page {
            DecodedPage::Samples(samples) => Decoded::Samples(samples),
            DecodedPage::Cluster(mesh) => {
                let above = self.above.as_ref();
                let targets = above.map(|above| above.targets(&mesh)).unwrap_or_default();
                Decoded::Cluster(mesh, targets)
            }
        })
    }
}

impl ImageWork {
    pub(crate) fn run(&self) -> Result<Vec<Mip>, marquetry_format::Error> {
        let texels = self.task.decode()?;
        let mut mips = mips(&texels, self.margin, LightTables::shared());
        mips.drain(..usize::from(self.skipped).min(mips.len() - 1));
        Ok(mips)
    }

    /// Bytes of the mips, about.
    pub(crate) fn decoded_bytes(&self) -> u64 {
        let side = |texels: u32| u64::from(texels.saturating_add(2 * self.margin));
        (side(self.task.width) * side(self.task.height) * 4 * 85 / 64) >> (2 * self.skipped)
    }
}

impl Decoded {
    /// Bytes that go to the GPU, about.
    pub(crate) fn upload_bytes(&self) -> u64 {
        use crate::residency::upload::{CLUSTER_SLOT_BYTES, COLOURED_SAMPLE_BYTES};
        match self {
            Self::Samples(samples) => samples.positions.len() as u64 * COLOURED_SAMPLE_BYTES,
            Self::Cluster(..) => CLUSTER_SLOT_BYTES,
            Self::Image(mips) => mips.iter().map(|mip| 4 * mip.rgba.len() as u64).sum(),
        }
    }
}
