//! Byte ranges of a request (RFC 9110, section 14).
//!
//! A header that is not a valid set of byte ranges is ignored, as the RFC allows, and so is every range
//! unit but `bytes`. Ranges that overlap or touch are merged, so no answer is longer than the file; a
//! set of more than [`MAX_RANGES`] is refused as not satisfiable, the RFC's answer to abuse.

use std::ops::Range;

/// Ranges in one request; each costs about 100 bytes of multipart header.
pub(crate) const MAX_RANGES: usize = 32;

/// What a `Range` header selects.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Selection {
    /// The whole representation (200): no range, or none that we understand.
    Whole,
    /// These parts (206): at least one, none empty, disjoint, inside the representation.
    Parts(Vec<Range<u64>>),
    /// None of the ranges touches the representation, or they are too many (416).
    Unsatisfiable,
}

/// Reads the value of a `Range` header for a representation of `length` bytes.
pub(crate) fn select(header: &str, length: u64) -> Selection {
    let Some((unit, set)) = header.split_once('=') else {
        return Selection::Whole;
    };
    if !unit.trim().eq_ignore_ascii_case("bytes") {
        return Selection::Whole;
    }
    let mut parts = Vec::new();
    let mut specs = 0;
    for spec in set.split(',').map(|s| s.trim_matches([' ', '\t'])) {
        // The list syntax of section 5.6.1 allows empty elements.
        if spec.is_empty() {
            continue;
        }
        specs += 1;
        match parse(spec, length) {
            None => return Selection::Whole,
            Some(range) if range.is_empty() => {}
            Some(range) => parts.push(range),
        }
    }
    if specs == 0 {
        Selection::Whole
    } else if parts.is_empty() || specs > MAX_RANGES {
        Selection::Unsatisfiable
    } else {
        Selection::Parts(merge(parts))
    }
}

/// One `first-last`, `first-` or `-suffix`: `None` when it is not valid, an empty range when it is not satisfiable.
fn parse(spec: &str, length: u64) -> Option<Range<u64>> {
    let (first, last) = spec.split_once('-')?;
    match (first, last) {
        ("", suffix) => Some(length.saturating_sub(number(suffix)?)..length),
        (first, "") => Some(number(first)?.min(length)..length),
        (first, last) => {
            let (first, last) = (number(first)?, number(last)?);
            (first <= last).then(|| first.min(length)..last.saturating_add(1).min(length))
        }
    }
}

/// A decimal number; one too large for `u64` counts as the largest, which is beyond any file.
fn number(digits: &str) -> Option<u64> {
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    Some(digits.parse().unwrap_or(u64::MAX))
}

