//! Names of served files.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use std::fmt;

/// How the names of served files end on disk.
pub(crate) const EXTENSION: &str = ".marq";

/// Everything but the unreserved characters of RFC 3986 and the separator.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'-')
    .remove(b'.')
    .remove(b'_')
    .remove(b'~')
    .remove(b'/');

/// The name of a served file: its path below the served folder, `/` between the parts, without `.marq`.
///
/// No part is empty, begins with a dot (so neither `.`, `..` nor a hidden file) or holds a backslash, a
/// colon or a control character.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct FileName(String);

impl FileName {
    /// Takes a decoded name, with or without the extension.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let text = text.strip_suffix(EXTENSION).unwrap_or(text);
        let allowed = |c: char| !c.is_control() && c != '\\' && c != ':';
        let valid = text
            .split('/')
            .all(|part| !part.is_empty() && !part.starts_with('.') && part.chars().all(allowed));
        valid.then(|| Self(text.to_owned()))
    }

    /// The path below the served folder.
    pub(crate) fn relative_path(&self) -> String {
        format!("{}{EXTENSION}", self.0)
    }

    /// The name as it stands in a URL path.
    pub(crate) fn escaped(&self) -> String {
        utf8_percent_encode(&self.0, ESCAPED).to_string()
    }
}

impl fmt::Display for FileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_leave_their_folder() {
        for text in [
            "",
            ".marq",
            "/",
            "/a",
            "a/",
            "a//b",
            ".",
            "..",
            "../a",
            "a/../b",
            "a/./b",
            ".hidden",
            "a/.hidden.marq",
            "a\\b",
            "c:a",
            "a\0b",
            "a\nb",
            "\u{7f}",
        ] {
            assert_eq!(FileName::parse(text), None, "{text:?}");
        }
    }

    #[test]
    fn the_extension_is_optional() {
        assert_eq!(FileName::parse("sub/a.marq"), FileName::parse("sub/a"));
        assert_eq!(FileName::parse("a").unwrap().relative_path(), "a.marq");
    }

    #[test]
    fn names_are_escaped_for_urls() {
        let name = FileName::parse("Scan 1/größe#2?.marq").unwrap();
        assert_eq!(name.escaped(), "Scan%201/gr%C3%B6%C3%9Fe%232%3F");
        assert_eq!(name.to_string(), "Scan 1/größe#2?");
    }
}
