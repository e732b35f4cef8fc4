//! Reads requests on threads of its own, so that a slow source does not stop the picture.

use marquetry_engine::{Request, RequestId, Viewer};
use marquetry_format::ByteSource;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Threads that read.
const THREADS: usize = 4;

type Answer = (RequestId, Result<Vec<u8>, String>);

/// Threads that answer requests. They end when this is dropped, after the read they are at.
#[derive(Debug)]
pub(crate) struct Loader {
    requests: Sender<Request>,
    answers: Receiver<Answer>,
    in_flight: usize,
}

impl Loader {
    /// Reads from `source`, calling `wake` after each answer.
    pub(crate) fn new(
        source: &Arc<dyn ByteSource>,
        wake: impl Fn() + Send + Clone + 'static,
    ) -> Self {
        let (requests, jobs) = channel::<Request>();
        let (sender, answers) = channel::<Answer>();
        let jobs = Arc::new(Mutex::new(jobs));
        for _ in 0..THREADS {
            let (jobs, sender, source, wake) = (
                Arc::clone(&jobs),
                sender.clone(),
                Arc::clone(source),
                wake.clone(),
            );
            std::thread::spawn(move || {
                loop {
                    let job = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
                    let Ok(request) = job else { break };
                    let answer = source
                        .read(request.range)
                        .map_err(|error| error.to_string());
                    if sender.send((request.id, answer)).is_err() {
                        break;
                    }
                    wake();
                }
            });
        }
        Self {
            requests,
            answers,
            in_flight: 0,
        }
    }

    /// Starts reading.
    pub(crate) fn ask(&mut self, requests: Vec<Request>) {
        for request in requests {
            if self.requests.send(request).is_ok() {
                self.in_flight += 1;
            }
        }
    }

    /// Hands what has been read to `viewer`, after waiting up to `patience` for a first answer.
    pub(crate) fn deliver(&mut self, viewer: &mut Viewer, patience: Duration) {
        if self.in_flight == 0 {
            return;
        }
        let mut next = self.answers.recv_timeout(patience).ok();
        while let Some((id, answer)) = next {
            self.in_flight -= 1;
            viewer.deliver(id, answer);
            next = self.answers.try_recv().ok();
        }
    }

    /// Requests not answered yet.
    pub(crate) fn in_flight(&self) -> usize {
        self.in_flight
    }
}
