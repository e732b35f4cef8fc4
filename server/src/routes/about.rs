//! `GET /api/files/NAME`: all that a client needs to know of one file before it reads it.
//!
//! What `TileJSON` is for maps: a template for the addresses of pages, how many there are, bounds, errors, where it
//! comes from. Title, description, licence and attribution come from a sidecar, `NAME.json` beside `NAME.marq`.

use super::Shared;
use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use crate::source::{Facts, FileName};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use marquetry_format::ContentKind;
use serde::{Deserialize, Serialize};

/// Characters of a text of a sidecar that are passed on.
const MAX_TEXT: usize = 4096;

/// One file in the catalogue.
#[derive(Debug, Serialize)]
pub(crate) struct Entry {
    /// Without extension, folders separated by `/`; what `/?file=` takes.
    pub(crate) name: String,
    /// Path of the raw file.
    url: String,
    /// Path that `/PAGE` or `/FIRST-LAST` is appended to.
    pages_url: String,
    /// Path of the description.
    about_url: String,
    /// Path of a picture, if the file has one.
    pub(crate) thumbnail_url: Option<String>,
    /// Path of the viewer with this file.
    pub(crate) viewer_url: String,
    pub(crate) bytes: u64,
    content_id: String,
    /// Date of the last change, as HTTP writes it.
    modified: Option<String>,
    pub(crate) kind: ContentKind,
    /// Triangles of the input.
    pub(crate) triangles: u64,
    bounds: Bounds,
    /// `x`, `y` or `z`.
    up: &'static str,
    #[serde(flatten)]
    pub(crate) sidecar: Sidecar,
}

/// What stands beside a file.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Sidecar {
    /// What people call it.
    pub(crate) title: Option<String>,
    pub(crate) description: Option<String>,
    /// Under which terms it may be used: an SPDX expression, or words.
    pub(crate) licence: Option<String>,
    /// Whom to name.
    pub(crate) attribution: Option<String>,
}

#[derive(Debug, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

/// The description of one file.
#[derive(Debug, Serialize)]
struct About {
    /// Version of this description.
    marquetry: &'static str,
    /// Version of the file's format.
    format: String,
    #[serde(flatten)]
    entry: Entry,
    /// Addresses of pages, with `{first}` and `{last}` to be replaced.
    pages: [String; 2],
    page_count: u32,
    charts: u32,
    /// Bytes at the start of the file that the first image takes.
    first_image_bytes: u64,
    /// Relative to the diagonal of the bounds.
    error_rel: ErrorRel,
    source: SourceOf,
}

#[derive(Debug, Serialize)]
struct ErrorRel {
    target: f64,
    rms: f64,
    /// No point of either surface is farther from the other.
    max: f64,
}

#[derive(Debug, Serialize)]
struct SourceOf {
    name: String,
    triangles: u64,
    vertices: u64,
    generator: String,
}

impl Sidecar {
    /// Reads a sidecar; what is wrong with it costs its contents, not the file's.
    fn parse(bytes: &[u8], name: &FileName) -> Self {
        let mut sidecar: Self = serde_json::from_slice(bytes).unwrap_or_else(|error| {
            tracing::warn!(%name, %error, "sidecar is no JSON as it should be");
            Self::default()
        });
        for text in [
            &mut sidecar.title,
            &mut sidecar.description,
            &mut sidecar.licence,
            &mut sidecar.attribution,
        ] {
            if let Some(text) = text
                && let Some((end, _)) = text.char_indices().nth(MAX_TEXT)
            {
                text.truncate(end);
            }
        }
        sidecar
    }
}

impl Entry {
    /// What kind of content it is, for people.
    pub(crate) fn kind_in_words(&self) -> &'static str {
        match self.kind {
            ContentKind::Scan => "Scan",
            ContentKind::Terrain => "Terrain",
            ContentKind::Scene => "Scene",
        }
    }

    pub(crate) fn new(name: &FileName, facts: &Facts, sidecar: Option<&[u8]>) -> Self {
        let metadata = &facts.metadata;
        let escaped = name.escaped();
        let content_id = &facts.content_id;
        let thumbnail_url =
            (facts.has_thumbnail).then(|| format!("/thumbnails/{escaped}/{content_id}"));
        Self {
            name: name.to_string(),
            url: format!("/files/{escaped}.marq"),
            pages_url: format!("/pages/{escaped}/{content_id}"),
            about_url: format!("/api/files/{escaped}"),
            thumbnail_url,
            viewer_url: format!("/?file={escaped}"),
            bytes: facts.bytes,
            content_id: content_id.clone(),
            modified: facts.modified.map(httpdate::fmt_http_date),
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
            sidecar: sidecar.map_or_else(Sidecar::default, |bytes| Sidecar::parse(bytes, name)),
        }
    }
}

/// Describes the file called `name`.
pub(crate) async fn about(
    State(shared): State<Shared>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let name = FileName::parse(&name).ok_or(ApiError::NotFound)?;
    let facts = shared.sources.open(&name.to_string()).await?.facts();
    let sidecar = shared.sources.about(&name).await;
    let entry = Entry::new(&name, &facts, sidecar.as_deref());
    let (major, minor) = facts.version;
    let pages = [
        format!("{}/{{first}}", entry.pages_url),
        format!("{}/{{first}}-{{last}}", entry.pages_url),
    ];
    let metadata = facts.metadata;
    let about = About {
        marquetry: "1",
        format: format!("{major}.{minor}"),
        pages,
        page_count: facts.pages,
        charts: facts.charts,
        first_image_bytes: facts.front_bytes,
        error_rel: ErrorRel {
            target: metadata.target_error_rel,
            rms: metadata.rms_error_rel,
            max: metadata.max_error_rel,
        },
        source: SourceOf {
            name: metadata.source_name,
            triangles: metadata.source_triangles,
            vertices: metadata.source_vertices,
            generator: metadata.generator,
        },
        entry,
    };
    json(&headers, &about)
}

/// A response of JSON, with an entity tag of its own.
pub(crate) fn json(headers: &HeaderMap, value: &impl Serialize) -> Result<Response, ApiError> {
    let text = serde_json::to_string(value).map_err(|error| {
        tracing::error!(%error, "cannot be written as JSON");
        ApiError::Unreadable
    })?;
    self::text(headers, "application/json", text)
}

/// A response made just now, with an entity tag of its own.
pub(crate) fn text(
    headers: &HeaderMap,
    content_type: &'static str,
    text: String,
) -> Result<Response, ApiError> {
    let etag = format!("\"{:032x}\"", xxhash_rust::xxh3::xxh3_128(text.as_bytes()));
    let common = [
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    Ok(match conditional::evaluate(headers, &etag, None) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => (StatusCode::NOT_MODIFIED, common).into_response(),
        Verdict::Proceed => {
            let content_type = [(header::CONTENT_TYPE, content_type)];
            (common, content_type, text).into_response()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sidecar_is_bounded_and_never_fatal() {
        let name = FileName::parse("a").unwrap();
        let good = Sidecar::parse(br#"{"licence":"CC-BY-4.0","other":1}"#, &name);
        assert_eq!(good.licence.as_deref(), Some("CC-BY-4.0"));
        for text in ["", "[]", "{\"title\":5}", "\u{0}"] {
            assert!(Sidecar::parse(text.as_bytes(), &name).title.is_none());
        }
        let long = format!("{{\"title\":\"{}\"}}", "ä".repeat(MAX_TEXT + 5));
        let title = Sidecar::parse(long.as_bytes(), &name).title.unwrap();
        assert_eq!(title.chars().count(), MAX_TEXT);
    }
}
