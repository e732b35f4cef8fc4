//! Any `Range` header, for a file of any length: parts are not empty, disjoint, inside, and few.

#![no_main]

#[path = "../../src/range.rs"]
#[allow(dead_code, unreachable_pub)]
mod range;

use libfuzzer_sys::fuzz_target;
use range::{MAX_RANGES, Selection, select};

fuzz_target!(|input: (u64, &str)| {
    let (length, header) = input;
    for header in [header.to_owned(), format!("bytes={header}")] {
        let Selection::Parts(parts) = select(&header, length) else {
            continue;
        };
        assert!(!parts.is_empty() && parts.len() <= MAX_RANGES);
        let mut sorted = parts.clone();
        sorted.sort_by_key(|part| part.start);
        for part in &sorted {
            assert!(part.start < part.end && part.end <= length);
        }
        for pair in sorted.windows(2) {
            assert!(pair[0].end < pair[1].start);
        }
        // Said again in its own words, a selection is the same.
        let words: Vec<_> = parts
            .iter()
            .map(|part| format!("{}-{}", part.start, part.end - 1))
            .collect();
        let again = select(&format!("bytes={}", words.join(",")), length);
        assert_eq!(again, Selection::Parts(parts));
    }
});
