//! From a request to its response: what all requests have in common, and the way to the routes.
//!
//! Pages and files, nearly all of the traffic, are answered here without a router; the rest goes through axum's.
//! Every request has an id, which is in its response and in its log line.

use crate::accept::monitor::Monitor;
use crate::auth::{Auth, Denied};
use crate::body::{Outgoing, Watched};
use crate::error::ApiError;
use crate::limits::{Network, RateLimit};
use crate::metrics::Metrics;
use crate::routes::{files, pages, thumbnails};
use crate::source::Sources;
use crate::target::{Scope, Target, page_parts, target};
use axum::Router;
use axum::http::request::Parts;
use axum::http::{
    HeaderMap, HeaderName, HeaderValue, Method, Request, Response, StatusCode, Version, header,
};
use hyper::body::{Body as _, Incoming};
use hyper::service::Service as _;
use hyper_util::service::TowerToHyperService;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Characters of a request id that a client or a proxy may give.
const MAX_ID: usize = 64;
const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// The methods that are answered.
const METHODS: HeaderValue = HeaderValue::from_static("GET, HEAD, OPTIONS");

/// Who asks.
#[derive(Debug, Clone)]
pub(crate) struct Client {
    pub(crate) address: SocketAddr,
    /// Whether TLS protects the connection.
    pub(crate) secure: bool,
    pub(crate) monitor: Arc<Monitor>,
}

/// Answers requests.
#[derive(Debug)]
pub(crate) struct Service {
    pub(crate) sources: Arc<Sources>,
    pub(crate) auth: Auth,
    pub(crate) rate: Option<RateLimit>,
    pub(crate) proxies: Vec<Network>,
    pub(crate) metrics: Arc<Metrics>,
    pub(crate) router: TowerToHyperService<Router>,
    /// Whether files are served at all, or only what the router has.
    pub(crate) serves_files: bool,
    /// Whether each request has a line in the log.
    pub(crate) log_requests: bool,
    /// Of this run of the server, so that ids of two runs differ.
    ids: (u32, AtomicU64),
}

