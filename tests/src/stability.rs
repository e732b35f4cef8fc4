//! Where methods fail: the design's list as cases, each with what must come of it.
//!
//! Tests run the quick ones in a reduced form, `cargo xtask stability` all of them in full. Nothing in a case depends on chance: meshes are
//! made by formula, with fixed seeds, and fetches are answered step by step.

mod attributes;
mod catalogue;
mod elsewhere;
mod files;
mod meshes;
mod model;
mod named;
mod scale;
mod soup;
mod streaming;
mod table;

pub use catalogue::catalogue;
pub use files::DIFFICULT;
pub use named::missing_tests;
pub use table::{Row, Tally, document};

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::time::Instant;

/// A part of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// How triangles hang together.
    Topology,
    /// What coordinates can be.
    Numbers,
    /// How surfaces bend.
    Shape,
    /// Meshes that others made.
    Files,
    /// How charts hang together.
    Glue,
    /// What networks, caches and cameras do.
    Streaming,
    /// Colours, materials and texture coordinates.
    Attributes,
    /// Objects that come and go.
    Time,
    /// Height fields.
    Terrain,
    /// Size, threads and ends before time.
    Scale,
    /// What is no mesh.
    Input,
}

impl Part {
    /// All, in the order of the report.
    pub const ALL: [Self; 11] = [
        Self::Topology,
        Self::Numbers,
        Self::Shape,
        Self::Files,
        Self::Glue,
        Self::Streaming,
        Self::Attributes,
        Self::Time,
        Self::Terrain,
        Self::Scale,
        Self::Input,
    ];

    /// Its heading.
    pub fn name(self) -> &'static str {
        match self {
            Self::Topology => "Topology",
            Self::Numbers => "Numbers",
            Self::Shape => "Shape",
            Self::Files => "Difficult files",
            Self::Glue => "Glue",
            Self::Streaming => "Streaming",
            Self::Attributes => "Attributes",
            Self::Time => "Time",
            Self::Terrain => "Terrain",
            Self::Scale => "Scale",
            Self::Input => "Input that is no mesh",
        }
    }
}

/// How much of a case is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// As much as do for a change.
    Reduced,
    /// All of it.
    Whole,
}

/// What was found where all is as required.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Found {
    /// In words.
    pub words: String,
    /// RMS distance over the diagonal.
    pub rms_rel: Option<f64>,
    /// Largest distance found, and what the file states as its bound.
    pub largest_rel: Option<[f64; 2]>,
}

/// What came of a case.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// What was required.
    Met(Found),
    /// Something else.
    Missed(String),
    /// What the case is about is not built yet.
    Open(String),
    /// This machine lacks what the case needs.
    Ignored(String),
}

/// Runs one case.
type Run = Box<dyn Fn(Depth) -> Result<Outcome> + Send + Sync>;

/// One case.
pub struct Case {
    /// The part of the list.
    pub part: Part,
    /// The test that runs it in its reduced form; `None` for those of the report alone.
    pub set: Option<&'static str>,
    /// Unique.
    pub name: String,
    /// What must come of it, in words.
    pub required: String,
    run: Run,
}

impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Case")
            .field("part", &self.part)
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl Case {
    /// Something that is on the list and not built yet.
    fn open(part: Part, name: &str, why: &'static str) -> Self {
        Self {
            part,
            set: None,
            name: name.to_owned(),
            required: "converts".to_owned(),
            run: Box::new(move |_| Ok(Outcome::Open(why.to_owned()))),
        }
    }

    /// Whether every one of `words` is in its part or its name, whatever their case.
    pub fn is_named(&self, words: &[String]) -> bool {
        let all = format!("{} {}", self.part.name(), self.name).to_lowercase();
        words.iter().all(|word| all.contains(&word.to_lowercase()))
    }

    /// Runs it. What cannot be run is missed; a panic is, too.
    pub fn row(&self, depth: Depth) -> Row {
        let start = Instant::now();
        let run = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| (self.run)(depth)));
        let outcome = match run {
            Ok(Ok(outcome)) => outcome,
            Ok(Err(error)) => Outcome::Missed(format!("{error:#}")),
            Err(_) => Outcome::Missed("a panic".to_owned()),
        };
        Row {
            part: self.part,
            name: self.name.clone(),
            required: self.required.clone(),
            outcome,
            seconds: start.elapsed().as_secs_f64(),
        }
    }
}

/// A number of a conversion's report.
fn number(report: &Value, pointer: &str) -> Result<f64> {
    let value = report.pointer(pointer).and_then(Value::as_f64);
    value.with_context(|| format!("no {pointer} in {report}"))
}

/// RMS distance, the largest one and its bound, which are as they should be.
fn errors(report: &Value) -> Result<[f64; 3]> {
    let [rms, largest, bound, target] = [
        number(report, "/error/rms_rel")?,
        number(report, "/error/hausdorff_rel")?,
        number(report, "/error/max_rel")?,
        number(report, "/error/target_rel")?,
    ];
    ensure!(rms <= target && largest <= bound, "{report}");
    Ok([rms, largest, bound])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(run: impl Fn() -> Result<Outcome> + Send + Sync + 'static) -> Case {
        Case {
            part: Part::Shape,
            set: None,
            name: "Pole of valence 9".to_owned(),
            required: "converts".to_owned(),
            run: Box::new(move |_| run()),
        }
    }

    fn outcome(case: &Case) -> Outcome {
        case.row(Depth::Reduced).outcome
    }

    #[test]
    fn errors_and_panics_are_missed() {
        let wrong = case(|| anyhow::bail!("wrong"));
        assert_eq!(outcome(&wrong), Outcome::Missed("wrong".to_owned()));
        let panics = case(|| panic!("on purpose"));
        assert_eq!(outcome(&panics), Outcome::Missed("a panic".to_owned()));
    }

    #[test]
    fn names_are_found_by_words() {
        let case = case(|| anyhow::bail!("never run"));
        let is_named = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
            case.is_named(&words)
        };
        assert!(is_named(&[]) && is_named(&["pole", "VALENCE"]) && is_named(&["shape", "9"]));
        assert!(!is_named(&["pole", "torus"]));
    }
}
