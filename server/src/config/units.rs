//! Durations and sizes as people write them: `30s`, `500ms`, `2m`, `64MiB`.

use std::time::Duration;

/// Reads a duration: a number with `ms`, `s`, `m` or `h`; without a unit, seconds.
pub fn duration_of(text: &str) -> Option<Duration> {
    let (number, unit) = split(text)?;
    let seconds = match unit {
        "ms" => number / 1e3,
        "" | "s" => number,
        "m" | "min" => number * 60.0,
        "h" => number * 3600.0,
        _ => return None,
    };
    // Years are a mistake, and overflow is near.
    (seconds <= 1e7).then(|| Duration::from_secs_f64(seconds))
}

/// Reads a size: a number with `K`, `M` or `G`, powers of 1024, optionally followed by `B` or `iB`.
pub fn bytes_of(text: &str) -> Option<u64> {
    let (number, unit) = split(text)?;
    let unit = unit.trim_end_matches('B').trim_end_matches('i');
    let scale: u64 = match unit {
        "" => 1,
        "K" | "k" => 1 << 10,
        "M" => 1 << 20,
        "G" => 1 << 30,
        "T" => 1 << 40,
        _ => return None,
    };
    let bytes = number * scale as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked just before"
    )]
    (bytes <= 2f64.powi(53)).then_some(bytes as u64)
}

fn split(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let end = text
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(text.len());
    let (number, unit) = text.split_at_checked(end)?;
    let number: f64 = number.parse().ok()?;
    number.is_finite().then_some((number, unit.trim()))
}

fn duration_text(duration: Duration) -> String {
    let ms = duration.as_millis();
    if ms.is_multiple_of(1000) {
        format!("{}s", ms / 1000)
    } else {
        format!("{ms}ms")
    }
}

fn bytes_text(bytes: u64) -> String {
    for (shift, unit) in [(30, "GiB"), (20, "MiB"), (10, "KiB")] {
        if bytes > 0 && bytes.trailing_zeros() >= shift {
            return format!("{}{unit}", bytes >> shift);
        }
    }
    bytes.to_string()
}

/// A value that may be a bare number or a text with a unit.
#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Written {
    Whole(u64),
    Fraction(f64),
    Text(String),
}

impl Written {
    fn text(self) -> String {
        match self {
            Self::Whole(number) => number.to_string(),
            Self::Fraction(number) => number.to_string(),
            Self::Text(text) => text,
        }
    }
}

/// Serde for durations.
pub(super) mod duration {
    use super::{Duration, Written, duration_of, duration_text};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(in super::super) fn serialize<S: Serializer>(
        duration: &Duration,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&duration_text(*duration))
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Duration, D::Error> {
        let text = Written::deserialize(deserializer)?.text();
        duration_of(&text)
            .ok_or_else(|| D::Error::custom(format!("{text:?} is no duration such as \"30s\"")))
    }
}

/// Serde for sizes.
pub(super) mod bytes {
    use super::{Written, bytes_of, bytes_text};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
    pub(in super::super) fn serialize<S: Serializer>(
        bytes: &u64,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&bytes_text(*bytes))
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<u64, D::Error> {
        let text = Written::deserialize(deserializer)?.text();
        bytes_of(&text)
            .ok_or_else(|| D::Error::custom(format!("{text:?} is no size such as \"64MiB\"")))
    }
}

/// What the JSON Schema says of a duration.
#[cfg(test)]
#[derive(schemars::JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "only its schema is wanted")]
pub(super) enum DurationSchema {
    /// Seconds.
    Seconds(f64),
    /// A number with `ms`, `s`, `m` or `h`.
    Text(#[schemars(regex(pattern = r"^[0-9.]+ *(ms|s|m|min|h)?$"))] String),
}

/// What the JSON Schema says of a size.
#[cfg(test)]
#[derive(schemars::JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "only its schema is wanted")]
pub(super) enum BytesSchema {
    /// Bytes.
    Bytes(u64),
    /// A number with `K`, `M`, `G` or `T`, powers of 1024.
    Text(#[schemars(regex(pattern = r"^[0-9.]+ *([KkMGT]i?)?B?$"))] String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_and_written() {
        for (text, ms) in [
            ("30s", 30_000),
            ("30", 30_000),
            ("1.5 s", 1_500),
            ("250ms", 250),
            ("2m", 120_000),
            ("1h", 3_600_000),
            ("0", 0),
        ] {
            let duration = Duration::from_millis(ms);
            assert_eq!(duration_of(text), Some(duration), "{text}");
            assert_eq!(duration_of(&duration_text(duration)), Some(duration));
        }
        for text in [
            "",
            "s",
            "-1s",
            "1 fortnight",
            "nan",
            "1e3",
            "1.2.3s",
            "999999h",
        ] {
            assert_eq!(duration_of(text), None, "{text}");
        }
    }

    #[test]
    fn sizes_are_read_and_written() {
        for (text, bytes) in [
            ("0", 0),
            ("12", 12),
            ("1K", 1024),
            ("64MiB", 64 << 20),
            ("1.5GB", 3 << 29),
            ("10 MiB", 10 << 20),
        ] {
            assert_eq!(bytes_of(text), Some(bytes), "{text}");
            assert_eq!(bytes_of(&bytes_text(bytes)), Some(bytes));
        }
        for text in ["", "MiB", "-1", "1 pint", "99999999999G"] {
            assert_eq!(bytes_of(text), None, "{text}");
        }
    }
}
