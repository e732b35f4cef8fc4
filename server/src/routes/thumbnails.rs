//! `GET /thumbnails/NAME/CONTENT-ID`: the picture stored in a file, immutable as its pages are.

use super::pages::FOR_EVER;
use crate::body::Outgoing;
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::source::Sources;
use axum::http::{HeaderMap, HeaderValue, Response, StatusCode, header};
use std::sync::Arc;

/// Whether `bytes` begin as a WebP file does, which is all that the format allows here.
fn is_webp(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")
}

/// Answers with the picture of the file that `path` names.
pub(crate) async fn thumbnail(
    sources: &Arc<Sources>,
    path: &str,
    headers: &HeaderMap,
) -> Result<Response<Outgoing>, ApiError> {
    let (name, content_id) = path.rsplit_once('/').ok_or(ApiError::NotFound)?;
    let file = sources.open(name).await?;
    if file.content_id() != content_id {
        return Err(ApiError::OtherContent);
    }
    let picture = file.thumbnail().await.map_err(|error| {
        tracing::warn!(%error, name, "thumbnail cannot be read");
        ApiError::from(error)
    })?;
    let picture = picture
        .filter(|bytes| is_webp(bytes))
        .ok_or(ApiError::NotFound)?;
    let etag = format!("\"{:032x}\"", xxhash_rust::xxh3::xxh3_128(&picture));
    let mut response = match conditional::evaluate(headers, &etag, None) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => {
            let mut response = Response::new(Outgoing::Full(None));
            *response.status_mut() = StatusCode::NOT_MODIFIED;
            response
        }
        Verdict::Proceed => {
            let mut response = Response::new(Outgoing::from(picture));
            let webp = HeaderValue::from_static("image/webp");
            response.headers_mut().insert(header::CONTENT_TYPE, webp);
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
