//! The stages that a conversion goes through, timed.

use super::Progress;
use crate::process;
use crate::report::StageReport;
use std::sync::{Arc, Mutex};
use std::time::Instant;

pub(super) struct Stages<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) reports: Vec<StageReport>,
    pub(super) started: Instant,
    running: Option<(&'static str, Instant, f64)>,
    /// Name of the stage that runs, for other threads.
    name: Arc<Mutex<&'static str>>,
}

impl<'a> Stages<'a> {
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Self {
            progress,
            reports: Vec::new(),
            started: Instant::now(),
            running: None,
            name: Arc::new(Mutex::new("start")),
        }
    }

    pub(super) fn begin(&mut self, name: &'static str) {
        self.end();
        self.progress.stage(name);
        self.running = Some((name, Instant::now(), process::cpu_seconds()));
        if let Ok(mut shared) = self.name.lock() {
            *shared = name;
        }
    }

    pub(super) fn shared_name(&self) -> Arc<Mutex<&'static str>> {
        Arc::clone(&self.name)
    }

    /// The stage that runs, or ran last.
    pub(super) fn name(&self) -> &'static str {
        self.running.map_or("start", |(name, ..)| name)
    }

    pub(super) fn end(&mut self) {
        if let Some((name, since, cpu)) = self.running.take() {
            self.reports.push(StageReport {
                name,
                seconds: since.elapsed().as_secs_f64(),
                cpu_seconds: process::cpu_seconds() - cpu,
                peak_rss_bytes: process::peak_rss_bytes(),
            });
        }
    }
}
