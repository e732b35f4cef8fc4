//! Values of both revisions, what their ratio means, and the table.

use crate::traffic::median;
use anyhow::{Result, bail};
use std::fmt::Write as _;

/// The most that a value may grow by.
const ALLOWED: f64 = 1.1;

/// Part of the turns in which what is slower must be so; less is noise.
const AGREEING: f64 = 0.75;

/// What a value says, which is how it is compared and shown. Of all, less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Processor time or memory: another in every run.
    Seconds,
    /// The same.
    Memory,
    /// Bytes, triangles, nodes: the same in every run.
    Count,
    /// A distance over the diagonal: the same in every run.
    Distance,
}

impl Kind {
    fn varies(self) -> bool {
        matches!(self, Self::Seconds | Self::Memory)
    }

    fn shown(self, value: f64) -> String {
        match self {
            Self::Seconds => format!("{value:.2} s"),
            Self::Memory => format!("{:.0} MiB", value / f64::from(1 << 20)),
            Self::Count => format!("{value:.0}"),
            Self::Distance => format!("{value:.2e}"),
        }
    }
}

/// One value of one run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Value {
    pub name: String,
    pub kind: Kind,
    pub amount: f64,
}

/// The values of both revisions, turn by turn.
#[derive(Debug, Clone)]
pub(super) struct Quantity {
    pub name: String,
    kind: Kind,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// What a ratio means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// No more than a tenth is lost.
    Kept,
    /// More is, in the median, but not in most of the turns.
    Noise,
    /// More is.
    Lost,
}

/// Puts the values of one more turn to those there are.
///
/// # Errors
/// When the two revisions, or two turns, have different quantities, or what must be the same is not.
pub(super) fn add(
    quantities: &mut Vec<Quantity>,
    before: Vec<Value>,
    after: Vec<Value>,
) -> Result<()> {
    if quantities.is_empty() {
        quantities.extend(before.iter().map(|value| Quantity {
            name: value.name.clone(),
            kind: value.kind,
            before: Vec::new(),
            after: Vec::new(),
        }));
    }
    if [before.len(), after.len()] != [quantities.len(); 2] {
        bail!("the two revisions have different quantities");
    }
    for (quantity, (before, after)) in quantities.iter_mut().zip(before.into_iter().zip(after)) {
        if before.name != quantity.name || after.name != quantity.name {
            bail!("{} and {}: different quantities", before.name, after.name);
        }
        for (values, new) in [
            (&mut quantity.before, before.amount),
            (&mut quantity.after, after.amount),
        ] {
            if !new.is_finite() {
                bail!("{} is {new}", quantity.name);
            }
            #[expect(clippy::float_cmp, reason = "the same work gives the same bits")]
            let differs = values.first().is_some_and(|&first| first != new);
            if differs && !quantity.kind.varies() {
                bail!("{} is not the same in every run", quantity.name);
            }
            values.push(new);
        }
    }
    Ok(())
}

impl Quantity {
    /// Median after over median before. What was nothing and is something is infinitely more.
    fn ratio(&self) -> f64 {
        let [before, after] = [&self.before, &self.after].map(|values| median(values.clone()));
        if before > 0.0 {
            after / before
        } else if after > 0.0 {
            f64::INFINITY
        } else {
            1.0
        }
    }

    /// Whether more turns are needed to tell.
    pub(super) fn seems_lost(&self) -> bool {
        self.kind.varies() && self.ratio() > ALLOWED
    }

    /// What it means.
    pub(super) fn verdict(&self) -> Verdict {
        if self.ratio() <= ALLOWED {
            return Verdict::Kept;
        }
        let pairs = self.before.iter().zip(&self.after);
        let slower = pairs.filter(|(before, after)| after > before).count();
        if self.kind.varies() && (slower as f64) < AGREEING * self.before.len() as f64 {
            return Verdict::Noise;
        }
        Verdict::Lost
    }
}

