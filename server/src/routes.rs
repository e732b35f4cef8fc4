//! The handlers, one module a route.

pub(crate) mod catalogue;
pub(crate) mod files;
pub(crate) mod health;
pub(crate) mod pages;
pub(crate) mod viewer;

use crate::error::ApiError;
use crate::source::{FileName, LookUpError, OpenFile, Sources};
use std::sync::Arc;

/// Runs `work`, which blocks on the disk, where blocking is allowed.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ApiError> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work)
        .await
        .unwrap_or_else(|error| {
            tracing::error!(%error, "request failed");
            Err(ApiError::Unreadable)
        })
}

/// The file called `name`, which came decoded from a URL. Blocks.
fn look_up(sources: &Sources, name: &str) -> Result<Arc<OpenFile>, ApiError> {
    let name = FileName::parse(name).ok_or(ApiError::NotFound)?;
    sources.open(&name).map_err(|error| match error {
        LookUpError::Unknown => ApiError::NotFound,
        LookUpError::Unusable { .. } => {
            tracing::warn!(%error, "cannot be served");
            ApiError::Unreadable
        }
    })
}
