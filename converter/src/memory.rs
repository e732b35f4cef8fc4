//! The ceiling of working memory.
//!
//! Three checks hold it. Before anything is read, what the file announces is weighed ([`estimate`]); after import, what is
//! there; and while a conversion runs, a thread of its own watches the resident set and has the process ended shortly
//! before it would pass the ceiling ([`watch`]).
//!
//! Limits: nothing is moved to disk, so what does not fit is refused; [`mod@decimate`] is what makes huge scans fit. What is
//! taken within 10 ms may pass the ceiling by more than the reserve where that is less than some MiB. Where the system does
//! not tell the resident set, the last check is missing.

use crate::mesh::decimate;
use crate::process;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Bytes that a conversion takes whatever its input: code, threads, tables.
const BASE: u64 = 24 << 20;
/// Bytes a triangle at the peak of a conversion, at least: `peak_rss_bytes` over `input.triangles` of `marquetry convert
/// --json -` is above 350 on `dragon_vrip.ply`. Lower, so that nothing is refused that might fit.
const BYTES_PER_TRIANGLE: u64 = 300;
/// Bytes a triangle until a mesh is decimated ([`decimate`]), at least.
const BYTES_PER_IMPORTED: u64 = 40;
/// The same of a mesh that is kept while clusters are made of it: 171 on `komaba_scan_1m.ply`, 139 on `dragon_vrip.ply`, 157 on a subdivision of it with 3.5 million, and some to be safe.
const BYTES_PER_KEPT: u64 = 240;
/// How often the resident set is looked at.
const INTERVAL: Duration = Duration::from_millis(10);
/// The part of the ceiling that is left free for what is taken between two looks: a 32nd.
const RESERVE: u64 = 32;

/// Bytes that a mesh of so many triangles needs at least, as far as can be told beforehand.
pub fn estimate(triangles: u64) -> u64 {
    let left = triangles.min(decimate::MANY as u64) * BYTES_PER_TRIANGLE;
    triangles
        .saturating_mul(BYTES_PER_IMPORTED)
        .max(left)
        .saturating_add(BASE)
}

/// Bytes that a conversion to clusters is expected to need if the mesh of so many triangles is kept.
pub fn of_kept(triangles: u64) -> u64 {
    triangles
        .saturating_mul(BYTES_PER_KEPT)
        .saturating_add(BASE)
}

/// Runs `work`; whenever the resident set comes near `ceiling` (bytes) meanwhile, `over` is called with its size.
pub fn watch<T>(ceiling: u64, over: impl Fn(u64) + Send, work: impl FnOnce() -> T) -> T {
    watch_reading(process::rss_bytes, ceiling, over, work)
}

/// [`watch`], with the resident set as `used` reads it.
fn watch_reading<T>(
    used: impl Fn() -> u64 + Send,
    ceiling: u64,
    over: impl Fn(u64) + Send,
    work: impl FnOnce() -> T,
) -> T {
    let limit = ceiling - ceiling / RESERVE;
    let (done, wait) = channel::<()>();
    std::thread::scope(|scope| {
        let watcher = std::thread::Builder::new().name("memory".to_owned());
        let watcher = watcher.spawn_scoped(scope, move || {
            while wait.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                let used = used();
                if used > limit {
                    over(used);
                }
            }
        });
        if let Err(error) = watcher {
            tracing::warn!(%error, "memory is not watched");
        }
        let result = work();
        drop(done);
        result
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn passing_the_ceiling_is_noticed() {
        // Other tests take and free memory meanwhile: what the system tells of this process is tested where there is one to itself.
        const CEILING: u64 = 3200;
        let (used, looks, seen) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        let read = || {
            looks.fetch_add(1, Ordering::SeqCst);
            used.load(Ordering::SeqCst)
        };
        let over = |used| seen.store(used, Ordering::SeqCst);
        // The second look from now on began after now, and the one before it has been dealt with.
        let looked_at = |bytes| {
            used.store(bytes, Ordering::SeqCst);
            let from = looks.load(Ordering::SeqCst);
            while looks.load(Ordering::SeqCst) < from + 3 {
                std::thread::yield_now();
            }
            seen.load(Ordering::SeqCst)
        };
        watch_reading(read, CEILING, over, || {
            // A 32nd is left free.
            assert_eq!(looked_at(3100), 0);
            assert_eq!(looked_at(3101), 3101);
            assert_eq!(looked_at(u64::MAX), u64::MAX);
        });
    }

    #[test]
    fn estimates_do_not_overflow() {
        assert_eq!(estimate(u64::MAX), u64::MAX);
        assert!(estimate(0) < 1 << 30);
    }
}