/// The record as a section of a document.
pub(super) fn record(before: &str, after: &str, quantities: &[Quantity]) -> String {
    let count = |verdict| {
        let all = quantities.iter().map(Quantity::verdict);
        all.filter(|&found| found == verdict).count()
    };
    let mut text = format!(
        "## Regression record\n\n\
         `cargo xtask bench REVISION` writes this section: {after} against {before}. Both binaries worked in turns on one machine. Times are \
         processor time, user and system, of all threads; they and memory are medians of at least five turns, the rest is the same in every run. \
         *Convert* is `marquetry convert SCAN -o FILE --json -`; *decode* `marquetry verify FILE`, five times; *cut* `marquetry export FILE -o MESH.ply \
         --triangles N` with a tenth of the input's triangles, three times, and `marquetry measure FILE --against SCAN --triangles N --samples 100000`; *render* \
         `marquetry render FILE -o PICTURE.png --view 14 --size 900x600 --distance D --json -`, from 2.5 and 0.8 radii. Less is better \
         everywhere; a ratio above {ALLOWED} is a loss, unless it is of times and fewer than three quarters of the turns agree (noise).\n\n\
         {} kept, {} noise, {} lost.\n\n\
         | | before | after | ratio | |\n|---|---|---|---|---|\n",
        count(Verdict::Kept),
        count(Verdict::Noise),
        count(Verdict::Lost)
    );
    for quantity in quantities {
        let shown = |values: &[f64]| quantity.kind.shown(median(values.to_vec()));
        let word = match quantity.verdict() {
            Verdict::Kept => "",
            Verdict::Noise => "noise",
            Verdict::Lost => "LOST",
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.3} | {word} |",
            quantity.name,
            shown(&quantity.before),
            shown(&quantity.after),
            quantity.ratio()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantity(kind: Kind, before: &[f64], after: &[f64]) -> Quantity {
        Quantity {
            name: "x".to_owned(),
            kind,
            before: before.to_vec(),
            after: after.to_vec(),
        }
    }

    fn value(kind: Kind, amount: f64) -> Vec<Value> {
        vec![Value {
            name: "x".to_owned(),
            kind,
            amount,
        }]
    }

    #[test]
    fn a_tenth_more_is_kept_and_more_is_lost() {
        let verdict = |after| quantity(Kind::Count, &[100.0], &[after]).verdict();
        assert_eq!(verdict(50.0), Verdict::Kept);
        assert_eq!(verdict(110.0), Verdict::Kept);
        assert_eq!(verdict(111.0), Verdict::Lost);
        let nothing = |after| quantity(Kind::Count, &[0.0], &[after]).verdict();
        assert_eq!(nothing(0.0), Verdict::Kept);
        assert_eq!(nothing(1.0), Verdict::Lost);
    }

    #[test]
    fn times_are_lost_only_where_most_turns_agree() {
        let before = [1.0, 1.0, 1.0, 1.0, 1.0];
        let lost = quantity(Kind::Seconds, &before, &[1.2, 1.3, 0.9, 1.2, 1.2]);
        assert_eq!((lost.seems_lost(), lost.verdict()), (true, Verdict::Lost));
        // Three of five are slower, by much.
        let noisy = quantity(Kind::Seconds, &before, &[2.0, 0.9, 2.0, 0.9, 2.0]);
        assert_eq!(
            (noisy.seems_lost(), noisy.verdict()),
            (true, Verdict::Noise)
        );
        // One slow turn is not seen by the median.
        let once = quantity(Kind::Seconds, &before, &[1.0, 1.0, 9.0, 1.0, 1.0]);
        assert_eq!((once.seems_lost(), once.verdict()), (false, Verdict::Kept));
    }

    #[test]
    fn counts_must_not_change_from_turn_to_turn() {
        let mut all = Vec::new();
        let turn = |all: &mut Vec<Quantity>, kind, before, after| {
            add(all, value(kind, before), value(kind, after))
        };
        turn(&mut all, Kind::Count, 1.0, 2.0).unwrap();
        turn(&mut all, Kind::Count, 1.0, 2.0).unwrap();
        assert!(turn(&mut all, Kind::Count, 1.0, 3.0).is_err());
        let mut all = Vec::new();
        turn(&mut all, Kind::Seconds, 1.0, 2.0).unwrap();
        turn(&mut all, Kind::Seconds, 1.5, 2.5).unwrap();
        assert!(turn(&mut all, Kind::Seconds, f64::NAN, 2.5).is_err());
        assert!(add(&mut all, Vec::new(), value(Kind::Seconds, 1.0)).is_err());
    }

    #[test]
    fn the_record_has_a_row_a_quantity_and_sums() {
        let rows = [
            quantity(Kind::Count, &[200.0], &[100.0]),
            quantity(Kind::Distance, &[1e-4], &[2e-4]),
        ];
        let text = record("old", "new", &rows);
        assert!(text.contains("new against old"));
        assert!(text.contains("1 kept, 0 noise, 1 lost."));
        assert!(text.contains("| x | 200 | 100 | 0.500 |  |"));
        assert!(text.contains("| x | 1.00e-4 | 2.00e-4 | 2.000 | LOST |"));
    }
}
