//! Whether a connection keeps the server waiting for too long.
//!
//! The connection's stream and its responses tell the monitor what they do; [`Monitor::overdue`] looks at it every
//! now and then and resolves once a deadline has passed. So no deadline needs a timer of its own, and a client that
//! hinders HTTP/2 streams by its flow control is seen as well as one that fills the socket.
//!
//! Limit: deadlines are noticed up to a quarter of the shortest one late.

use crate::config::ConnectionLimits;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::time::Instant;

/// What one connection is doing. Times are milliseconds since it was made.
#[derive(Debug)]
pub(crate) struct Monitor {
    start: Instant,
    /// When the first byte of a request came whose header is not complete, plus one; 0 when there is none.
    header_since: AtomicU64,
    /// When the last response ended.
    idle_since: AtomicU64,
    /// Bytes that the socket took.
    sent: AtomicU64,
    /// The socket takes no more at present.
    blocked: AtomicBool,
    /// Responses that wait for their own source, so that the client is not to blame.
    waiting: AtomicU32,
    /// The client speaks HTTP/2, whose frames need not belong to a request: the idle deadline covers them.
    http2: AtomicBool,
    /// The connection is to end without a word.
    aborted: AtomicBool,
    responses: Mutex<Responses>,
}

#[derive(Debug, Default)]
struct Responses {
    next: u64,
    /// Number and beginning of each response under way.
    under_way: Vec<(u64, u64)>,
}

/// Why a connection is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Overdue {
    /// The header of a request did not come to its end.
    Header,
    /// No request came.
    Idle,
    /// The client reads too slowly.
    Stall,
    /// A response took too long in all.
    Response,
}

impl Overdue {
    /// One word, for logs and metrics.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Idle => "idle",
            Self::Stall => "stall",
            Self::Response => "response",
        }
    }
}

impl Monitor {
    /// Of a connection made just now: its first header is awaited.
    pub(crate) fn new() -> Self {
        Self {
            start: Instant::now(),
            header_since: AtomicU64::new(1),
            idle_since: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            blocked: AtomicBool::new(false),
            waiting: AtomicU32::new(0),
            http2: AtomicBool::new(false),
            aborted: AtomicBool::new(false),
            responses: Mutex::default(),
        }
    }

    fn now(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX - 1)
    }

    fn responses(&self) -> std::sync::MutexGuard<'_, Responses> {
        self.responses
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes came from the client.
    pub(super) fn heard(&self) {
        if self.header_since.load(Relaxed) == 0
            && !self.http2.load(Relaxed)
            && self.responses().under_way.is_empty()
        {
            self.header_since.store(self.now() + 1, Relaxed);
        }
    }

    /// The client has shown that it speaks HTTP/2.
    pub(super) fn speaks_http2(&self) {
        self.http2.store(true, Relaxed);
        self.header_since.store(0, Relaxed);
    }

    /// The socket took `bytes`.
    pub(super) fn sent(&self, bytes: usize) {
        self.sent.fetch_add(bytes as u64, Relaxed);
        self.blocked.store(false, Relaxed);
    }

    /// The socket takes no more for now.
    pub(super) fn blocked(&self) {
        self.blocked.store(true, Relaxed);
    }

    /// A request is complete; its response is under way until the guard is dropped.
    pub(crate) fn respond(self: &Arc<Self>) -> Guard {
        let now = self.now();
        self.header_since.store(0, Relaxed);
        let mut responses = self.responses();
        let number = responses.next;
        responses.next += 1;
        responses.under_way.push((number, now));
        drop(responses);
        Guard {
            monitor: Arc::clone(self),
            number,
            waits: false,
        }
    }

    /// Ends the connection without delivering what was not taken yet.
    pub(super) fn abort(&self) {
        self.aborted.store(true, Relaxed);
    }

    pub(super) fn is_aborted(&self) -> bool {
        self.aborted.load(Relaxed)
    }

    /// Bytes that the socket took so far.
    pub(crate) fn bytes_sent(&self) -> u64 {
        self.sent.load(Relaxed)
    }

    /// Resolves once a deadline has passed.
    pub(super) async fn overdue(&self, limits: &ConnectionLimits) -> Overdue {
        let ms = |duration: Duration| u64::try_from(duration.as_millis()).unwrap_or(u64::MAX);
        let shortest = (limits.header)
            .min(limits.idle)
            .min(limits.write_stall)
            .min(limits.response);
        let pause = (shortest / 4).clamp(Duration::from_millis(5), Duration::from_secs(5));
        let least = (limits.min_rate as f64 * limits.write_stall.as_secs_f64()).max(1.0);
        // Since when the client has been taking less than it must, and what it had taken then.
        let mut slow_since = 0;
        let mut sent_then = 0;
        loop {
            tokio::time::sleep(pause).await;
            let now = self.now();
            let since = |then: u64| now.saturating_sub(then);
            let header_since = self.header_since.load(Relaxed);
            if header_since > 0 && since(header_since - 1) >= ms(limits.header) {
                return Overdue::Header;
            }
            let oldest = (self.responses().under_way.iter().map(|&(_, begun)| begun)).min();
            let busy = oldest.is_some() || self.blocked.load(Relaxed);
            let sent = self.sent.load(Relaxed);
            let progress = sent.saturating_sub(sent_then) as f64 >= least;
            if !busy || progress || self.waiting.load(Relaxed) > 0 {
                (slow_since, sent_then) = (now, sent);
            } else if since(slow_since) >= ms(limits.write_stall) {
                return Overdue::Stall;
            }
            if oldest.is_some_and(|begun| since(begun) >= ms(limits.response)) {
                return Overdue::Response;
            }
            let idle_since = self.idle_since.load(Relaxed);
            if !busy && header_since == 0 && since(idle_since) >= ms(limits.idle) {
                return Overdue::Idle;
            }
        }
    }
}

