//! Readers of option values. Each error names what was expected; clap adds the option.

/// A number of bytes with an optional suffix K, M, G or T (powers of 1024; `iB` or `B` may follow).
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let wrong = || "expected a number of bytes, such as 4096, 512M or 4GiB".to_owned();
    let end = text
        .find(|c: char| c.is_ascii_alphabetic())
        .unwrap_or(text.len());
    let (number, suffix) = text.split_at(end);
    let shift = match suffix.to_ascii_uppercase().as_str() {
        "" | "B" => 0,
        "K" | "KB" | "KIB" => 10,
        "M" | "MB" | "MIB" => 20,
        "G" | "GB" | "GIB" => 30,
        "T" | "TB" | "TIB" => 40,
        _ => return Err(wrong()),
    };
    let number: u64 = number.trim().parse().ok().ok_or_else(wrong)?;
    number.checked_mul(1 << shift).ok_or_else(wrong)
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| value.is_finite() && *value > 0.0)
        .ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// A relative error: above 0, at most 1.
pub(super) fn relative(text: &str) -> Result<f64, String> {
    positive(text)
        .ok()
        .filter(|value| *value <= 1.0)
        .ok_or_else(|| "expected a number above 0 and at most 1, such as 1e-4".to_owned())
}

/// A size in pixels, as `WIDTHxHEIGHT`.
pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    /// What graphics cards of the last decade can draw into.
    const MAX: u32 = 8192;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX).contains(side));
    text.split_once('x')
        .and_then(|(width, height)| Some([side(width)?, side(height)?]))
        .ok_or_else(|| {
            format!("expected WIDTHxHEIGHT in pixels, such as 1280x720, sides 1 to {MAX}")
        })
}

/// Eye and target, as six numbers `eye.x,y,z,target.x,y,z`.
pub(super) fn camera(text: &str) -> Result<String, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|number| number.trim().parse().ok().filter(|n: &f64| n.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some([a, b, c, d, e, f]) if [a, b, c] != [d, e, f] => Ok(text.to_owned()),
        _ => Err(
            "expected six numbers, eye and target: x,y,z,x,y,z; not the same point twice".into(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_take_suffixes() {
        for (text, expected) in [
            ("0", Some(0)),
            ("4096", Some(4096)),
            ("1K", Some(1024)),
            ("512m", Some(512 << 20)),
            ("4GiB", Some(4 << 30)),
            ("4 GB", Some(4 << 30)),
            ("1T", Some(1 << 40)),
            ("17B", Some(17)),
            ("", None),
            ("G", None),
            ("-1", None),
            ("1.5G", None),
            ("1X", None),
            ("99999999999T", None),
        ] {
            assert_eq!(bytes(text).ok(), expected, "{text}");
        }
    }

    #[test]
    fn numbers_keep_to_their_range() {
        assert_eq!(positive("2.5"), Ok(2.5));
        assert_eq!(relative("1e-4"), Ok(1e-4));
        for text in ["0", "-1", "nan", "inf", "", "a"] {
            assert!(positive(text).is_err() && relative(text).is_err(), "{text}");
        }
        assert!(relative("1.5").is_err());
    }

    #[test]
    fn sizes_are_two_positive_integers() {
        assert_eq!(size("1280x720"), Ok([1280, 720]));
        for text in [
            "", "x", "1280", "0x1", "1x0", "1x1x1", "-1x1", "8193x1", "1 x 1",
        ] {
            assert!(size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn cameras_are_two_different_points() {
        assert!(camera("0,0,1,0,0,0").is_ok());
        assert!(camera("0, -1.5, 1e3, 0, 0, 0").is_ok());
        for text in ["", "1,2,3", "0,0,0,0,0,0", "0,0,nan,0,0,0", "1,2,3,4,5,6,7"] {
            assert!(camera(text).is_err(), "{text}");
        }
    }
}
