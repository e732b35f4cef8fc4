//! A network between a viewer and its file that is late, out of order, wrong or silent, the same in every run.

use crate::stage::{Stage, unit};
use anyhow::{Result, bail, ensure};
use marquetry_engine::Request;
use std::ops::Range;

/// What the network does to answers.
#[derive(Debug, Clone)]
pub struct Rule {
    /// Steps that an answer takes, at random; more than one step lets answers overtake each other.
    pub delay: Range<usize>,
    /// Part of the answers with a byte that is wrong.
    pub corrupt: f64,
    /// Part of the answers that are failures.
    pub failing: f64,
    /// Part of the requests that are never answered, and of the file's bytes behind them: it is asked by place, so that asking again does
    /// not help.
    pub silent: f64,
}

impl Rule {
    /// Answers at once.
    pub const PROMPT: Self = Self {
        delay: 0..1,
        corrupt: 0.0,
        failing: 0.0,
        silent: 0.0,
    };
}

/// Requests under way.
#[derive(Debug)]
pub struct Network {
    rule: Rule,
    seed: u64,
    clock: usize,
    count: u64,
    open: Vec<(usize, Request)>,
    /// Answers that were wrong or failures.
    pub faults: usize,
    /// Answers that came after one that was asked for later.
    pub overtaken: usize,
    /// Requests that stay without an answer.
    pub unanswered: usize,
}

impl Network {
    /// One that keeps to `rule`; what it does to which answer depends on `seed` alone.
    pub fn new(rule: Rule, seed: u64) -> Self {
        Self {
            rule,
            seed,
            clock: 0,
            count: 0,
            open: Vec::new(),
            faults: 0,
            overtaken: 0,
            unanswered: 0,
        }
    }

    fn chance(&mut self) -> f64 {
        self.count += 1;
        unit(self.seed, self.count)
    }

    /// One update; what is due is delivered before the next.
    ///
    /// # Errors
    /// When the cache is over its budget, or bytes are asked for that the file does not have.
    pub fn step(&mut self, stage: &mut Stage) -> Result<()> {
        for request in stage.update()? {
            if unit(self.seed ^ 1, request.range.start) < self.rule.silent {
                self.unanswered += 1;
                continue;
            }
            let span = self.rule.delay.len().max(1) as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "less than the length of the range"
            )]
            let wait = self.rule.delay.start + (self.chance() * span) as usize;
            self.open.push((self.clock + wait, request));
        }
        let clock = self.clock;
        let (due, later): (Vec<_>, Vec<_>) = std::mem::take(&mut self.open)
            .into_iter()
            .partition(|&(moment, _)| moment <= clock);
        self.overtaken += due
            .iter()
            .filter(|(_, request)| later.iter().any(|(_, other)| other.id < request.id))
            .count();
        self.open = later;
        for (_, request) in due {
            let mut answer = Ok(stage.read(&request)?);
            let chance = self.chance();
            if chance < self.rule.corrupt {
                self.faults += 1;
                let place = self.chance();
                if let Ok(bytes) = &mut answer {
                    flip(bytes, place);
                }
            } else if chance < self.rule.corrupt + self.rule.failing {
                self.faults += 1;
                answer = Err("the network is down".to_owned());
            }
            stage.viewer().deliver(request.id, answer);
        }
        self.clock += 1;
        // What it says is no fault of its own here.
        stage.viewer().take_failures();
        Ok(())
    }

    /// Steps until nothing is missing and nothing moves.
    ///
    /// # Errors
    /// As [`Network::step`], or when that never comes.
    pub fn settle(&mut self, stage: &mut Stage) -> Result<()> {
        ensure!(self.rule.silent == 0.0, "what never comes is waited for");
        for _ in 0..20_000 {
            self.step(stage)?;
            if self.open.is_empty() && stage.viewer().is_settled() {
                return Ok(());
            }
        }
        bail!("never settled: {:?}", stage.viewer().stats())
    }
}

/// Changes one bit of one byte.
fn flip(bytes: &mut [u8], place: f64) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "less than the length"
    )]
    let index = (place * bytes.len() as f64) as usize;
    if let Some(byte) = bytes.get_mut(index) {
        *byte ^= 1 << (index % 8);
    }
}
