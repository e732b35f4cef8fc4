//! Preconditions of a request (RFC 9110, section 13).
//!
//! Entity tags are strong. Dates are compared at their resolution of one second, and looked at only where the
//! request has no entity tag for the same purpose, as the RFC demands.

use axum::http::{HeaderMap, header};
use std::time::{Duration, SystemTime};

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

/// Evaluates `If-Match`, `If-Unmodified-Since`, `If-None-Match` and `If-Modified-Since`.
///
/// `etag` is the strong tag, quotes included; `modified` the date of the last change, if there is one.
pub(crate) fn evaluate(headers: &HeaderMap, etag: &str, modified: Option<SystemTime>) -> Verdict {
    if headers.contains_key(header::IF_MATCH) {
        if !matches(headers, &header::IF_MATCH, |tag| tag == etag) {
            return Verdict::Failed;
        }
    } else if let Some(modified) = modified
        && let Some(date) = date(headers, &header::IF_UNMODIFIED_SINCE)
        && whole_seconds(modified) > date
    {
        return Verdict::Failed;
    }
    if headers.contains_key(header::IF_NONE_MATCH) {
        let weakly_equal = |tag: &str| tag.strip_prefix("W/").unwrap_or(tag) == etag;
        if matches(headers, &header::IF_NONE_MATCH, weakly_equal) {
            return Verdict::NotModified;
        }
    } else if let Some(modified) = modified
        && let Some(date) = date(headers, &header::IF_MODIFIED_SINCE)
        && whole_seconds(modified) <= date
    {
        return Verdict::NotModified;
    }
    Verdict::Proceed
}

/// Whether a `Range` header is to be honoured: no `If-Range`, or one with exactly our tag or our date.
///
/// A date counts only where it is strong: where nothing changed within the second that it names. Ours is, once that
/// second has passed; whether the client's copy was made after it, the client must know (RFC 9110, section 13.1.5).
pub(crate) fn if_range_holds(
    headers: &HeaderMap,
    etag: &str,
    modified: Option<SystemTime>,
) -> bool {
    let mut values = headers.get_all(header::IF_RANGE).iter();
    match (values.next(), values.next()) {
        (None, _) => true,
        (Some(value), None) => {
            value.as_bytes().trim_ascii() == etag.as_bytes()
                || modified.is_some_and(|modified| {
                    date(headers, &header::IF_RANGE) == Some(whole_seconds(modified))
                        && SystemTime::now()
                            .duration_since(modified)
                            .is_ok_and(|age| age > Duration::from_secs(2))
                })
        }
        (Some(_), Some(_)) => false,
    }
}

/// The date in the only field called `name`.
fn date(headers: &HeaderMap, name: &header::HeaderName) -> Option<SystemTime> {
    let mut values = headers.get_all(name).iter();
    let (Some(value), None) = (values.next(), values.next()) else {
        return None;
    };
    httpdate::parse_http_date(value.to_str().ok()?.trim()).ok()
}

/// `time` at the resolution of HTTP.
pub(crate) fn whole_seconds(time: SystemTime) -> SystemTime {
    match time.duration_since(SystemTime::UNIX_EPOCH) {
        Ok(since) => SystemTime::UNIX_EPOCH + Duration::from_secs(since.as_secs()),
        Err(_) => SystemTime::UNIX_EPOCH,
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
            let verdict = evaluate(&headers(&[(header::IF_NONE_MATCH, value)]), TAG, None);
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
            let verdict = evaluate(&headers(&[(header::IF_MATCH, value)]), TAG, None);
            assert_eq!(verdict, expected, "{value}");
        }
    }

    #[test]
    fn if_match_is_looked_at_first() {
        let both = headers(&[(header::IF_MATCH, "\"x\""), (header::IF_NONE_MATCH, TAG)]);
        assert_eq!(evaluate(&both, TAG, None), Verdict::Failed);
    }

    #[test]
    fn lists_may_span_several_fields() {
        let two = headers(&[
            (header::IF_NONE_MATCH, "\"x\""),
            (header::IF_NONE_MATCH, TAG),
        ]);
        assert_eq!(evaluate(&two, TAG, None), Verdict::NotModified);
    }

    #[test]
    fn if_range_needs_exactly_our_tag() {
        assert!(if_range_holds(&HeaderMap::new(), TAG, None));
        for (value, expected) in [
            ("\"abc\"", true),
            ("W/\"abc\"", false),
            ("\"x\"", false),
            ("\"x\", \"abc\"", false),
            ("Sun, 06 Nov 1994 08:49:37 GMT", false),
        ] {
            let holds = if_range_holds(&headers(&[(header::IF_RANGE, value)]), TAG, None);
            assert_eq!(holds, expected, "{value}");
        }
    }

    const DATE: &str = "Sun, 06 Nov 1994 08:49:37 GMT";
    const BEFORE: &str = "Sun, 06 Nov 1994 08:49:36 GMT";
    const AFTER: &str = "Sun, 06 Nov 1994 08:49:38 GMT";

    fn modified() -> SystemTime {
        // Half a second later: what HTTP cannot say must not matter.
        httpdate::parse_http_date(DATE).unwrap() + Duration::from_millis(500)
    }

    #[test]
    fn dates_count_where_there_is_no_tag() {
        use Verdict::{Failed, NotModified, Proceed};
        let since = header::IF_MODIFIED_SINCE;
        let unmodified = header::IF_UNMODIFIED_SINCE;
        for (fields, expected) in [
            (vec![(since.clone(), DATE)], NotModified),
            (vec![(since.clone(), AFTER)], NotModified),
            (vec![(since.clone(), BEFORE)], Proceed),
            (vec![(since.clone(), "yesterday")], Proceed),
            (vec![(since.clone(), DATE), (since.clone(), DATE)], Proceed),
            (
                vec![(since.clone(), "Sunday, 06-Nov-94 08:49:37 GMT")],
                NotModified,
            ),
            (
                vec![(since.clone(), "Sun Nov  6 08:49:37 1994")],
                NotModified,
            ),
            (
                vec![(since.clone(), DATE), (header::IF_NONE_MATCH, "\"x\"")],
                Proceed,
            ),
            (
                vec![(since, BEFORE), (header::IF_NONE_MATCH, TAG)],
                NotModified,
            ),
            (vec![(unmodified.clone(), DATE)], Proceed),
            (vec![(unmodified.clone(), BEFORE)], Failed),
            (vec![(unmodified.clone(), "yesterday")], Proceed),
            (vec![(unmodified, BEFORE), (header::IF_MATCH, TAG)], Proceed),
        ] {
            assert_eq!(
                evaluate(&headers(&fields), TAG, Some(modified())),
                expected,
                "{fields:?}"
            );
        }
        let both = headers(&[(header::IF_MODIFIED_SINCE, AFTER)]);
        assert_eq!(evaluate(&both, TAG, None), Proceed);
    }

    #[test]
    fn if_range_takes_exactly_our_date() {
        for (value, expected) in [(DATE, true), (BEFORE, false), (AFTER, false), (TAG, true)] {
            let headers = headers(&[(header::IF_RANGE, value)]);
            assert_eq!(
                if_range_holds(&headers, TAG, Some(modified())),
                expected,
                "{value}"
            );
        }
        let now = SystemTime::now();
        let text = httpdate::fmt_http_date(now);
        let map = HeaderMap::from_iter([(header::IF_RANGE, HeaderValue::from_str(&text).unwrap())]);
        assert!(
            !if_range_holds(&map, TAG, Some(now)),
            "it may change once more this second"
        );
    }
}