impl Service {
    pub(crate) fn new(
        sources: Arc<Sources>,
        auth: Auth,
        metrics: Arc<Metrics>,
        router: Router,
    ) -> Self {
        let seed = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.subsec_nanos());
        Self {
            sources,
            auth,
            serves_files: true,
            rate: None,
            proxies: Vec::new(),
            metrics,
            router: TowerToHyperService::new(router),
            log_requests: false,
            ids: (seed, AtomicU64::new(0)),
        }
    }

    pub(crate) fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Whether `address` is a proxy whose word is taken.
    pub(crate) fn trusts(&self, address: IpAddr) -> bool {
        self.proxies.iter().any(|network| network.contains(address))
    }

    /// Answers `request`, whatever it is.
    pub(crate) async fn answer(
        &self,
        request: Request<Incoming>,
        client: &Client,
    ) -> Response<Watched> {
        let guard = client.monitor.respond();
        let start = Instant::now();
        let (parts, body) = request.into_parts();
        let id = self.id(&parts.headers);
        let target = target(parts.uri.path());
        let route = target.route();
        let has_body = !body.is_end_stream();
        let result = self.respond(&parts, body, target, client).await;
        let mut response = match result {
            Ok(response) => response,
            Err(error) => error.response(),
        };
        if parts.method == Method::HEAD {
            silence(&mut response);
        }
        let status = response.status();
        common_headers(response.headers_mut(), &id);
        if (has_body || status == StatusCode::BAD_REQUEST) && parts.version <= Version::HTTP_11 {
            // What nobody read of a body must not be taken for the next request.
            let close = HeaderValue::from_static("close");
            response.headers_mut().insert(header::CONNECTION, close);
        }
        let time = start.elapsed();
        self.metrics.response(route, status.as_u16(), time);
        self.log(&parts, client, status, time.as_secs_f64() * 1e3, &id);
        response.map(|outgoing| Watched::new(outgoing, guard))
    }

    async fn respond(
        &self,
        parts: &Parts,
        body: Incoming,
        target: Target<'_>,
        client: &Client,
    ) -> Result<Response<Outgoing>, ApiError> {
        check(parts)?;
        if let Some(rate) = &self.rate {
            let address = self.address(&parts.headers, client);
            rate.take(address, Instant::now()).map_err(|seconds| {
                self.metrics.rate_limited.add();
                ApiError::TooMany { seconds }
            })?;
        }
        let (method, headers) = (&parts.method, &parts.headers);
        match *method {
            Method::OPTIONS => return Ok(preflight()),
            Method::GET | Method::HEAD => {}
            _ => return Err(ApiError::MethodNotAllowed),
        }
        if !self.auth.is_open() {
            self.admit(parts, &target)?;
        }
        let mut response = match target {
            Target::File(_) | Target::Pages(_) | Target::Thumbnail(_) if !self.serves_files => {
                return Err(ApiError::NotFound);
            }
            Target::File(name) => files::file(&self.sources, &name, method, headers).await?,
            Target::Pages(path) => pages::pages(&self.sources, &path, method, headers).await?,
            Target::Thumbnail(path) => {
                Box::pin(thumbnails::thumbnail(&self.sources, &path, headers)).await?
            }
            Target::Nonsense => return Err(ApiError::NotFound),
            Target::Routed(..) => {
                let request = Request::from_parts(parts.clone(), body);
                let routed = Box::pin(self.router.call(request)).await;
                let mut response = match routed {
                    Ok(response) => response.map(Outgoing::Other),
                    Err(never) => match never {},
                };
                if let Some(cookie) = self.cookie(parts, client) {
                    response.headers_mut().insert(header::SET_COOKIE, cookie);
                }
                response
            }
        };
        if !self.auth.is_open()
            && let Some(value) = response.headers_mut().get_mut(header::CACHE_CONTROL)
            && let Ok(text) = value.to_str()
            && let Some(rest) = text.strip_prefix("public")
        {
            // A shared cache would hand it to everyone.
            *value = HeaderValue::try_from(format!("private{rest}"))
                .unwrap_or(HeaderValue::from_static("no-store"));
        }
        Ok(response)
    }

    fn admit(&self, parts: &Parts, target: &Target<'_>) -> Result<(), ApiError> {
        let name = match target {
            Target::File(name) | Target::Routed(_, Scope::Name(name)) => Some(name.as_ref()),
            Target::Pages(path) => page_parts(path).map(|(name, ..)| name),
            Target::Thumbnail(path) => path.rsplit_once('/').map(|(name, _)| name),
            Target::Routed(_, Scope::Everything) => None,
            Target::Routed(_, Scope::Nothing) | Target::Nonsense => return Ok(()),
        };
        let name = name.map(|name| name.strip_suffix(".marq").unwrap_or(name));
        self.auth
            .check(&parts.headers, parts.uri.query(), name)
            .map_err(|denied| {
                self.metrics.unauthorized.add();
                match denied {
                    Denied::Nothing => ApiError::Unauthorized,
                    Denied::Wrong => ApiError::Forbidden,
                }
            })
    }

    /// The grant of a signed URL of the viewer, for the requests that the viewer makes.
    fn cookie(&self, parts: &Parts, client: &Client) -> Option<HeaderValue> {
        if parts.uri.path() != "/" || self.auth.is_open() {
            return None;
        }
        let cookie = self.auth.cookie(parts.uri.query()?, client.secure)?;
        HeaderValue::try_from(cookie).ok()
    }

    /// Whom a rate counts for: the client, or whom a trusted proxy names.
    fn address(&self, headers: &HeaderMap, client: &Client) -> IpAddr {
        let peer = client.address.ip();
        if !self.trusts(peer) {
            return peer;
        }
        // From the right: what stands left of the first address that is no proxy's anybody may have written.
        headers
            .get_all(FORWARDED_FOR)
            .iter()
            .rev()
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.rsplit(','))
            .map_while(|address| address.trim().parse::<IpAddr>().ok())
            .find(|&address| !self.trusts(address))
            .unwrap_or(peer)
    }

    fn id(&self, headers: &HeaderMap) -> HeaderValue {
        let given = headers.get(REQUEST_ID).filter(|value| {
            let bytes = value.as_bytes();
            let plain = |b: &u8| b.is_ascii_alphanumeric() || b"-_.".contains(b);
            (1..=MAX_ID).contains(&bytes.len()) && bytes.iter().all(plain)
        });
        if let Some(id) = given {
            return id.clone();
        }
        let (seed, next) = &self.ids;
        let id = format!("{seed:08x}-{:x}", next.fetch_add(1, Relaxed));
        HeaderValue::try_from(id).unwrap_or(HeaderValue::from_static("-"))
    }

    fn log(&self, parts: &Parts, client: &Client, status: StatusCode, ms: f64, id: &HeaderValue) {
        let (method, path, status) = (&parts.method, parts.uri.path(), status.as_u16());
        let id = id.to_str().unwrap_or_default();
        let address = client.address.ip();
        if status >= 500 {
            tracing::warn!(id, %method, path, status, ms, %address, "request failed");
        } else if self.log_requests {
            tracing::info!(target: "marquetry::requests", id, %method, path, status, ms, %address, "request");
        } else {
            tracing::debug!(id, %method, path, status, ms, %address, "request");
        }
    }
}

