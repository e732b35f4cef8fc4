//! `GET /health/live`: whether the server lives. `GET /health/ready` and `/health`: whether it should get requests.
//!
//! It is ready as soon as it listens, since everything on disk that is served was checked before, and until it is
//! asked to stop. Remote sources do not count: replicas that all took themselves out since one bucket stumbles would
//! turn slow pages into none.

use super::Shared;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use std::sync::atomic::Ordering::Relaxed;

/// Says that the server lives, and which version it is.
pub(crate) async fn live() -> impl IntoResponse {
    answer(StatusCode::OK, "ok")
}

/// Says whether the server takes requests.
pub(crate) async fn ready(State(shared): State<Shared>) -> impl IntoResponse {
    if shared.draining.load(Relaxed) {
        answer(StatusCode::SERVICE_UNAVAILABLE, "draining")
    } else {
        answer(StatusCode::OK, "ok")
    }
}

fn answer(code: StatusCode, status: &str) -> impl IntoResponse {
    let body = serde_json::json!({ "status": status, "version": env!("CARGO_PKG_VERSION") });
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (code, headers, body.to_string())
}
