//! Counters, in the text format of Prometheus.
//!
//! Plain atomics: one relaxed addition an event, so that the hot path pays nothing that can be measured.

use crate::accept::monitor::Overdue;
use crate::target::Route;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// A number that only grows.
#[derive(Debug, Default)]
pub(crate) struct Counter(AtomicU64);

impl Counter {
    pub(crate) fn add(&self) {
        self.add_many(1);
    }

    pub(crate) fn add_many(&self, count: u64) {
        self.0.fetch_add(count, Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Relaxed)
    }
}

/// How many of something there are, and have been.
#[derive(Debug, Default)]
pub(crate) struct Gauge {
    begun: Counter,
    ended: Counter,
}

impl Gauge {
    pub(crate) fn begin(&self) {
        self.begun.add();
    }

    pub(crate) fn end(&self) {
        self.ended.add();
    }

    fn now(&self) -> u64 {
        let ended = self.ended.get();
        self.begun.get().saturating_sub(ended)
    }
}

const ROUTES: [(Route, &str); 5] = [
    (Route::Pages, "pages"),
    (Route::Files, "files"),
    (Route::Api, "api"),
    (Route::Viewer, "viewer"),
    (Route::Other, "other"),
];

/// Upper ends of the buckets of the histogram of times, in seconds.
const BUCKETS: [f64; 12] = [
    0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 5.0, 30.0,
];

const CUTS: [Overdue; 4] = [
    Overdue::Header,
    Overdue::Idle,
    Overdue::Stall,
    Overdue::Response,
];

#[derive(Debug, Default)]
struct RouteMetrics {
    /// By the first digit of the status.
    responses: [Counter; 6],
    /// By bucket; the last one is beyond all.
    times: [Counter; BUCKETS.len() + 1],
    microseconds: Counter,
}

/// Everything that is counted.
#[derive(Debug, Default)]
pub(crate) struct Metrics {
    routes: [RouteMetrics; ROUTES.len()],
    pub(crate) connections: Gauge,
    pub(crate) refused_connections: Counter,
    cuts: [Counter; CUTS.len()],
    pub(crate) bytes_sent: Counter,
    pub(crate) rate_limited: Counter,
    pub(crate) unauthorized: Counter,
    pub(crate) broken_responses: Counter,
    pub(crate) upstream: UpstreamMetrics,
}

/// What concerns object stores and HTTP origins.
#[derive(Debug, Default)]
pub(crate) struct UpstreamMetrics {
    pub(crate) requests: Counter,
    pub(crate) bytes: Counter,
    pub(crate) errors: Counter,
    pub(crate) retries: Counter,
    pub(crate) changed: Counter,
    pub(crate) hits: Counter,
    pub(crate) misses: Counter,
    pub(crate) joined: Counter,
    /// Bytes in the cache now.
    pub(crate) cached_bytes: AtomicU64,
}

impl Metrics {
    /// A response of `status` is ready to be sent.
    pub(crate) fn response(&self, route: Route, status: u16, time: Duration) {
        let metrics = &self.routes[route as usize];
        metrics.responses[usize::from(status / 100).min(5)].add();
        let seconds = time.as_secs_f64();
        let bucket = BUCKETS.partition_point(|&end| end < seconds);
        metrics.times[bucket].add();
        metrics
            .microseconds
            .add_many(u64::try_from(time.as_micros()).unwrap_or(u64::MAX));
    }

    /// A connection was cut.
    pub(crate) fn cut(&self, why: Overdue) {
        self.cuts[why as usize].add();
    }

    /// All of it as text.
    pub(crate) fn text(&self) -> String {
        let mut page = Page(String::with_capacity(8192));
        self.write_requests(&mut page);
        page.head("connections", "gauge", "Connections open now.");
        page.value("connections", "", self.connections.now());
        page.head(
            "connections_cut_total",
            "counter",
            "Connections cut, by deadline.",
        );
        for (count, why) in self.cuts.iter().zip(CUTS) {
            let labels = format!("deadline=\"{}\"", why.name());
            page.value("connections_cut_total", &labels, count.get());
        }
        self.write_counters(&mut page);
        page.head("cache_bytes", "gauge", "Bytes of remote files in memory.");
        page.value("cache_bytes", "", self.upstream.cached_bytes.load(Relaxed));
        page.head("build_info", "gauge", "Version of the server.");
        page.value(
            "build_info",
            concat!("version=\"", env!("CARGO_PKG_VERSION"), "\""),
            1,
        );
        if let Some(bytes) = resident_bytes() {
            page.0
                .push_str("# HELP process_resident_memory_bytes Memory in use.\n");
            page.0
                .push_str("# TYPE process_resident_memory_bytes gauge\n");
            let _ = writeln!(page.0, "process_resident_memory_bytes {bytes}");
        }
        page.0
    }

