//! The report: a row a case, as lines for a terminal and as a document.

use super::{Found, Outcome, Part};
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// What came of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The part of the list.
    pub part: Part,
    /// The case.
    pub name: String,
    /// What was required.
    pub required: String,
    /// What came.
    pub outcome: Outcome,
    /// By the clock.
    pub seconds: f64,
}

/// How many cases ended how.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// As required.
    pub met: usize,
    /// Otherwise.
    pub missed: usize,
    /// Not built.
    pub open: usize,
    /// Not run for lack of something.
    pub ignored: usize,
}

impl Tally {
    /// Counts `rows`.
    pub fn of(rows: &[Row]) -> Self {
        let mut tally = Self::default();
        for row in rows {
            match row.outcome {
                Outcome::Met(_) => tally.met += 1,
                Outcome::Missed(_) => tally.missed += 1,
                Outcome::Open(_) => tally.open += 1,
                Outcome::Ignored(_) => tally.ignored += 1,
            }
        }
        tally
    }
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            met,
            missed,
            open,
            ignored,
        } = self;
        let all = met + missed + open + ignored;
        write!(
            f,
            "{all} cases: {met} as required, {missed} missed, {open} open, {ignored} ignored"
        )
    }
}

impl Row {
    /// Mark, error, largest distance of its bound, words.
    fn columns(&self) -> [String; 4] {
        let plain = |mark: &str, words: &str| {
            let dash = "–".to_owned();
            [mark.to_owned(), dash.clone(), dash, words.to_owned()]
        };
        match &self.outcome {
            Outcome::Met(found) => {
                let mut columns = plain("met", &found.words);
                if let Some(rms) = found.rms_rel {
                    columns[1] = format!("{rms:.1e}");
                }
                if let Some([largest, bound]) = found.largest_rel {
                    columns[2] = format!("{largest:.1e} of {bound:.1e}");
                }
                columns
            }
            Outcome::Missed(why) => plain("MISSED", why),
            Outcome::Open(why) => plain("open", why),
            Outcome::Ignored(why) => plain("ignored", why),
        }
    }

    /// For a terminal.
    pub fn line(&self) -> String {
        let [mark, rms, largest, words] = self.columns();
        format!(
            "{mark:<7} {:>7.1} s  {}: {} ({}) rms {rms}, largest {largest}; {words}",
            self.seconds,
            self.part.name(),
            self.name,
            self.required
        )
    }
}

impl Row {
    /// As one line of JSON.
    pub fn to_json(&self) -> String {
        let (kind, words) = match &self.outcome {
            Outcome::Met(found) => ("met", &found.words),
            Outcome::Missed(why) => ("missed", why),
            Outcome::Open(why) => ("open", why),
            Outcome::Ignored(why) => ("ignored", why),
        };
        let (mut rms, mut largest) = (None, None);
        if let Outcome::Met(found) = &self.outcome {
            (rms, largest) = (found.rms_rel, found.largest_rel);
        }
        json!({
            "part": self.part.name(), "name": self.name, "required": self.required, "seconds": self.seconds,
            "outcome": kind, "words": words, "rms_rel": rms, "largest_rel": largest,
        })
        .to_string()
    }

    /// From [`Self::to_json`].
    ///
    /// # Errors
    /// When it is anything else.
    pub fn from_json(line: &str) -> Result<Self> {
        let value: Value = serde_json::from_str(line).context("no JSON")?;
        let text = |key: &str| {
            let text = value[key].as_str().map(str::to_owned);
            text.with_context(|| format!("no {key} in {line}"))
        };
        let part = text("part")?;
        let words = text("words")?;
        let largest = value["largest_rel"].as_array().map(Vec::as_slice);
        Ok(Self {
            part: Part::ALL
                .into_iter()
                .find(|known| known.name() == part)
                .with_context(|| format!("no part {part}"))?,
            name: text("name")?,
            required: text("required")?,
            seconds: value["seconds"].as_f64().context("no seconds")?,
            outcome: match text("outcome")?.as_str() {
                "met" => Outcome::Met(Found {
                    words,
                    rms_rel: value["rms_rel"].as_f64(),
                    largest_rel: match largest {
                        Some([a, b]) => a.as_f64().zip(b.as_f64()).map(<[f64; 2]>::from),
                        _ => None,
                    },
                }),
                "missed" => Outcome::Missed(words),
                "open" => Outcome::Open(words),
                _ => Outcome::Ignored(words),
            },
        })
    }
}

