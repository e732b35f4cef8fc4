//! `GET /pages/NAME/CONTENT-ID/PAGE` and `…/FIRST-LAST`: pages as stored, immutable.
//!
//! Adjacent pages come concatenated, without anything between them: the client knows their lengths from
//! the index. The content id in the path makes the URL name its bytes, so it may be cached for ever.

use super::files::FIELDS;
use crate::body::Outgoing;
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::source::{PagesError, ReadError, Sources};
use crate::target::{MAX_PAGES, WrongPages, page_parts, parse_pages};
use axum::http::{HeaderMap, HeaderValue, Method, Response, StatusCode, header};
use std::sync::Arc;

/// Bytes in one answer.
const MAX_BYTES: u64 = 8 << 20;

/// What a page may be kept for.
pub(crate) const FOR_EVER: HeaderValue =
    HeaderValue::from_static("public, max-age=31536000, immutable");

/// Answers with the bytes of one page or of several.
pub(crate) async fn pages(
    sources: &Arc<Sources>,
    path: &str,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response<Outgoing>, ApiError> {
    let (name, content_id, pages) = page_parts(path).ok_or(ApiError::NotFound)?;
    let pages = parse_pages(pages).map_err(|wrong| match wrong {
        WrongPages::Malformed => {
            ApiError::BadRequest("pages are asked for as PAGE or as FIRST-LAST")
        }
        WrongPages::TooMany => ApiError::TooMuch {
            limit: u64::from(MAX_PAGES),
            unit: "pages",
        },
    })?;
    let mut again = true;
    let bytes = loop {
        let file = match sources.open_now(name) {
            Some(file) => file,
            None => sources.open(name).await?,
        };
        if file.content_id() != content_id {
            return Err(ApiError::OtherContent);
        }
        match file.pages(pages.clone(), MAX_BYTES).await {
            Ok(bytes) => break bytes,
            Err(PagesError::Beyond { page, count }) => {
                return Err(ApiError::NoSuchPage { page, count });
            }
            Err(PagesError::TooLong { limit }) => {
                let unit = "bytes";
                return Err(ApiError::TooMuch { limit, unit });
            }
            // Replaced a moment ago: one more look finds the new one, which may still have this content.
            Err(PagesError::Unreadable(ReadError::Changed)) if std::mem::take(&mut again) => {
                sources.doubt(name);
            }
            Err(PagesError::Unreadable(error)) => {
                tracing::warn!(%error, name, "pages cannot be read");
                return Err(error.into());
            }
        }
    };
    let etag = format!("\"{content_id}/{}-{}\"", pages.start(), pages.end());
    let verdict = conditional::evaluate(headers, &etag, None);
    let mut response = match verdict {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => {
            let mut response = Response::new(Outgoing::Full(None));
            *response.status_mut() = StatusCode::NOT_MODIFIED;
            response
        }
        Verdict::Proceed => {
            let length = HeaderValue::from(bytes.len());
            let body = if method == Method::HEAD {
                Outgoing::Full(None)
            } else {
                Outgoing::from(bytes)
            };
            let mut response = Response::new(body);
            let fields = response.headers_mut();
            fields.reserve(FIELDS);
            let binary = HeaderValue::from_static("application/octet-stream");
            fields.insert(header::CONTENT_TYPE, binary);
            fields.insert(header::CONTENT_LENGTH, length);
            response
        }
    };
    let fields = response.headers_mut();
    fields.insert(header::CACHE_CONTROL, FOR_EVER);
    if let Ok(etag) = HeaderValue::try_from(etag) {
        fields.insert(header::ETAG, etag);
    }
    Ok(response)
}
