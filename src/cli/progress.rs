//! Progress of a conversion: stage, percentage and time left, on standard error.
//!
//! On a terminal it is a bar; elsewhere, where it was asked for, a line now and then. The time left is
//! that of the stage, since stages differ too much from scan to scan to tell the whole from the part.

use super::output::complain;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// When progress is shown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum When {
    /// On a terminal.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Steps of the bar: tenths of a percent.
const STEPS: u64 = 1000;
/// Shortest time between two lines of one stage.
const LINE_PAUSE: Duration = Duration::from_secs(2);

/// Shows progress in the way that suits standard error.
#[derive(Debug)]
pub(super) enum Display {
    Bar(ProgressBar),
    Lines(Mutex<Lines>),
    Nothing,
}

/// What was last written as a line.
#[derive(Debug)]
pub(super) struct Lines {
    stage: &'static str,
    since: Instant,
    said: Instant,
}

impl Display {
    pub(super) fn new(when: When) -> Self {
        let terminal = std::io::stderr().is_terminal();
        match when {
            When::Auto | When::Always if terminal => Self::Bar(bar()),
            When::Always => {
                let now = Instant::now();
                Self::Lines(Mutex::new(Lines {
                    stage: "",
                    since: now,
                    said: now,
                }))
            }
            When::Auto | When::Never => Self::Nothing,
        }
    }

    /// Takes the bar off the terminal.
    pub(super) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template(
        "{spinner} {msg:14} {wide_bar} {percent:>3} %  {eta} left  ({elapsed} in all)",
    ) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

impl marquetry_converter::pipeline::Progress for Display {
    fn stage(&self, name: &'static str) {
        match self {
            Self::Bar(bar) => {
                bar.set_message(name);
                bar.set_position(0);
                bar.reset_eta();
            }
            Self::Lines(lines) => {
                let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
                lines.stage = name;
                lines.since = Instant::now();
                lines.said = lines.since;
                complain(&format!("{name}: 0 %"));
            }
            Self::Nothing => {}
        }
    }

    fn fraction(&self, done: f64) {
        let done = done.clamp(0.0, 1.0);
        match self {
            Self::Bar(bar) => {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0..=STEPS"
                )]
                bar.set_position((done * STEPS as f64) as u64);
            }
            Self::Lines(lines) => {
                let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
                let now = Instant::now();
                if now.duration_since(lines.said) >= LINE_PAUSE && done > 0.0 {
                    lines.said = now;
                    let elapsed = now.duration_since(lines.since).as_secs_f64();
                    let left = elapsed * (1.0 - done) / done;
                    complain(&format!(
                        "{}: {:.0} %, {left:.0} s left",
                        lines.stage,
                        done * 100.0
                    ));
                }
            }
            Self::Nothing => {}
        }
    }

    fn over_memory(&self, error: &marquetry_converter::pipeline::ConvertError) {
        self.finish();
        complain(&format!("error: {error}"));
        // Other threads cannot be stopped in the middle of their work, and every moment takes more.
        std::process::exit(1);
    }
}
