//! `GET /pages/NAME/CONTENT-ID/PAGE` and `…/FIRST-LAST`: pages as stored, immutable.
//!
//! Adjacent pages come concatenated, without anything between them: the client knows their lengths from
//! the index. The content id in the path makes the URL name its bytes, so it may be cached for ever.

use super::{blocking, look_up};
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::source::{PagesError, Sources};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Pages in one request.
const MAX_PAGES: u32 = 256;
/// Bytes in one answer.
const MAX_BYTES: u64 = 8 << 20;

const FOR_EVER: (header::HeaderName, &str) =
    (header::CACHE_CONTROL, "public, max-age=31536000, immutable");

/// Answers with the bytes of one page or of several.
pub(crate) async fn pages(
    State(sources): State<Arc<Sources>>,
    Path(path): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let mut parts = path.rsplitn(3, '/');
    let (Some(pages), Some(content_id), Some(name)) = (parts.next(), parts.next(), parts.next())
    else {
        return Err(ApiError::NotFound);
    };
    let pages = parse_pages(pages)?;
    let etag = format!("\"{content_id}/{}-{}\"", pages.start(), pages.end());
    let (content_id, name) = (content_id.to_owned(), name.to_owned());
    let read = move || {
        let file = look_up(&sources, &name)?;
        if file.content_id() != content_id {
            return Err(ApiError::OtherContent);
        }
        file.read_pages(pages, MAX_BYTES)
            .map_err(|error| match error {
                PagesError::Beyond { page, count } => ApiError::NoSuchPage { page, count },
                PagesError::TooLong { limit } => ApiError::TooMuch {
                    limit,
                    unit: "bytes",
                },
                PagesError::Unreadable(error) => {
                    tracing::warn!(%error, name, "pages cannot be read");
                    ApiError::Unreadable
                }
            })
    };
    let bytes = blocking(read).await?;
    match conditional::evaluate(&headers, &etag) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => {
            let headers = [FOR_EVER, (header::ETAG, &etag)];
            return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
        }
        Verdict::Proceed => {}
    }
    let headers = [
        FOR_EVER,
        (header::ETAG, &etag),
        (header::CONTENT_TYPE, "application/octet-stream"),
    ];
    Ok((headers, bytes).into_response())
}

/// Reads `PAGE` or `FIRST-LAST`.
fn parse_pages(text: &str) -> Result<RangeInclusive<u32>, ApiError> {
    const WRONG: ApiError = ApiError::BadRequest("pages are asked for as PAGE or as FIRST-LAST");
    let number = |digits: &str| {
        // `parse` alone would allow a sign.
        let plain = digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse::<u32>().ok().filter(|_| plain).ok_or(WRONG)
    };
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let (first, last) = (number(first)?, number(last)?);
    if first > last {
        return Err(WRONG);
    }
    if last - first >= MAX_PAGES {
        return Err(ApiError::TooMuch {
            limit: u64::from(MAX_PAGES),
            unit: "pages",
        });
    }
    Ok(first..=last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_one_or_a_bounded_range() {
        assert_eq!(parse_pages("0").unwrap(), 0..=0);
        assert_eq!(parse_pages("7").unwrap(), 7..=7);
        assert_eq!(parse_pages("7-9").unwrap(), 7..=9);
        assert_eq!(parse_pages("0-255").unwrap(), 0..=255);
        assert_eq!(parse_pages("4294967295").unwrap(), u32::MAX..=u32::MAX);
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
            assert!(
                matches!(parse_pages(text), Err(ApiError::BadRequest(_))),
                "{text}"
            );
        }
        for text in ["0-256", "0-4294967295"] {
            assert!(
                matches!(parse_pages(text), Err(ApiError::TooMuch { .. })),
                "{text}"
            );
        }
    }
}
