//! Preconditions of a request (RFC 9110, section 13), against strong entity tags.
//!
//! What is served has an entity tag and no modification date, so the conditions on dates are ignored,
//! as the RFC demands, and an `If-Range` with a date never holds.

use axum::http::{HeaderMap, header};

/// What the preconditions of a GET or HEAD say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Answer as if there were none.
    Proceed,
    /// 304: the client has this representation.
    NotModified,
    /// 412: the client wants another representation.
    Failed,
}

/// Evaluates `If-Match` and `If-None-Match`. `etag` is the strong tag, quotes included.
pub(crate) fn evaluate(headers: &HeaderMap, etag: &str) -> Verdict {
    if headers.contains_key(header::IF_MATCH)
        && !matches(headers, &header::IF_MATCH, |tag| tag == etag)
    {
        return Verdict::Failed;
    }
    let weakly_equal = |tag: &str| tag.strip_prefix("W/").unwrap_or(tag) == etag;
    if matches(headers, &header::IF_NONE_MATCH, weakly_equal) {
        return Verdict::NotModified;
    }
    Verdict::Proceed
}

/// Whether a `Range` header is to be honoured: no `If-Range`, or one with exactly our tag.
pub(crate) fn if_range_holds(headers: &HeaderMap, etag: &str) -> bool {
    let mut values = headers.get_all(header::IF_RANGE).iter();
    match (values.next(), values.next()) {
        (None, _) => true,
        (Some(value), None) => value.as_bytes().trim_ascii() == etag.as_bytes(),
        (Some(_), Some(_)) => false,
    }
}

/// Whether any tag of the lists in the fields called `name` satisfies `equal`; `*` matches everything.
fn matches(headers: &HeaderMap, name: &header::HeaderName, equal: impl Fn(&str) -> bool) -> bool {
    headers
        .get_all(name)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .any(|list| list.trim() == "*" || tags(list).any(&equal))
}

/// The entity tags of a list. A comma inside the quotes belongs to the tag.
fn tags(list: &str) -> impl Iterator<Item = &str> {
    let mut rest = list;
    std::iter::from_fn(move || {
        rest = rest.trim_start_matches([' ', '\t', ',']);
        let open = if rest.starts_with("W/") { 2 } else { 0 };
        if !rest.get(open..)?.starts_with('"') {
            return None;
        }
        let close = open + 1 + rest.get(open + 1..)?.find('"')?;
        let (tag, after) = rest.split_at_checked(close + 1)?;
        rest = after;
        Some(tag)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const TAG: &str = "\"abc\"";

    fn headers(fields: &[(header::HeaderName, &'static str)]) -> HeaderMap {
        let mut map = HeaderMap::new();
        for (name, value) in fields {
            map.append(name, HeaderValue::from_static(value));
        }
        map
    }

    #[test]
    fn if_none_match_compares_weakly() {
        for (value, expected) in [
            ("\"abc\"", Verdict::NotModified),
            ("W/\"abc\"", Verdict::NotModified),
            ("*", Verdict::NotModified),
            (" * ", Verdict::NotModified),
            ("\"x\", \"abc\"", Verdict::NotModified),
            ("\"x\",\"abc\"", Verdict::NotModified),
            ("\"a,b\" , W/\"abc\"", Verdict::NotModified),
            ("\"x\"", Verdict::Proceed),
            ("abc", Verdict::Proceed),
            ("\"abc", Verdict::Proceed),
            ("\"ABC\"", Verdict::Proceed),
            ("", Verdict::Proceed),
        ] {
            let verdict = evaluate(&headers(&[(header::IF_NONE_MATCH, value)]), TAG);
            assert_eq!(verdict, expected, "{value}");
        }
    }

    #[test]
    fn if_match_compares_strongly() {
        for (value, expected) in [
            ("\"abc\"", Verdict::Proceed),
            ("*", Verdict::Proceed),
            ("\"x\", \"abc\"", Verdict::Proceed),
            ("W/\"abc\"", Verdict::Failed),
            ("\"x\"", Verdict::Failed),
            ("", Verdict::Failed),
        ] {
            let verdict = evaluate(&headers(&[(header::IF_MATCH, value)]), TAG);
            assert_eq!(verdict, expected, "{value}");
        }
    }

    #[test]
    fn if_match_is_looked_at_first() {
        let both = headers(&[(header::IF_MATCH, "\"x\""), (header::IF_NONE_MATCH, TAG)]);
        assert_eq!(evaluate(&both, TAG), Verdict::Failed);
    }

    #[test]
    fn lists_may_span_several_fields() {
        let two = headers(&[
            (header::IF_NONE_MATCH, "\"x\""),
            (header::IF_NONE_MATCH, TAG),
        ]);
        assert_eq!(evaluate(&two, TAG), Verdict::NotModified);
    }

    #[test]
    fn if_range_needs_exactly_our_tag() {
        assert!(if_range_holds(&HeaderMap::new(), TAG));
        for (value, expected) in [
            ("\"abc\"", true),
            ("W/\"abc\"", false),
            ("\"x\"", false),
            ("\"x\", \"abc\"", false),
            ("Sun, 06 Nov 1994 08:49:37 GMT", false),
        ] {
            let holds = if_range_holds(&headers(&[(header::IF_RANGE, value)]), TAG);
            assert_eq!(holds, expected, "{value}");
        }
    }
}