/// One response under way.
#[derive(Debug)]
pub(crate) struct Guard {
    monitor: Arc<Monitor>,
    number: u64,
    waits: bool,
}

impl Guard {
    /// Says whether the response waits for its source now.
    pub(crate) fn set_waiting(&mut self, waits: bool) {
        if waits != self.waits {
            self.waits = waits;
            if waits {
                self.monitor.waiting.fetch_add(1, Relaxed);
            } else {
                self.monitor.waiting.fetch_sub(1, Relaxed);
            }
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.set_waiting(false);
        self.monitor.idle_since.store(self.monitor.now(), Relaxed);
        let mut responses = self.monitor.responses();
        let number = self.number;
        responses.under_way.retain(|&(other, _)| other != number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::time::timeout;

    /// Long enough that a busy machine does not matter, short enough to wait for.
    const UNIT: Duration = Duration::from_millis(100);

    fn limits() -> ConnectionLimits {
        ConnectionLimits {
            header: UNIT,
            idle: 3 * UNIT,
            write_stall: 2 * UNIT,
            min_rate: 1000,
            response: 10 * UNIT,
            ..ConnectionLimits::default()
        }
    }

    async fn end(monitor: &Monitor) -> (Option<Overdue>, Duration) {
        let start = Instant::now();
        let limits = limits();
        let outcome = timeout(200 * UNIT, monitor.overdue(&limits)).await;
        (outcome.ok(), start.elapsed())
    }

    #[tokio::test]
    async fn a_connection_without_a_request_is_cut() {
        let (why, after) = end(&Monitor::new()).await;
        assert_eq!(why, Some(Overdue::Header));
        assert!(after >= UNIT, "{after:?}");
    }

    #[tokio::test]
    async fn a_second_request_has_the_idle_time_to_begin_and_the_header_time_to_end() {
        let monitor = Arc::new(Monitor::new());
        drop(monitor.respond());
        assert_eq!(end(&monitor).await.0, Some(Overdue::Idle));
        // What comes on an HTTP/2 connection need not be a request.
        let monitor = Arc::new(Monitor::new());
        monitor.speaks_http2();
        monitor.heard();
        assert_eq!(end(&monitor).await.0, Some(Overdue::Idle));
        let monitor = Arc::new(Monitor::new());
        drop(monitor.respond());
        monitor.heard();
        assert_eq!(end(&monitor).await.0, Some(Overdue::Header));
    }

    #[tokio::test]
    async fn who_takes_nothing_is_cut_and_who_takes_little_too() {
        for step in [0, 1000] {
            let monitor = Arc::new(Monitor::new());
            let _response = monitor.respond();
            let taking = async {
                loop {
                    tokio::time::sleep(UNIT / 10).await;
                    monitor.sent(step);
                    monitor.blocked();
                }
            };
            let limits = limits();
            let why = tokio::select! {
                why = monitor.overdue(&limits) => why,
                () = taking => unreachable!(),
            };
            let expected = if step == 0 {
                Overdue::Stall
            } else {
                Overdue::Response
            };
            assert_eq!(why, expected, "{step}");
        }
    }

    #[tokio::test]
    async fn a_response_that_waits_for_its_source_is_not_held_against_the_client() {
        let monitor = Arc::new(Monitor::new());
        let mut response = monitor.respond();
        response.set_waiting(true);
        let (why, after) = end(&monitor).await;
        assert_eq!(why, Some(Overdue::Response));
        assert!(after >= 10 * UNIT);
    }

    #[tokio::test]
    async fn the_oldest_response_counts() {
        let monitor = Arc::new(Monitor::new());
        let old = monitor.respond();
        let work = async {
            loop {
                tokio::time::sleep(UNIT / 10).await;
                drop(monitor.respond());
                monitor.sent(1000);
            }
        };
        let limits = limits();
        let why = tokio::select! {
            why = monitor.overdue(&limits) => why,
            () = work => unreachable!(),
        };
        assert_eq!(why, Overdue::Response);
        drop(old);
        assert!(monitor.responses().under_way.is_empty());
    }
}
