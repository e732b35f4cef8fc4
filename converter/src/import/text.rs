//! Words and numbers of text formats, with the line they stand in.

use crate::error::{ParseError, Place};

/// Walks through the words of a text.
#[derive(Debug, Clone)]
pub(super) struct Words<'a> {
    rest: &'a [u8],
    line: u64,
}

impl<'a> Words<'a> {
    /// `line` is the number of the first line of `text`, counted from 1.
    pub(super) fn new(text: &'a [u8], line: u64) -> Self {
        Self { rest: text, line }
    }

    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// Bytes not yet read.
    pub(super) fn remaining(&self) -> u64 {
        self.rest.len() as u64
    }

    /// What is left.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Steps over `length` bytes, in which `lines` lines end.
    pub(super) fn skip_lines(&mut self, length: usize, lines: u64) {
        self.rest = self.rest.get(length..).unwrap_or_default();
        self.line += lines;
    }

    /// Moves to the next word, across lines, so that [`Self::place`] is its line.
    pub(super) fn skip_space(&mut self) {
        let line = &mut self.line;
        let start = self.rest.iter().position(|b| {
            *line += u64::from(*b == b'\n');
            !b.is_ascii_whitespace()
        });
        self.rest = &self.rest[start.unwrap_or(self.rest.len())..];
    }

    /// The next word, across lines.
    pub(super) fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let end = self
            .rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    /// Skips to the end of the line (the line break stays).
    pub(super) fn skip_line(&mut self) {
        let end = self
            .rest
            .iter()
            .position(|&b| b == b'\n')
            .unwrap_or(self.rest.len());
        self.rest = &self.rest[end..];
    }

    /// The next word as a number; `what` names it in the message.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, ParseError> {
        match self.next() {
            Some(word) => number(word, self.place(), what),
            None => Err(ParseError::truncated(
                self.place(),
                format!("{what} is missing"),
            )),
        }
    }
}

/// Lines with their numbers, counted from 1; line ends `\n`, `\r\n`, or `\r` alone.
pub(super) fn lines(text: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    // Old Mac files have `\r` alone; elsewhere `\r` is trimmed as white space.
    let end = if text.contains(&b'\n') { b'\n' } else { b'\r' };
    (1..).zip(text.split(move |&b| b == end))
}

/// `text` in pieces that end with a line and can be read independently of one another. A line longer than a piece stays whole.
pub(super) fn line_chunks(text: &[u8]) -> Vec<&[u8]> {
    /// Bytes; does not depend on the number of threads.
    const SIZE: usize = 1 << 18;
    let mut rest = text;
    let mut chunks = Vec::with_capacity(text.len() / SIZE + 1);
    while rest.len() > SIZE {
        let end = rest[SIZE..]
            .iter()
            .position(|&b| b == b'\n')
            .map_or(rest.len(), |i| SIZE + i + 1);
        let (chunk, tail) = rest.split_at(end);
        chunks.push(chunk);
        rest = tail;
    }
    if !rest.is_empty() {
        chunks.push(rest);
    }
    chunks
}

/// Line ends in `text`.
pub(super) fn count_lines(text: &[u8]) -> usize {
    text.iter().map(|&b| usize::from(b == b'\n')).sum()
}

pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|w| !w.is_empty())
}

/// A decimal number; what C libraries print for "not a number" and "infinity" is accepted.
pub(super) fn number(word: &[u8], place: Place, what: &str) -> Result<f64, ParseError> {
    if let Some(value) = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()) {
        return Ok(value);
    }
    let lower = word.to_ascii_lowercase();
    let is = |s: &[u8]| lower.windows(s.len()).any(|w| w == s);
    if is(b"nan") || is(b"#ind") || is(b"#qnan") || is(b"#snan") {
        return Ok(f64::NAN);
    }
    if is(b"#inf") {
        return Ok(f64::INFINITY);
    }
    Err(ParseError::syntax(
        place,
        format!("{what} should be a number, not {}", quoted(word)),
    ))
}

/// An integer.
pub(super) fn integer(word: &[u8], place: Place, what: &str) -> Result<i64, ParseError> {
    std::str::from_utf8(word)
        .ok()
        .and_then(|w| w.parse().ok())
        .ok_or_else(|| {
            ParseError::syntax(
                place,
                format!("{what} should be an integer, not {}", quoted(word)),
            )
        })
}

/// `word` for a message: printable and short.
pub(super) fn quoted(word: &[u8]) -> String {
    let shown = &word[..word.len().min(24)];
    format!(
        "\"{}{}\"",
        shown.escape_ascii(),
        if shown.len() < word.len() { "…" } else { "" }
    )
}
