//! What can go wrong: at start ([`ServerError`]) and in a request (`ApiError`).

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::path::PathBuf;

/// A server that cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// The address cannot be listened on.
    #[error(
        "cannot listen on {address}: {source}; choose another address, or port 0 for any free one"
    )]
    Listen {
        /// Address as it was given.
        address: String,
        /// Why not.
        source: std::io::Error,
    },
    /// A path to serve is not there or cannot be read.
    #[error("cannot serve {}: {source}", path.display())]
    Path {
        /// Path as it was given.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A file named by the caller is no valid `.marq` file.
    #[error("cannot serve {}: {source}", path.display())]
    File {
        /// Path as it was given.
        path: PathBuf,
        /// What is wrong with it.
        source: marquetry_format::Error,
    },
    /// A path to serve is neither a `.marq` file nor a folder.
    #[error("cannot serve {}: neither a folder nor a file named *.marq", path.display())]
    Kind {
        /// Path as it was given.
        path: PathBuf,
    },
}

/// A request that cannot be answered as asked. The text goes to the client, causes go to the log.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ApiError {
    #[error("bad request: {0}")]
    BadRequest(&'static str),
    #[error("nothing here by that name; /api/catalogue lists what is served")]
    NotFound,
    #[error("no page {page}: this file has {count} pages, counted from 0")]
    NoSuchPage { page: u32, count: u32 },
    #[error("this content id is not served (any more); /api/catalogue has the current one")]
    OtherContent,
    #[error("method not allowed; everything here is read with GET or HEAD")]
    MethodNotAllowed,
    #[error("the resource does not match the request's If-Match")]
    PreconditionFailed,
    #[error("range not satisfiable: the file has {length} bytes")]
    RangeNotSatisfiable { length: u64 },
    #[error("more than {limit} {unit} in one request")]
    TooMuch { limit: u64, unit: &'static str },
    #[error("the file could not be read")]
    Unreadable,
}

impl ApiError {
    fn status(&self) -> StatusCode {
        match self {
            Self::BadRequest(_) | Self::TooMuch { .. } => StatusCode::BAD_REQUEST,
            Self::NotFound | Self::NoSuchPage { .. } => StatusCode::NOT_FOUND,
            Self::OtherContent => StatusCode::GONE,
            Self::MethodNotAllowed => StatusCode::METHOD_NOT_ALLOWED,
            Self::PreconditionFailed => StatusCode::PRECONDITION_FAILED,
            Self::RangeNotSatisfiable { .. } => StatusCode::RANGE_NOT_SATISFIABLE,
            Self::Unreadable => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let mut response = (self.status(), format!("{self}\n")).into_response();
        let headers = response.headers_mut();
        // An error about an immutable URL is not itself immutable.
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Self::RangeNotSatisfiable { length } = self
            && let Ok(value) = HeaderValue::try_from(format!("bytes */{length}"))
        {
            headers.insert(header::CONTENT_RANGE, value);
        }
        response
    }
}
