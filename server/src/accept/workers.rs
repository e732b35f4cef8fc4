//! Threads that drive connections, each its own.
//!
//! A connection stays with one thread: there its socket is watched, its requests are answered and its tasks run. A
//! runtime whose threads share all tasks wakes one thread from another for most small requests, which takes a tenth
//! of the processor's time and a third of the slowest answers' (docs/operation.md).

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use tokio::runtime::{Builder, Handle};
use tokio::sync::oneshot;

/// Threads, of all workers together, for what blocks: reads of files that the kernel does not have in memory.
const BLOCKING_THREADS: usize = 512;

/// The threads. They end when this is dropped, and with them what they still have to do.
#[derive(Debug)]
pub(crate) struct Workers(Vec<Worker>);

#[derive(Debug)]
struct Worker {
    runtime: Handle,
    connections: Arc<AtomicUsize>,
    /// The thread ends when this is dropped.
    _alive: oneshot::Sender<()>,
}

/// A connection's place at a worker.
#[derive(Debug)]
pub(crate) struct Seat(Arc<AtomicUsize>);

impl Workers {
    /// Starts `count` threads, at least one.
    ///
    /// # Errors
    /// When the system has no more threads or descriptors.
    pub(crate) fn start(count: usize) -> io::Result<Self> {
        let count = count.max(1);
        let start = |number| {
            let runtime = Builder::new_current_thread()
                .enable_all()
                .max_blocking_threads(BLOCKING_THREADS.div_ceil(count))
                .build()?;
            let handle = runtime.handle().clone();
            let (alive, ended) = oneshot::channel();
            std::thread::Builder::new()
                .name(format!("connections-{number}"))
                .spawn(move || {
                    // An error is what it waits for: nothing is ever sent.
                    let _ = runtime.block_on(ended);
                    runtime.shutdown_background();
                })?;
            Ok(Worker {
                runtime: handle,
                connections: Arc::default(),
                _alive: alive,
            })
        };
        (0..count).map(start).collect::<io::Result<_>>().map(Self)
    }

    /// The worker with the fewest connections, and a place there for one more.
    pub(crate) fn seat(&self) -> (&Handle, Seat) {
        let fewest = (self.0.iter()).min_by_key(|worker| worker.connections.load(Relaxed));
        let Some(worker) = fewest else {
            unreachable!("there is at least one worker");
        };
        worker.connections.fetch_add(1, Relaxed);
        (&worker.runtime, Seat(Arc::clone(&worker.connections)))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_go_where_the_fewest_are() {
        let workers = Workers::start(3).unwrap();
        let seats: Vec<Seat> = (0..6).map(|_| workers.seat().1).collect();
        let counts = || -> Vec<usize> {
            (workers.0.iter())
                .map(|worker| worker.connections.load(Relaxed))
                .collect()
        };
        assert_eq!(counts(), [2, 2, 2]);
        let mut seats = seats.into_iter();
        // The second worker's two.
        let (first, gone) = (seats.next(), seats.next());
        drop(gone);
        assert_eq!(counts(), [2, 1, 2]);
        let again = workers.seat().1;
        assert_eq!(counts(), [2, 2, 2]);
        drop((first, again, seats));
        assert_eq!(counts(), [0, 0, 0]);
    }

    #[test]
    fn what_workers_still_do_ends_with_them() {
        let workers = Workers::start(0).unwrap();
        let (sender, mut receiver) = oneshot::channel::<()>();
        workers.seat().0.spawn(async move {
            std::future::pending::<()>().await;
            drop(sender);
        });
        assert_eq!(
            receiver.try_recv(),
            Err(oneshot::error::TryRecvError::Empty)
        );
        drop(workers);
        // The sender is dropped with its task.
        assert!(receiver.blocking_recv().is_err());
    }
}
