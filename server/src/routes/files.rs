//! `GET /files/NAME.marq`: the raw file, whole or in byte ranges.

use crate::body::{FileBody, Outgoing, Piece};
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::range::{self, Selection};
use crate::source::{OpenFile, ReadError, Sources};
use axum::http::{HeaderMap, HeaderValue, Method, Response, StatusCode, header};
use hyper::body::Bytes;
use std::ops::Range;
use std::sync::Arc;

const CONTENT_TYPE: &str = "application/octet-stream";

/// Answers a GET or HEAD for the file called `name`.
pub(crate) async fn file(
    sources: &Arc<Sources>,
    name: &str,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response<Outgoing>, ApiError> {
    let mut again = true;
    loop {
        let file = match sources.open_now(name) {
            Some(file) => file,
            None => sources.open(name).await?,
        };
        match respond(file, method, headers).await {
            // It was replaced a moment ago: one more look finds the new one.
            Err(Failure::Read(ReadError::Changed)) if std::mem::take(&mut again) => {
                sources.doubt(name);
            }
            Err(Failure::Read(error)) => {
                tracing::warn!(%error, name, "file cannot be read");
                return Err(error.into());
            }
            Err(Failure::Answer(error)) => return Err(error),
            Ok(response) => return Ok(response),
        }
    }
}

enum Failure {
    Answer(ApiError),
    Read(ReadError),
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

async fn respond(
    file: Arc<OpenFile>,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response<Outgoing>, Failure> {
    let length = file.length();
    let etag = file.etag().clone();
    let tag = etag.to_str().unwrap_or_default();
    let modified = file.modified();
    let verdict = conditional::evaluate(headers, tag, modified);
    if verdict == Verdict::Failed {
        return Err(Failure::Answer(ApiError::PreconditionFailed));
    }
    let last_modified = file.last_modified().cloned();
    let mut response = if verdict == Verdict::NotModified {
        let mut response = Response::new(Outgoing::Full(None));
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        response
    } else {
        let selection = match range_header(method, headers) {
            Some(range) if conditional::if_range_holds(headers, tag, modified) => {
                range::select(range, length)
            }
            _ => Selection::Whole,
        };
        match selection {
            Selection::Unsatisfiable => {
                return Err(Failure::Answer(ApiError::RangeNotSatisfiable { length }));
            }
            Selection::Whole if method == Method::HEAD => head(length),
            Selection::Whole => whole(file).await?,
            Selection::Parts(parts) => match <[Range<u64>; 1]>::try_from(parts) {
                Ok([part]) => single(file, part).await?,
                Err(parts) => multipart(file, parts).await?,
            },
        }
    };
    let fields = response.headers_mut();
    fields.insert(header::ETAG, etag);
    fields.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    // A stale copy is a wrong picture, and asking is cheap: one 304.
    fields.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    if let Some(last_modified) = last_modified {
        fields.insert(header::LAST_MODIFIED, last_modified);
    }
    Ok(response)
}

/// The only range field of a request that may have one.
fn range_header<'h>(method: &Method, headers: &'h HeaderMap) -> Option<&'h str> {
    if method != Method::GET {
        return None;
    }
    let mut values = headers.get_all(header::RANGE).iter();
    match (values.next(), values.next()) {
        (Some(value), None) => value.to_str().ok(),
        _ => None,
    }
}

/// Fields of a response, more or less.
pub(crate) const FIELDS: usize = 16;

fn made_of(body: Outgoing, status: StatusCode, content_type: HeaderValue) -> Response<Outgoing> {
    let mut response = Response::new(body);
    *response.status_mut() = status;
    let headers = response.headers_mut();
    // All that will come, so that the map does not grow step by step.
    headers.reserve(FIELDS);
    headers.insert(header::CONTENT_TYPE, content_type);
    response
}

const BYTES: HeaderValue = HeaderValue::from_static(CONTENT_TYPE);

/// No body is read for a HEAD, but its length is told.
fn head(length: u64) -> Response<Outgoing> {
    let mut response = made_of(Outgoing::Full(None), StatusCode::OK, BYTES);
    response
        .headers_mut()
        .insert(header::CONTENT_LENGTH, HeaderValue::from(length));
    response
}

async fn whole(file: Arc<OpenFile>) -> Result<Response<Outgoing>, ReadError> {
    let all = Piece::Stored(0..file.length());
    let body = FileBody::new(file, [all]).await?;
    Ok(made_of(
        Outgoing::File(Box::new(body)),
        StatusCode::OK,
        BYTES,
    ))
}

async fn single(file: Arc<OpenFile>, part: Range<u64>) -> Result<Response<Outgoing>, ReadError> {
    let content_range = content_range(&part, file.length());
    let short = part.end - part.start <= ONE_READ;
    let at_hand = if short { file.read_now(&part) } else { None };
    let body = match at_hand {
        Some(bytes) => Outgoing::from(bytes?),
        None => Outgoing::File(Box::new(FileBody::new(file, [Piece::Stored(part)]).await?)),
    };
    let mut response = made_of(body, StatusCode::PARTIAL_CONTENT, BYTES);
    if let Ok(value) = HeaderValue::try_from(content_range) {
        response.headers_mut().insert(header::CONTENT_RANGE, value);
    }
    Ok(response)
}

/// Bytes that are read and sent at once.
const ONE_READ: u64 = 128 * 1024;

async fn multipart(
    file: Arc<OpenFile>,
    parts: Vec<Range<u64>>,
) -> Result<Response<Outgoing>, ReadError> {
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
    let content_type = HeaderValue::try_from(format!("multipart/byteranges; boundary={boundary}"))
        .unwrap_or(BYTES);
    let body = FileBody::new(file, pieces).await?;
    let body = Outgoing::File(Box::new(body));
    Ok(made_of(body, StatusCode::PARTIAL_CONTENT, content_type))
}

/// The value of `Content-Range` for `part`, which is not empty.
fn content_range(part: &Range<u64>, length: u64) -> String {
    format!("bytes {}-{}/{length}", part.start, part.end - 1)
}
