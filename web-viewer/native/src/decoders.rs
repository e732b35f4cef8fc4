//! Decodes on threads of its own, so that pages that come do not stop the picture.

use marquetry_engine::{DecodeJob, DecodeResult, Decoding, JobKind, Viewer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, SendError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// Most threads that decode.
const MOST_THREADS: usize = 4;
/// Images under way for each thread: enough to last until the next frame, few enough for meshes not to wait long behind them.
const IMAGES_A_THREAD: usize = 4;

/// Threads that decode. They end when this is dropped, after the job they are at.
#[derive(Debug)]
pub struct Decoders {
    jobs: Sender<(JobKind, DecodeJob)>,
    results: Receiver<(JobKind, DecodeResult)>,
    threads: usize,
    images: usize,
    meshes: usize,
}

/// What `run` gives; where it panics, what `fail` makes of that, so that the thread goes on and nobody waits for ever.
fn caught<T>(run: impl FnOnce() -> T, fail: impl FnOnce(String) -> T) -> T {
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| fail("decoding it panicked".to_owned()))
}

impl Decoders {
    /// One thread fewer than the machine has processors, but at least one and at most four; `wake` is called after each job.
    /// Without any where the system gives none: then decoding is part of the viewer's updates.
    pub fn new(wake: impl Fn() + Send + Clone + 'static) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let wanted = processors.saturating_sub(1).clamp(1, MOST_THREADS);
        let (sender, receiver) = channel::<(JobKind, DecodeJob)>();
        let (done, results) = channel();
        let receiver = Arc::new(Mutex::new(receiver));
        let start = |number: usize| {
            let (jobs, done, wake) = (Arc::clone(&receiver), done.clone(), wake.clone());
            let work = move || {
                loop {
                    let job = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
                    let Ok((kind, job)) = job else { break };
                    let result = caught(|| job.run(), |reason| job.fail(reason));
                    if done.send((kind, result)).is_err() {
                        break;
                    }
                    wake();
                }
            };
            let name = format!("decoder {number}");
            std::thread::Builder::new().name(name).spawn(work).is_ok()
        };
        Self {
            jobs: sender,
            threads: (0..wanted).filter(|number| start(*number)).count(),
            results,
            images: 0,
            meshes: 0,
        }
    }

    /// Has `viewer` decode here from now on, if there are threads.
    pub fn adopt(&self, viewer: &mut Viewer) {
        viewer.set_decoding(if self.threads > 0 {
            Decoding::Elsewhere
        } else {
            Decoding::Inline
        });
    }

    /// Hands what has been decoded to `viewer`; to be called before its update.
    pub fn collect(&mut self, viewer: &mut Viewer) {
        while let Ok((kind, result)) = self.results.try_recv() {
            match kind {
                JobKind::Image => self.images -= 1,
                JobKind::Mesh => self.meshes -= 1,
            }
            viewer.finish(result);
        }
    }

    /// Takes new jobs from `viewer`; to be called after its update.
    pub fn feed(&mut self, viewer: &mut Viewer) {
        let images = (IMAGES_A_THREAD * self.threads).saturating_sub(self.images);
        for (kind, most) in [(JobKind::Mesh, usize::MAX), (JobKind::Image, images)] {
            for job in viewer.take_jobs(kind, most) {
                match self.jobs.send((kind, job)) {
                    Ok(()) => match kind {
                        JobKind::Image => self.images += 1,
                        JobKind::Mesh => self.meshes += 1,
                    },
                    // No thread is left.
                    Err(SendError((_, job))) => viewer.finish(job.run()),
                }
            }
        }
    }

    /// Jobs under way.
    pub fn under_way(&self) -> usize {
        self.images + self.meshes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_failure() {
        assert_eq!(caught(|| 7, |_| 0), 7);
        let failed = caught(|| panic!("on purpose"), |reason| reason);
        assert_eq!(failed, "decoding it panicked");
    }
}
