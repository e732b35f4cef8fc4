//! `GET /` and everything the page loads: the web build that was embedded when the server was built.
//!
//! Each file is stored as it is and, where that is smaller, compressed by Zstandard and by gzip; what the client
//! accepts is passed on as it is stored. (Pages are not compressed once more: what is inside them is already.)

use crate::conditional::{self, Verdict};
use crate::error::ApiError;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use std::sync::LazyLock;

mod embedded {
    include!(concat!(env!("OUT_DIR"), "/web_build.rs"));
}

const INDEX: &str = "index.html";

/// The page may run its own scripts and WebAssembly, and talk to any server that it is told to load a
/// file from; nothing else.
pub(crate) const PAGE_HEADERS: [(HeaderName, &str); 3] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; \
         connect-src 'self' http: https:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; \
         base-uri 'none'; form-action 'none'",
    ),
    (header::REFERRER_POLICY, "no-referrer"),
    (
        HeaderName::from_static("permissions-policy"),
        "camera=(), geolocation=(), microphone=()",
    ),
];

/// One file of the web build.
#[derive(Debug)]
struct Asset {
    /// Path below the root of the site.
    path: &'static str,
    content_type: &'static str,
    /// The ways it is stored, best first, plain last.
    stored: Vec<Stored>,
}

#[derive(Debug)]
struct Stored {
    /// Content coding; empty for none.
    coding: &'static str,
    bytes: &'static [u8],
    /// Strong entity tag, quotes included: one for each coding, since the bytes differ.
    etag: String,
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    embedded::FILES
        .iter()
        .map(|&(path, plain, zstd, gzip)| Asset {
            path,
            content_type: content_type(path),
            stored: [("zstd", zstd), ("gzip", gzip), ("", plain)]
                .into_iter()
                .filter(|(coding, bytes)| coding.is_empty() || !bytes.is_empty())
                .map(|(coding, bytes)| Stored {
                    coding,
                    bytes,
                    etag: format!("\"{:032x}\"", xxhash_rust::xxh3::xxh3_128(bytes)),
                })
                .collect(),
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
pub(crate) async fn asset(uri: Uri, headers: HeaderMap) -> Result<Response, ApiError> {
    respond(uri.path().trim_start_matches('/'), &headers)
}

fn respond(path: &str, headers: &HeaderMap) -> Result<Response, ApiError> {
    let asset = ASSETS
        .iter()
        .find(|asset| asset.path == path)
        .ok_or(ApiError::NotFound)?;
    let stored = (asset.stored.iter())
        .find(|stored| stored.coding.is_empty() || accepts(headers, stored.coding))
        .ok_or(ApiError::NotFound)?;
    // Names stay the same from build to build, so a cache has to ask.
    let mut common = HeaderMap::new();
    common.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    common.insert(header::VARY, HeaderValue::from_static("Accept-Encoding"));
    if let Ok(etag) = HeaderValue::from_str(&stored.etag) {
        common.insert(header::ETAG, etag);
    }
    for (name, value) in PAGE_HEADERS {
        common.insert(name, HeaderValue::from_static(value));
    }
    Ok(match conditional::evaluate(headers, &stored.etag, None) {
        Verdict::Failed => return Err(ApiError::PreconditionFailed),
        Verdict::NotModified => (StatusCode::NOT_MODIFIED, common).into_response(),
        Verdict::Proceed => {
            if !stored.coding.is_empty() {
                let coding = HeaderValue::from_static(stored.coding);
                common.insert(header::CONTENT_ENCODING, coding);
            }
            let content_type = [(header::CONTENT_TYPE, asset.content_type)];
            (common, content_type, stored.bytes).into_response()
        }
    })
}

/// Whether the client takes `coding` (RFC 9110, section 12.5.3).
fn accepts(headers: &HeaderMap, coding: &str) -> bool {
    let mut any = false;
    for element in headers
        .get_all(header::ACCEPT_ENCODING)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
    {
        let mut parts = element.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default();
        let weight = parts.find_map(|part| {
            let (key, value) = part.split_once('=')?;
            (key.trim().eq_ignore_ascii_case("q")).then(|| value.trim().parse::<f32>())
        });
        let wanted = match weight {
            None => true,
            Some(weight) => weight.is_ok_and(|weight| weight > 0.0),
        };
        if name.eq_ignore_ascii_case(coding) {
            return wanted;
        }
        any |= name == "*" && wanted;
    }
    any
}

/// What `GET /` gives when the web build was not there at build time.
fn not_embedded() -> Response {
    const PAGE: &str = "<!doctype html><meta charset=\"utf-8\"><title>Marquetry</title>\
        <p>This server was built without the viewer. Run <code>cargo xtask web</code>, then build \
        again.<p>What is served: <a href=\"/api/catalogue\">/api/catalogue</a>\n";
    let headers = [
        (header::CONTENT_TYPE, content_type(INDEX)),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, PAGE_HEADERS, PAGE).into_response()
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

    #[test]
    fn a_coding_is_used_only_where_it_is_accepted() {
        for (field, zstd, gzip) in [
            (None, false, false),
            (Some(""), false, false),
            (Some("gzip, deflate, br, zstd"), true, true),
            (Some("gzip;q=0.5"), false, true),
            (Some("ZSTD"), true, false),
            (Some("*"), true, true),
            (Some("*, zstd;q=0"), false, true),
            (Some("gzip;q=0, *"), true, false),
            (Some("zstd ; q=0.000"), false, false),
            (Some("zstd;q=x"), false, false),
            (Some("identity"), false, false),
        ] {
            let mut headers = HeaderMap::new();
            if let Some(field) = field {
                headers.insert(header::ACCEPT_ENCODING, HeaderValue::from_static(field));
            }
            assert_eq!(accepts(&headers, "zstd"), zstd, "{field:?}");
            assert_eq!(accepts(&headers, "gzip"), gzip, "{field:?}");
        }
    }

    #[test]
    fn what_is_stored_compressed_is_the_same_file() {
        use std::io::Read;
        for asset in ASSETS.iter() {
            let plain = asset.stored.last().unwrap();
            assert_eq!(plain.coding, "");
            for stored in &asset.stored {
                let mut bytes = Vec::new();
                match stored.coding {
                    "gzip" => flate2::read::GzDecoder::new(stored.bytes)
                        .read_to_end(&mut bytes)
                        .map(|_| ())
                        .unwrap(),
                    "zstd" => bytes = zstd::decode_all(stored.bytes).unwrap(),
                    _ => bytes = stored.bytes.to_vec(),
                }
                assert!(bytes == plain.bytes, "{} {}", asset.path, stored.coding);
                assert!(stored.bytes.len() <= plain.bytes.len());
            }
        }
    }
}
