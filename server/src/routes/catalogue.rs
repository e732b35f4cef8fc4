//! `GET /api/catalogue`: what is served.

use super::Shared;
use super::about::{Entry, json};
use crate::error::ApiError;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Serialize;

#[derive(Debug, Serialize)]
struct Catalogue {
    files: Vec<Entry>,
}

/// Looks at all files and lists those that can be served.
pub(crate) async fn catalogue(
    State(shared): State<Shared>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let files = entries(&shared).await;
    json(&headers, &Catalogue { files })
}

/// What is served, by name.
pub(crate) async fn entries(shared: &Shared) -> Vec<Entry> {
    let list = shared.sources.list().await;
    let mut entries = Vec::with_capacity(list.len());
    for (name, facts) in list {
        let about = shared.sources.about(&name).await;
        entries.push(Entry::new(&name, &facts, about.as_deref()));
    }
    entries
}
