//! What can go wrong: at start ([`ServerError`]) and in a request (`ApiError`).

use crate::body::Outgoing;
use crate::source::{LookUpError, ReadError};
use axum::http::{HeaderName, HeaderValue, Response, StatusCode, header};
use axum::response::IntoResponse;
use hyper::body::Bytes;
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
    /// The system has no threads or descriptors left for connections.
    #[error("cannot start threads for connections: {0}")]
    Workers(#[source] std::io::Error),
    /// A path is not there or cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Path {
        /// Path as it was given.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A file named by the caller is no valid `.marq` file.
    #[error("cannot serve {}: {message}", path.display())]
    File {
        /// Path as it was given.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A path to serve is neither a `.marq` file nor a folder.
    #[error("cannot serve {}: neither a folder nor a file named *.marq, nor the URL of a bucket", path.display())]
    Kind {
        /// Path as it was given.
        path: PathBuf,
    },
    /// A remote source cannot be used.
    #[error("cannot serve {url}: {message}")]
    Url {
        /// URL as it was given.
        url: String,
        /// Why not.
        message: String,
    },
    /// Certificate or key cannot be used.
    #[error("{}: {message}", path.display())]
    Tls {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A token or a key is unfit.
    #[error("{what}")]
    Secret {
        /// What is asked of it.
        what: &'static str,
    },
    /// A setting is outside its range.
    #[error(transparent)]
    Config(#[from] crate::config::ConfigError),
}

/// A request that cannot be answered as asked. The text goes to the client, causes go to the log.
#[derive(Debug, Clone, thiserror::Error)]
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
    #[error("the resource does not match the request's precondition")]
    PreconditionFailed,
    #[error("range not satisfiable: the file has {length} bytes")]
    RangeNotSatisfiable { length: u64 },
    #[error("more than {limit} {unit} in one request")]
    TooMuch { limit: u64, unit: &'static str },
    #[error("a token or a signed URL is needed")]
    Unauthorized,
    #[error("this token or signature does not open this, or not any more")]
    Forbidden,
    #[error("too many requests; come again in {seconds} s")]
    TooMany { seconds: u64 },
    #[error("the file could not be read")]
    Unreadable,
    #[error("the file is being changed; come again")]
    Changing,
    #[error("the file could not be read where it is kept")]
    BadUpstream,
    #[error("the file could not be read in time where it is kept")]
    SlowUpstream,
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
            Self::Unauthorized => StatusCode::UNAUTHORIZED,
            Self::Forbidden => StatusCode::FORBIDDEN,
            Self::TooMany { .. } => StatusCode::TOO_MANY_REQUESTS,
            Self::Unreadable => StatusCode::INTERNAL_SERVER_ERROR,
            Self::Changing => StatusCode::SERVICE_UNAVAILABLE,
            Self::BadUpstream => StatusCode::BAD_GATEWAY,
            Self::SlowUpstream => StatusCode::GATEWAY_TIMEOUT,
        }
    }

    /// A field that belongs to the status.
    fn field(&self) -> Option<(HeaderName, HeaderValue)> {
        let (name, value) = match self {
            Self::RangeNotSatisfiable { length } => {
                (header::CONTENT_RANGE, format!("bytes */{length}"))
            }
            Self::TooMany { seconds } => (header::RETRY_AFTER, seconds.to_string()),
            Self::Changing => (header::RETRY_AFTER, "1".to_owned()),
            Self::Unauthorized => (
                header::WWW_AUTHENTICATE,
                "Bearer realm=\"marquetry\"".to_owned(),
            ),
            Self::MethodNotAllowed => (header::ALLOW, "GET, HEAD, OPTIONS".to_owned()),
            _ => return None,
        };
        Some((name, HeaderValue::try_from(value).ok()?))
    }

    /// The response, with the body that we send ourselves.
    pub(crate) fn response(&self) -> Response<Outgoing> {
        let text = Bytes::from(format!("{self}\n"));
        let mut response = Response::new(Outgoing::from(text));
        *response.status_mut() = self.status();
        let headers = response.headers_mut();
        let plain = HeaderValue::from_static("text/plain; charset=utf-8");
        headers.insert(header::CONTENT_TYPE, plain);
        // An error about an immutable URL is not itself immutable.
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some((name, value)) = self.field() {
            headers.insert(name, value);
        }
        response
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> axum::response::Response {
        self.response().map(|body| match body {
            Outgoing::Full(Some(bytes)) => axum::body::Body::from(bytes),
            _ => axum::body::Body::empty(),
        })
    }
}

impl From<ReadError> for ApiError {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Changed => Self::Changing,
            ReadError::Upstream(_) | ReadError::NoVersion => Self::BadUpstream,
            ReadError::TimedOut => Self::SlowUpstream,
            _ => Self::Unreadable,
        }
    }
}

impl From<LookUpError> for ApiError {
    fn from(error: LookUpError) -> Self {
        match &error {
            LookUpError::Unknown => Self::NotFound,
            LookUpError::Unusable { source, old, .. } => {
                if !old {
                    tracing::warn!(%error, "cannot be served");
                }
                Self::from(source.clone())
            }
        }
    }
}