/// Merges ranges that overlap or touch. Disjoint ranges keep the order they were asked in.
fn merge(parts: Vec<Range<u64>>) -> Vec<Range<u64>> {
    let mut sorted = parts.clone();
    sorted.sort_by_key(|range| range.start);
    if sorted.windows(2).all(|pair| pair[0].end < pair[1].start) {
        return parts;
    }
    let mut merged: Vec<Range<u64>> = Vec::with_capacity(sorted.len());
    for range in sorted {
        match merged.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            _ => merged.push(range),
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selects_what_rfc_9110_says() {
        use Selection::{Unsatisfiable, Whole};
        let parts = |ranges: &[(u64, u64)]| {
            Selection::Parts(
                ranges
                    .iter()
                    .map(|&(first, last)| first..last + 1)
                    .collect(),
            )
        };
        let huge = "9".repeat(40);
        // Representation of 1000 bytes; expected parts as first and last byte.
        let table: Vec<(String, Selection)> = [
            // int-range
            ("bytes=0-0", parts(&[(0, 0)])),
            ("bytes=0-499", parts(&[(0, 499)])),
            ("bytes=500-999", parts(&[(500, 999)])),
            ("bytes=999-999", parts(&[(999, 999)])),
            ("bytes=900-2000", parts(&[(900, 999)])),
            ("bytes=0-999", parts(&[(0, 999)])),
            ("bytes=00010-00019", parts(&[(10, 19)])),
            // open end
            ("bytes=0-", parts(&[(0, 999)])),
            ("bytes=999-", parts(&[(999, 999)])),
            // suffix
            ("bytes=-1", parts(&[(999, 999)])),
            ("bytes=-500", parts(&[(500, 999)])),
            ("bytes=-1000", parts(&[(0, 999)])),
            ("bytes=-5000", parts(&[(0, 999)])),
            // not satisfiable
            ("bytes=1000-", Unsatisfiable),
            ("bytes=1000-1000", Unsatisfiable),
            ("bytes=-0", Unsatisfiable),
            ("bytes=1000-,2000-3000", Unsatisfiable),
            // one that is satisfiable is enough
            ("bytes=1000-,0-1", parts(&[(0, 1)])),
            // several
            ("bytes=0-1,5-6", parts(&[(0, 1), (5, 6)])),
            ("bytes=5-6,0-1", parts(&[(5, 6), (0, 1)])),
            ("bytes=0-1 , 5-6", parts(&[(0, 1), (5, 6)])),
            ("bytes=0-1,\t5-6", parts(&[(0, 1), (5, 6)])),
            ("bytes=,0-1,,5-6,", parts(&[(0, 1), (5, 6)])),
            ("bytes=0-0,-1", parts(&[(0, 0), (999, 999)])),
            // overlapping or touching
            ("bytes=0-10,5-20", parts(&[(0, 20)])),
            ("bytes=0-10,11-20", parts(&[(0, 20)])),
            ("bytes=0-10,12-20", parts(&[(0, 10), (12, 20)])),
            ("bytes=0-,-1", parts(&[(0, 999)])),
            ("bytes=500-600,0-999", parts(&[(0, 999)])),
            // the unit is case-insensitive
            ("Bytes=0-0", parts(&[(0, 0)])),
            ("BYTES=0-0", parts(&[(0, 0)])),
            // another unit, or no valid set: ignored
            ("items=0-1", Whole),
            ("", Whole),
            ("bytes", Whole),
            ("bytes=", Whole),
            ("bytes=,", Whole),
            ("bytes=-", Whole),
            ("bytes=5-4", Whole),
            ("bytes=a-b", Whole),
            ("bytes=0x1-2", Whole),
            ("bytes=1-2-3", Whole),
            ("bytes=--1", Whole),
            ("bytes=+1-2", Whole),
            ("bytes=1.5-2", Whole),
            ("bytes=0-1;5-6", Whole),
            ("bytes=0-1,x", Whole),
            ("bytes=0 -1", Whole),
        ]
        .into_iter()
        .map(|(header, selection)| (header.to_owned(), selection))
        .chain([
            (format!("bytes={huge}-"), Unsatisfiable),
            (format!("bytes=0-{huge}"), parts(&[(0, 999)])),
            (format!("bytes=-{huge}"), parts(&[(0, 999)])),
            (
                format!("bytes={}", ["0-0"; MAX_RANGES].join(",")),
                parts(&[(0, 0)]),
            ),
            (
                format!("bytes={}", ["0-0"; MAX_RANGES + 1].join(",")),
                Unsatisfiable,
            ),
        ])
        .collect();
        for (header, expected) in table {
            assert_eq!(select(&header, 1000), expected, "{header}");
        }
    }

    #[test]
    fn nothing_of_an_empty_file_is_satisfiable() {
        for header in ["bytes=0-", "bytes=0-0", "bytes=-1"] {
            assert_eq!(select(header, 0), Selection::Unsatisfiable, "{header}");
        }
    }

    #[test]
    fn a_file_of_the_greatest_length_does_not_overflow() {
        let header = format!("bytes=0-{}", u64::MAX);
        let expected = Selection::Parts(std::iter::once(0..u64::MAX).collect());
        assert_eq!(select(&header, u64::MAX), expected);
    }
}
