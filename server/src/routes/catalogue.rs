//! `GET /api/catalogue`: what is served.

use super::blocking;
use crate::error::ApiError;
use crate::source::{Facts, FileName, Sources};
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use marquetry_format::ContentKind;
use serde::Serialize;
use std::sync::Arc;

#[derive(Debug, Serialize)]
struct Catalogue {
    files: Vec<Entry>,
}

/// One file.
#[derive(Debug, Serialize)]
struct Entry {
    /// Without extension, folders separated by `/`; what `/?file=` takes.
    name: String,
    /// Path of the raw file.
    url: String,
    /// Path that `/PAGE` or `/FIRST-LAST` is appended to.
    pages_url: String,
    bytes: u64,
    content_id: String,
    kind: ContentKind,
    /// Triangles of the input.
    triangles: u64,
    bounds: Bounds,
    /// `x`, `y` or `z`.
    up: &'static str,
}

#[derive(Debug, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

impl Entry {
    fn new(name: &FileName, facts: &Facts) -> Self {
        let metadata = &facts.metadata;
        let escaped = name.escaped();
        Self {
            name: name.to_string(),
            url: format!("/files/{escaped}.marq"),
            pages_url: format!("/pages/{escaped}/{}", facts.content_id),
            bytes: facts.bytes,
            content_id: facts.content_id.clone(),
            kind: metadata.kind,
            triangles: metadata.source_triangles,
            bounds: Bounds {
                min: metadata.bounds_min,
                max: metadata.bounds_max,
            },
            up: match metadata.up_axis {
                0 => "x",
                1 => "y",
                _ => "z",
            },
        }
    }
}

/// Looks at all files and lists those that can be served.
pub(crate) async fn catalogue(State(sources): State<Arc<Sources>>) -> Result<Response, ApiError> {
    let json = blocking(move || {
        let list = sources.list();
        let files = list
            .iter()
            .map(|(name, facts)| Entry::new(name, facts))
            .collect();
        serde_json::to_string(&Catalogue { files }).map_err(|error| {
            tracing::error!(%error, "catalogue");
            ApiError::Unreadable
        })
    })
    .await?;
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    Ok((headers, json).into_response())
}
