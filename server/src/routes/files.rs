//! `GET /files/NAME.marq`: the raw file, whole or in byte ranges.

use super::{blocking, look_up};
use crate::body::{FileBody, Piece};
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::range::{self, Selection};
use crate::source::{OpenFile, Sources};
use axum::body::{Body, Bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::ops::Range;
use std::sync::Arc;

const CONTENT_TYPE: &str = "application/octet-stream";

/// Answers a GET or HEAD for a file.
pub(crate) async fn file(
    State(sources): State<Arc<Sources>>,
    Path(name): Path<String>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let file = blocking(move || look_up(&sources, &name)).await?;
    let length = file.length();
    let etag = format!("\"{}\"", file.content_id());
    // A stale copy is a wrong picture, and asking is cheap: one 304.
    let common = [
        (header::ETAG, etag.clone()),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
        (header::CACHE_CONTROL, "no-cache".to_owned()),
    ];
    match conditional::evaluate(&headers, &etag) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => return Ok((StatusCode::NOT_MODIFIED, common).into_response()),
        Verdict::Proceed => {}
    }
    let selection = match range_header(&method, &headers, &etag) {
        Some(range) => range::select(range, length),
        None => Selection::Whole,
    };
    let response = match selection {
        Selection::Unsatisfiable => return Err(ApiError::RangeNotSatisfiable { length }),
        Selection::Whole => whole(file).into_response(),
        Selection::Parts(parts) => match <[Range<u64>; 1]>::try_from(parts) {
            Ok([part]) => single(file, part).into_response(),
            Err(parts) => multipart(file, parts).into_response(),
        },
    };
    Ok((common, response).into_response())
}

/// The range asked for, if the request is one that has ranges: GET, and `If-Range` holds.
fn range_header<'h>(method: &Method, headers: &'h HeaderMap, etag: &str) -> Option<&'h str> {
    let mut values = headers.get_all(header::RANGE).iter();
    let (Some(value), None) = (values.next(), values.next()) else {
        return None;
    };
    if method != Method::GET || !conditional::if_range_holds(headers, etag) {
        return None;
    }
    value.to_str().ok()
}

fn whole(file: Arc<OpenFile>) -> impl IntoResponse {
    let all = Piece::Stored(0..file.length());
    let body = FileBody::new(file, [all]);
    ([(header::CONTENT_TYPE, CONTENT_TYPE)], Body::new(body))
}

fn single(file: Arc<OpenFile>, part: Range<u64>) -> impl IntoResponse {
    let headers = [
        (header::CONTENT_TYPE, CONTENT_TYPE.to_owned()),
        (header::CONTENT_RANGE, content_range(&part, file.length())),
    ];
    let body = FileBody::new(file, [Piece::Stored(part)]);
    (StatusCode::PARTIAL_CONTENT, headers, Body::new(body))
}

fn multipart(file: Arc<OpenFile>, parts: Vec<Range<u64>>) -> impl IntoResponse {
    // The content id hashes the content, so the content cannot hold it in writing.
    let boundary = format!("marquetry-{}", file.content_id());
    let length = file.length();
    let mut pieces = Vec::with_capacity(2 * parts.len() + 1);
    let mut opening = "";
    for part in parts {
        let head = format!(
            "{opening}--{boundary}\r\nContent-Type: {CONTENT_TYPE}\r\nContent-Range: {}\r\n\r\n",
            content_range(&part, length)
        );
        opening = "\r\n";
        pieces.push(Piece::Literal(Bytes::from(head)));
        pieces.push(Piece::Stored(part));
    }
    pieces.push(Piece::Literal(Bytes::from(format!(
        "\r\n--{boundary}--\r\n"
    ))));
    let headers = [(
        header::CONTENT_TYPE,
        format!("multipart/byteranges; boundary={boundary}"),
    )];
    let body = FileBody::new(file, pieces);
    (StatusCode::PARTIAL_CONTENT, headers, Body::new(body))
}

/// The value of `Content-Range` for `part`, which is not empty.
fn content_range(part: &Range<u64>, length: u64) -> String {
    format!("bytes {}-{}/{length}", part.start, part.end - 1)
}
