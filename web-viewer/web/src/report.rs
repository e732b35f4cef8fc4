//! What the page is told, as JSON; the keys are those of `marquetry render --json`.

use marquetry_engine::Stats;
use std::fmt::Write as _;

/// How long the last frame took, as JavaScript's clock has it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrameTimes {
    /// Milliseconds from one picture to the next while pictures follow each other.
    pub frame_ms: f64,
    /// Milliseconds that one call to update and draw took.
    pub cpu_ms: f64,
}

/// The report of `stats()`. `gpu_ms` is null: WebGPU tells time only behind a flag.
pub fn stats_json(stats: &Stats, times: FrameTimes, adapter: &str) -> String {
    let Stats {
        triangles,
        nodes,
        draw_calls,
        pages,
        tiles,
        cache,
        failures,
        error_px,
    } = stats;
    format!(
        concat!(
            r#"{{"frame_ms":{},"cpu_ms":{},"gpu_ms":null,"triangles":{},"nodes":{},"draw_calls":{},"#,
            r#""pages":{{"requested":{},"fetched":{},"bytes":{},"missing":{}}},"#,
            r#""tiles":{{"requested":{},"fetched":{},"bytes":{},"missing":{},"used_bytes":{},"evictions":{}}},"#,
            r#""cache":{{"capacity_bytes":{},"used_bytes":{},"pinned_bytes":{},"evictions":{}}},"#,
            r#""failures":{},"error_px":{},"adapter":{}}}"#
        ),
        number(times.frame_ms),
        number(times.cpu_ms),
        triangles,
        nodes,
        draw_calls,
        pages.requested,
        pages.fetched,
        pages.bytes,
        pages.missing,
        tiles.requested,
        tiles.fetched,
        tiles.bytes,
        tiles.missing,
        tiles.used_bytes,
        tiles.evictions,
        cache.capacity_bytes,
        cache.used_bytes,
        cache.pinned_bytes,
        cache.evictions,
        failures,
        number(*error_px),
        quoted(adapter),
    )
}

/// A JSON number; null where there is none.
fn number(value: f64) -> String {
    if value.is_finite() {
        value.to_string()
    } else {
        "null".to_owned()
    }
}

/// A JSON string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => {
                out.push('\\');
                out.push(letter);
            }
            '\u{0}'..='\u{1f}' => {
                // Writing to a string cannot fail.
                let _ = write!(out, "\\u{:04x}", u32::from(letter));
            }
            _ => out.push(letter),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn report_has_the_keys_of_the_contract() {
        let json = stats_json(&Stats::default(), FrameTimes::default(), "a GPU");
        for key in [
            "frame_ms",
            "cpu_ms",
            "gpu_ms",
            "triangles",
            "nodes",
            "draw_calls",
            "pages",
            "requested",
            "fetched",
            "bytes",
            "missing",
            "tiles",
            "cache",
            "capacity_bytes",
            "used_bytes",
            "evictions",
            "adapter",
        ] {
            assert!(json.contains(&format!("\"{key}\":")), "{key} in {json}");
        }
    }

    #[test]
    fn no_number_is_null() {
        let times = FrameTimes {
            frame_ms: f64::NAN,
            cpu_ms: f64::INFINITY,
        };
        let json = stats_json(&Stats::default(), times, "");
        assert!(
            json.starts_with(r#"{"frame_ms":null,"cpu_ms":null,"#),
            "{json}"
        );
    }

    #[test]
    fn text_is_escaped() {
        assert_eq!(quoted("a\"b\\c\n\u{1}é"), r#""a\"b\\c\u000a\u0001é""#);
    }
}