    fn write_requests(&self, page: &mut Page) {
        page.head(
            "requests_total",
            "counter",
            "Responses by route and class of status.",
        );
        for (metrics, (_, route)) in self.routes.iter().zip(ROUTES) {
            for (class, count) in metrics.responses.iter().enumerate().skip(1) {
                if count.get() > 0 {
                    let labels = format!("route=\"{route}\",status=\"{class}xx\"");
                    page.value("requests_total", &labels, count.get());
                }
            }
        }
        page.head(
            "request_seconds",
            "histogram",
            "Time until a response was ready to be sent.",
        );
        for (metrics, (_, route)) in self.routes.iter().zip(ROUTES) {
            let mut sum = 0;
            for (count, end) in metrics.times.iter().zip(&BUCKETS) {
                sum += count.get();
                let labels = format!("route=\"{route}\",le=\"{end}\"");
                page.value("request_seconds_bucket", &labels, sum);
            }
            sum += metrics.times[BUCKETS.len()].get();
            let labels = format!("route=\"{route}\"");
            page.value(
                "request_seconds_bucket",
                &format!("{labels},le=\"+Inf\""),
                sum,
            );
            let seconds = metrics.microseconds.get() as f64 / 1e6;
            page.value("request_seconds_sum", &labels, seconds);
            page.value("request_seconds_count", &labels, sum);
        }
    }

    fn write_counters(&self, page: &mut Page) {
        let upstream = &self.upstream;
        for (name, help, counter) in [
            (
                "connections_total",
                "Connections accepted.",
                &self.connections.begun,
            ),
            (
                "connections_refused_total",
                "Connections over the limit of an address.",
                &self.refused_connections,
            ),
            (
                "sent_bytes_total",
                "Bytes sent on connections that have ended.",
                &self.bytes_sent,
            ),
            (
                "rate_limited_total",
                "Requests over the limit of an address.",
                &self.rate_limited,
            ),
            (
                "unauthorized_total",
                "Requests without the right to what they asked for.",
                &self.unauthorized,
            ),
            (
                "broken_responses_total",
                "Responses cut short since their source failed.",
                &self.broken_responses,
            ),
            (
                "upstream_requests_total",
                "Requests to remote sources.",
                &upstream.requests,
            ),
            (
                "upstream_bytes_total",
                "Bytes read from remote sources.",
                &upstream.bytes,
            ),
            (
                "upstream_errors_total",
                "Requests to remote sources that failed.",
                &upstream.errors,
            ),
            (
                "upstream_retries_total",
                "Requests to remote sources that were tried again.",
                &upstream.retries,
            ),
            (
                "upstream_changed_total",
                "Remote files found changed while they were read.",
                &upstream.changed,
            ),
            (
                "cache_hits_total",
                "Blocks found in memory.",
                &upstream.hits,
            ),
            ("cache_misses_total", "Blocks fetched.", &upstream.misses),
            (
                "cache_joined_total",
                "Blocks waited for that were being fetched already.",
                &upstream.joined,
            ),
        ] {
            page.head(name, "counter", help);
            page.value(name, "", counter.get());
        }
    }
}

struct Page(String);

impl Page {
    fn head(&mut self, name: &str, kind: &str, help: &str) {
        let _ = writeln!(self.0, "# HELP marquetry_{name} {help}");
        let _ = writeln!(self.0, "# TYPE marquetry_{name} {kind}");
    }

    fn value(&mut self, name: &str, labels: &str, value: impl std::fmt::Display) {
        // Writing to a string does not fail.
        let _ = if labels.is_empty() {
            writeln!(self.0, "marquetry_{name} {value}")
        } else {
            writeln!(self.0, "marquetry_{name}{{{labels}}} {value}")
        };
    }
}

/// Memory of this process; where the system tells it as Linux does.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_what_prometheus_reads() {
        let metrics = Metrics::default();
        metrics.connections.begin();
        metrics.response(Route::Pages, 200, Duration::from_micros(700));
        metrics.response(Route::Pages, 200, Duration::from_secs(100));
        metrics.response(Route::Files, 416, Duration::ZERO);
        metrics.cut(Overdue::Stall);
        let text = metrics.text();
        for line in [
            "marquetry_requests_total{route=\"pages\",status=\"2xx\"} 2",
            "marquetry_requests_total{route=\"files\",status=\"4xx\"} 1",
            "marquetry_request_seconds_bucket{route=\"pages\",le=\"0.0005\"} 0",
            "marquetry_request_seconds_bucket{route=\"pages\",le=\"0.001\"} 1",
            "marquetry_request_seconds_bucket{route=\"pages\",le=\"30\"} 1",
            "marquetry_request_seconds_bucket{route=\"pages\",le=\"+Inf\"} 2",
            "marquetry_request_seconds_count{route=\"pages\"} 2",
            "marquetry_connections 1",
            "marquetry_connections_cut_total{deadline=\"stall\"} 1",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let (name, value) = line.rsplit_once(' ').unwrap();
            assert!(
                name.starts_with("marquetry_") || name.starts_with("process_"),
                "{line}"
            );
            value.parse::<f64>().unwrap();
        }
    }

    #[test]
    fn tables_are_in_the_order_of_their_enums() {
        for (place, (route, _)) in ROUTES.iter().enumerate() {
            assert_eq!(*route as usize, place);
        }
        for (place, why) in CUTS.iter().enumerate() {
            assert_eq!(*why as usize, place);
        }
    }
}
