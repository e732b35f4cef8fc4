//! The server as a whole: its routes, its listening socket, its life.

use crate::accept;
use crate::config::{Config, ConnectionLimits};
use crate::error::{ApiError, ServerError};
use crate::routes::{catalogue, files, health, pages, viewer};
use crate::source::Sources;
use crate::telemetry;
use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::net::SocketAddr;
use std::sync::Arc;
use tokio::net::TcpListener;

/// A server that listens and is ready to run.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    router: Router,
    connections: ConnectionLimits,
}

impl Server {
    /// Checks what is to be served and starts to listen. Connections wait until [`Server::run`].
    ///
    /// # Errors
    /// When a path cannot be served or the address cannot be listened on.
    pub async fn bind(config: Config) -> Result<Self, ServerError> {
        let Config {
            listen,
            paths,
            connections,
        } = config;
        let sources = Arc::new(Sources::new(&paths)?);
        let listen_error = |source| ServerError::Listen {
            address: listen.clone(),
            source,
        };
        let listener = TcpListener::bind(&listen).await.map_err(listen_error)?;
        let address = listener.local_addr().map_err(listen_error)?;
        Ok(Self {
            listener,
            address,
            router: router(sources),
            connections,
        })
    }

    /// The address listened on, with the port that the system picked.
    pub fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until `shutdown` resolves; then lets requests under way end, for as long as the
    /// configuration says.
    pub async fn run(self, shutdown: impl Future<Output = ()>) {
        accept::serve(self.listener, self.router, self.connections, shutdown).await;
    }
}

fn router(sources: Arc<Sources>) -> Router {
    Router::new()
        .route("/", get(viewer::index))
        .route("/api/catalogue", get(catalogue::catalogue))
        .route("/files/{*name}", get(files::file))
        .route("/pages/{*path}", get(pages::pages))
        .route("/health", get(health::health))
        .fallback(viewer::asset)
        .method_not_allowed_fallback(|| async { ApiError::MethodNotAllowed })
        .with_state(sources)
        .layer(middleware::from_fn(common_headers))
        .layer(middleware::from_fn(telemetry::log_request))
}

/// Answers CORS preflights, and gives every response the headers that all have.
///
/// Everything served is public and no request carries credentials, so any origin may read it.
async fn common_headers(request: Request, next: Next) -> Response {
    const ALLOW: [(HeaderName, &str); 4] = [
        (header::ALLOW, "GET, HEAD, OPTIONS"),
        (header::ACCESS_CONTROL_ALLOW_METHODS, "GET, HEAD, OPTIONS"),
        (
            header::ACCESS_CONTROL_ALLOW_HEADERS,
            "Range, If-Range, If-Match, If-None-Match, Cache-Control",
        ),
        (header::ACCESS_CONTROL_MAX_AGE, "86400"),
    ];
    let mut response = if request.method() == Method::OPTIONS {
        (StatusCode::NO_CONTENT, ALLOW).into_response()
    } else {
        next.run(request).await
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::ACCESS_CONTROL_ALLOW_ORIGIN, "*"),
        (
            header::ACCESS_CONTROL_EXPOSE_HEADERS,
            "Content-Range, ETag, Accept-Ranges, Content-Length",
        ),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "cross-origin",
        ),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}