/// A table a part, in the order of the list, and the sums before them.
pub fn document(rows: &[Row]) -> String {
    let mut text = format!(
        "# Stability\n\n\
         Where methods fail, what must come of it, and what came. `cargo xtask stability` writes this file; `cargo xtask stability WORDS` \
         runs the cases that have all the words in their names. Meshes are made by formula, with fixed seeds \
         (`tests/src/stability`); files are those of `../shared/data/difficult`.\n\n\
         RMS and largest distance are parts of the diagonal of the bounds, measured both ways; *of* names the bound that the file states. \
         Generated meshes convert at a target of 5e-4 unless their name says otherwise, files at 1e-4. Seconds are by the clock, on two cores with other programs beside.\n\n\
         {}.\n",
        Tally::of(rows)
    );
    // Writing to a string does not fail.
    for part in Part::ALL {
        let mut of_part = rows.iter().filter(|row| row.part == part).peekable();
        if of_part.peek().is_none() {
            continue;
        }
        let _ = write!(
            text,
            "\n## {}\n\n| case | required | outcome | RMS | largest | s | |\n|---|---|---|---|---|---|---|\n",
            part.name()
        );
        for row in of_part {
            let [mark, rms, largest, words] = row.columns();
            let _ = writeln!(
                text,
                "| {} | {} | {mark} | {rms} | {largest} | {:.1} | {} |",
                cell(&row.name),
                cell(&row.required),
                row.seconds,
                cell(&words)
            );
        }
    }
    text
}

/// Text that stays within its cell.
fn cell(text: &str) -> String {
    let line: Vec<&str> = text.split_whitespace().collect();
    line.join(" ").replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(part: Part, name: &str, outcome: Outcome) -> Row {
        Row {
            part,
            name: name.to_owned(),
            required: "converts".to_owned(),
            outcome,
            seconds: 1.25,
        }
    }

    fn rows() -> Vec<Row> {
        let found = Found {
            words: "2 charts".to_owned(),
            rms_rel: Some(4.25e-4),
            largest_rel: Some([1e-3, 2e-3]),
        };
        vec![
            row(Part::Scale, "large", Outcome::Ignored("no file".to_owned())),
            row(Part::Topology, "ears", Outcome::Met(found)),
            row(
                Part::Topology,
                "a | b",
                Outcome::Missed("one\ntwo".to_owned()),
            ),
            row(
                Part::Terrain,
                "voids",
                Outcome::Open("not built".to_owned()),
            ),
        ]
    }

    #[test]
    fn every_case_has_a_row_in_its_part() {
        let text = document(&rows());
        let place = |words: &str| {
            text.find(words)
                .unwrap_or_else(|| panic!("{words}\n{text}"))
        };
        assert!(text.contains("4 cases: 1 as required, 1 missed, 1 open, 1 ignored"));
        let ears = place("| ears | converts | met | 4.2e-4 | 1.0e-3 of 2.0e-3 | 1.2 | 2 charts |");
        let other = place("| a \\| b | converts | MISSED | – | – | 1.2 | one two |");
        assert!(place("## Topology") < ears && ears < other && other < place("## Terrain"));
        assert!(place("## Terrain") < place("## Scale"));
        assert!(!text.contains("## Numbers"));
    }

    #[test]
    fn rows_survive_as_json() {
        for row in rows() {
            assert_eq!(Row::from_json(&row.to_json()).unwrap(), row);
        }
        assert!(Row::from_json("{}").is_err());
    }

    #[test]
    fn lines_name_the_outcome() {
        let lines: Vec<String> = rows().iter().map(Row::line).collect();
        for (line, mark) in lines.iter().zip(["ignored", "met", "MISSED", "open"]) {
            assert!(line.starts_with(mark), "{line}");
        }
    }
}