/// Refuses what hyper lets pass and RFC 9112 does not.
fn check(parts: &Parts) -> Result<(), ApiError> {
    let headers = &parts.headers;
    if parts.version == Version::HTTP_11 {
        let mut hosts = headers.get_all(header::HOST).iter();
        if hosts.next().is_none() || hosts.next().is_some() {
            return Err(ApiError::BadRequest("a request has exactly one Host"));
        }
    }
    // HTTP/2 has `:authority` for it. What has neither may lack its path as well, which hyper does not tell.
    if parts.version == Version::HTTP_2
        && parts.uri.authority().is_none()
        && !headers.contains_key(header::HOST)
    {
        return Err(ApiError::BadRequest("a request says whom it is for"));
    }
    if headers.contains_key(header::TRANSFER_ENCODING)
        && (headers.contains_key(header::CONTENT_LENGTH) || parts.version < Version::HTTP_11)
    {
        return Err(ApiError::BadRequest(
            "Transfer-Encoding and Content-Length contradict each other",
        ));
    }
    Ok(())
}

/// Answers a CORS preflight, and every other OPTIONS.
fn preflight() -> Response<Outgoing> {
    let mut response = Response::new(Outgoing::Full(None));
    *response.status_mut() = StatusCode::NO_CONTENT;
    let headers = response.headers_mut();
    for (name, value) in [
        (header::ALLOW, METHODS),
        (header::ACCESS_CONTROL_ALLOW_METHODS, METHODS),
        (
            header::ACCESS_CONTROL_ALLOW_HEADERS,
            HeaderValue::from_static(
                "Range, If-Range, If-Match, If-None-Match, If-Modified-Since, \
                 If-Unmodified-Since, Cache-Control, Authorization, X-Request-Id",
            ),
        ),
        (
            header::ACCESS_CONTROL_MAX_AGE,
            HeaderValue::from_static("86400"),
        ),
    ] {
        headers.insert(name, value);
    }
    response
}

/// Gives a response the headers that all have.
///
/// No request carries credentials that a browser adds by itself to another origin's, so any origin may read it.
fn common_headers(headers: &mut HeaderMap, id: &HeaderValue) {
    headers.reserve(5);
    for (name, value) in [
        (header::ACCESS_CONTROL_ALLOW_ORIGIN, "*"),
        (
            header::ACCESS_CONTROL_EXPOSE_HEADERS,
            "Content-Range, ETag, Accept-Ranges, Content-Length, Last-Modified, Retry-After, X-Request-Id",
        ),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (CROSS_ORIGIN_RESOURCE_POLICY, "cross-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.insert(REQUEST_ID, id.clone());
}

const CROSS_ORIGIN_RESOURCE_POLICY: HeaderName =
    HeaderName::from_static("cross-origin-resource-policy");

/// Takes the body from a response to HEAD, and tells its length as GET would.
fn silence(response: &mut Response<Outgoing>) {
    let length = match response.body() {
        Outgoing::Full(Some(bytes)) => Some(bytes.len() as u64),
        Outgoing::Other(body) => body.size_hint().exact().filter(|&length| length > 0),
        _ => None,
    };
    if let Some(length) = length {
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_LENGTH, HeaderValue::from(length));
    }
    *response.body_mut() = Outgoing::Full(None);
}
