//! The handlers, one module a route.

pub(crate) mod about;
pub(crate) mod catalogue;
pub(crate) mod catalogue_page;
pub(crate) mod files;
pub(crate) mod health;
pub(crate) mod pages;
pub(crate) mod thumbnails;
pub(crate) mod viewer;

use crate::error::ApiError;
use crate::metrics::Metrics;
use crate::source::Sources;
use axum::Router;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What the handlers share.
#[derive(Debug, Clone)]
pub(crate) struct Shared {
    pub(crate) sources: Arc<Sources>,
    pub(crate) metrics: Arc<Metrics>,
    /// Whether the server is about to stop.
    pub(crate) draining: Arc<AtomicBool>,
}

/// The routes of the main address; with `/metrics` unless an admin address has it.
pub(crate) fn main(shared: Shared, with_metrics: bool) -> Router {
    let mut router = Router::new()
        .route("/", get(viewer::index))
        .route("/catalogue", get(catalogue_page::page))
        .route("/api/catalogue", get(catalogue::catalogue))
        .route("/api/files/{*name}", get(about::about));
    if with_metrics {
        router = router.route("/metrics", get(metrics));
    }
    health_routes(router)
        .fallback(viewer::asset)
        .with_state(shared)
}

/// The routes of the admin address.
pub(crate) fn admin(shared: Shared) -> Router {
    health_routes(Router::new().route("/metrics", get(metrics)))
        .fallback(|| async { ApiError::NotFound })
        .with_state(shared)
}

fn health_routes(router: Router<Shared>) -> Router<Shared> {
    router
        .route("/health", get(health::ready))
        .route("/health/live", get(health::live))
        .route("/health/ready", get(health::ready))
}

async fn metrics(State(shared): State<Shared>) -> impl IntoResponse {
    let headers = [
        (
            header::CONTENT_TYPE,
            "text/plain; version=0.0.4; charset=utf-8",
        ),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, shared.metrics.text())
}
