//! What the path of a request names.
//!
//! Nothing here touches a file: a name is text until `FileName` has judged it.

use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Pages in one request.
pub(crate) const MAX_PAGES: u32 = 256;

/// Kinds of requests, as they are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Route {
    Pages,
    Files,
    Api,
    Viewer,
    Other,
}

/// What a path names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Target<'p> {
    /// Below `/files/`, decoded.
    File(Cow<'p, str>),
    /// Below `/pages/`, decoded.
    Pages(Cow<'p, str>),
    /// Below `/thumbnails/`, decoded.
    Thumbnail(Cow<'p, str>),
    /// Something for the router.
    Routed(Route, Scope<'p>),
    /// Not valid percent-encoding of UTF-8.
    Nonsense,
}

/// What a request needs the right to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Scope<'p> {
    Nothing,
    Everything,
    Name(Cow<'p, str>),
}

impl Target<'_> {
    pub(crate) fn route(&self) -> Route {
        match self {
            Self::File(_) => Route::Files,
            Self::Pages(_) => Route::Pages,
            Self::Thumbnail(_) => Route::Api,
            Self::Routed(route, _) => *route,
            Self::Nonsense => Route::Other,
        }
    }
}

/// What `path` names.
pub(crate) fn target(path: &str) -> Target<'_> {
    type Make<'p> = fn(Cow<'p, str>) -> Target<'p>;
    let prefixes: [(&str, Make<'_>); 4] = [
        ("/pages/", |path| Target::Pages(path)),
        ("/files/", |name| Target::File(name)),
        ("/thumbnails/", |path| Target::Thumbnail(path)),
        ("/api/files/", |name| {
            Target::Routed(Route::Api, Scope::Name(name))
        }),
    ];
    for (prefix, make) in prefixes {
        if let Some(rest) = path.strip_prefix(prefix) {
            return match percent_decode_str(rest).decode_utf8() {
                Ok(decoded) => make(decoded),
                Err(_) => Target::Nonsense,
            };
        }
    }
    match path {
        "/api/catalogue" | "/catalogue" | "/metrics" => {
            Target::Routed(Route::Api, Scope::Everything)
        }
        "/health" | "/health/live" | "/health/ready" => {
            Target::Routed(Route::Other, Scope::Nothing)
        }
        _ => Target::Routed(Route::Viewer, Scope::Nothing),
    }
}

/// Splits `NAME/CONTENT-ID/PAGES`.
pub(crate) fn page_parts(path: &str) -> Option<(&str, &str, &str)> {
    let mut parts = path.rsplitn(3, '/');
    let (pages, content_id, name) = (parts.next()?, parts.next()?, parts.next()?);
    Some((name, content_id, pages))
}

/// What is wrong with the pages asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WrongPages {
    /// Neither `PAGE` nor `FIRST-LAST`.
    Malformed,
    /// More than [`MAX_PAGES`].
    TooMany,
}

/// Reads `PAGE` or `FIRST-LAST`.
pub(crate) fn parse_pages(text: &str) -> Result<RangeInclusive<u32>, WrongPages> {
    let number = |digits: &str| {
        // `parse` alone would allow a sign.
        let plain = digits.bytes().all(|b| b.is_ascii_digit());
        let number = digits.parse::<u32>().ok().filter(|_| plain);
        number.ok_or(WrongPages::Malformed)
    };
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let (first, last) = (number(first)?, number(last)?);
    if first > last {
        return Err(WrongPages::Malformed);
    }
    if last - first >= MAX_PAGES {
        return Err(WrongPages::TooMany);
    }
    Ok(first..=last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_name_what_they_should() {
        let routed = Target::Routed;
        for (path, expected) in [
            ("/files/a.marq", Target::File("a.marq".into())),
            ("/files/a%20b/c", Target::File("a b/c".into())),
            ("/files/%2e%2e/a", Target::File("../a".into())),
            ("/files/%ff", Target::Nonsense),
            ("/files", routed(Route::Viewer, Scope::Nothing)),
            ("/pages/a/0/1", Target::Pages("a/0/1".into())),
            ("/thumbnails/a/0", Target::Thumbnail("a/0".into())),
            ("/api/files/a", routed(Route::Api, Scope::Name("a".into()))),
            ("/api/catalogue", routed(Route::Api, Scope::Everything)),
            ("/metrics", routed(Route::Api, Scope::Everything)),
            ("/health/live", routed(Route::Other, Scope::Nothing)),
            ("/", routed(Route::Viewer, Scope::Nothing)),
            ("*", routed(Route::Viewer, Scope::Nothing)),
        ] {
            assert_eq!(target(path), expected, "{path}");
        }
        assert_eq!(page_parts("a/b/id/7"), Some(("a/b", "id", "7")));
        assert_eq!(page_parts("id/7"), None);
    }

    #[test]
    fn pages_are_one_or_a_bounded_range() {
        assert_eq!(parse_pages("0"), Ok(0..=0));
        assert_eq!(parse_pages("7"), Ok(7..=7));
        assert_eq!(parse_pages("7-9"), Ok(7..=9));
        assert_eq!(parse_pages("0-255"), Ok(0..=255));
        assert_eq!(parse_pages("4294967295"), Ok(u32::MAX..=u32::MAX));
        for text in [
            "",
            "-",
            "-1",
            "1-",
            "2-1",
            "a",
            "+1",
            "1-+2",
            "1-2-3",
            " 1",
            "0x1",
            "4294967296",
        ] {
            assert_eq!(parse_pages(text), Err(WrongPages::Malformed), "{text}");
        }
        for text in ["0-256", "0-4294967295"] {
            assert_eq!(parse_pages(text), Err(WrongPages::TooMany), "{text}");
        }
    }
}
