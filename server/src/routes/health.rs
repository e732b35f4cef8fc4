//! `GET /health`: whether the server lives and is ready.
//!
//! It is ready as soon as it listens, since everything that is served was checked before.

use axum::http::header;
use axum::response::IntoResponse;

/// Says that all is well, and which version this is.
pub(crate) async fn health() -> impl IntoResponse {
    let body = serde_json::json!({ "status": "ok", "version": env!("CARGO_PKG_VERSION") });
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, body.to_string())
}
