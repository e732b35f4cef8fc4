//! Checks everything a reader relies on.
//!
//! Sections and content id are checked byte by byte, then every page is decoded, chart by chart. Of each page
//! only its border is kept, so memory follows the number of pages, not of samples. The pages section is read
//! in one request where it is not larger than [`WHOLE_READ_BYTES`], since a source may be far away.

mod bytes;
mod clusters;
mod colour;
mod pages;
mod thumbnail;

use crate::rules::Tally;
use crate::{ByteSource, Document, Error, Limits};

/// Largest pages section that is read at once, bytes.
pub const WHOLE_READ_BYTES: u64 = 1 << 29;

/// One check and how it went.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Check {
    /// What was checked.
    pub name: String,
    /// Whether nothing failed.
    pub ok: bool,
    /// How many things were checked.
    pub count: u64,
    /// The first failures, in words (at most 20).
    pub failures: Vec<String>,
}

/// All checks of a file.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Report {
    /// Whether all checks passed.
    pub ok: bool,
    /// The checks.
    pub checks: Vec<Check>,
}

impl Report {
    fn new() -> Self {
        Self {
            ok: true,
            checks: Vec::new(),
        }
    }

    fn add(&mut self, name: &str, tally: Tally) {
        let ok = tally.failures.is_empty();
        self.ok &= ok;
        self.checks.push(Check {
            name: name.to_owned(),
            ok,
            count: tally.count,
            failures: tally.failures,
        });
    }
}

/// Verifies a whole file: structure, checksums, glue both ways, shared borders bit-equal, errors monotone, balance.
///
/// # Errors
/// When the file cannot be opened at all; every later fault is in the report.
pub fn verify(source: &dyn ByteSource) -> Result<Report, Error> {
    let mut document = Document::open(source, Limits::default())?;
    let mut report = Report::new();
    report.add("front fits the first image", bytes::check_front(&document));
    report.add(
        "section checksums",
        bytes::check_sections(&document, source),
    );
    report.add("content id", bytes::check_content_id(&document, source));

    let mut index = Tally::default();
    for block in 0..document.index_block_count() {
        let loaded = source
            .read(document.index_block_range(block))
            .map_err(Error::from)
            .and_then(|bytes| document.load_index_block(block, &bytes));
        index.check(loaded.is_ok(), || {
            format!("index block {block}: {}", in_words(loaded))
        });
    }
    let complete = index.failures.is_empty();
    report.add("index blocks", index);
    if complete {
        pages::check(&document, source, &mut report);
    }
    clusters::check(&document, source, &mut report);
    colour::check(&document, source, &mut report);
    thumbnail::check(&document, source, &mut report);
    Ok(report)
}

fn in_words<T>(result: Result<T, Error>) -> String {
    result
        .err()
        .map_or_else(String::new, |error| error.to_string())
}
