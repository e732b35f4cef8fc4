//! `GET /` and everything the page loads: the web build that was embedded when the server was built.

use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use axum::http::{HeaderMap, HeaderName, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use std::sync::LazyLock;

mod embedded {
    include!(concat!(env!("OUT_DIR"), "/web_build.rs"));
}

const INDEX: &str = "index.html";

/// The page may run its own scripts and WebAssembly, and talk to any server that it is told to load a
/// file from; nothing else.
const CONTENT_SECURITY_POLICY: (HeaderName, &str) = (
    header::CONTENT_SECURITY_POLICY,
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; \
     connect-src 'self' http: https:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; \
     base-uri 'none'; form-action 'none'",
);

/// One file of the web build.
#[derive(Debug)]
struct Asset {
    /// Path below the root of the site.
    path: &'static str,
    bytes: &'static [u8],
    content_type: &'static str,
    /// Strong entity tag, quotes included.
    etag: String,
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    embedded::FILES
        .iter()
        .map(|&(path, bytes)| Asset {
            path,
            bytes,
            content_type: content_type(path),
            etag: format!("\"{:032x}\"", xxhash_rust::xxh3::xxh3_128(bytes)),
        })
        .collect()
});

/// The page, whatever its query says: the page itself reads `?file=NAME`.
pub(crate) async fn index(headers: HeaderMap) -> Result<Response, ApiError> {
    if embedded::FILES.is_empty() {
        return Ok(not_embedded());
    }
    respond(INDEX, &headers)
}

/// Every other path.
pub(crate) async fn asset(
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if !matches!(method, Method::GET | Method::HEAD) {
        return Err(ApiError::MethodNotAllowed);
    }
    respond(uri.path().trim_start_matches('/'), &headers)
}

fn respond(path: &str, headers: &HeaderMap) -> Result<Response, ApiError> {
    let asset = ASSETS
        .iter()
        .find(|asset| asset.path == path)
        .ok_or(ApiError::NotFound)?;
    // Names stay the same from build to build, so a cache has to ask.
    let common = [
        (header::ETAG, asset.etag.as_str()),
        (header::CACHE_CONTROL, "no-cache"),
        CONTENT_SECURITY_POLICY,
    ];
    Ok(match conditional::evaluate(headers, &asset.etag) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => (StatusCode::NOT_MODIFIED, common).into_response(),
        Verdict::Proceed => {
            let content_type = [(header::CONTENT_TYPE, asset.content_type)];
            (common, content_type, asset.bytes).into_response()
        }
    })
}

/// What `GET /` gives when the web build was not there at build time.
fn not_embedded() -> Response {
    const PAGE: &str = "<!doctype html><meta charset=\"utf-8\"><title>Marquetry</title>\
        <p>This server was built without the viewer. Run <code>cargo xtask web</code>, then build \
        again.<p>What is served: <a href=\"/api/catalogue\">/api/catalogue</a>\n";
    let headers = [
        (header::CONTENT_TYPE, content_type(INDEX)),
        (header::CACHE_CONTROL, "no-store"),
        CONTENT_SECURITY_POLICY,
    ];
    (headers, PAGE).into_response()
}

fn content_type(path: &str) -> &'static str {
    let extension = path.rsplit_once('.').map_or("", |(_, extension)| extension);
    match extension {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "wasm" => "application/wasm",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "txt" | "md" | "ts" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wasm_and_modules_have_the_types_browsers_insist_on() {
        assert_eq!(content_type("marquetry_web_bg.wasm"), "application/wasm");
        assert_eq!(
            content_type("marquetry.js"),
            "text/javascript; charset=utf-8"
        );
        assert_eq!(
            content_type("snippets/a/b.mjs"),
            "text/javascript; charset=utf-8"
        );
        assert_eq!(content_type("no_extension"), "application/octet-stream");
    }

    #[test]
    fn assets_are_found_by_their_exact_path_only() {
        for asset in ASSETS.iter() {
            assert!(respond(asset.path, &HeaderMap::new()).is_ok());
        }
        for path in ["", "nothing.js", "../Cargo.toml", "src/routes/viewer.rs"] {
            assert!(respond(path, &HeaderMap::new()).is_err(), "{path}");
        }
    }
}
