//! Who may read: bearer tokens, and URLs signed for one file until a point in time.
//!
//! A signature is `BLAKE3(key, "NAME\nEXPIRES")`, keyed, in hexadecimal; it opens the file NAME, its pages, its
//! description and its thumbnail. `*` as the name opens everything. A browser that opens the viewer with a signed
//! URL gets the same grant as a cookie, since the requests that follow do not carry the query.
//!
//! Limit: what was signed stays valid until it expires; the only recall is another key.

use crate::config::Auth as Settings;
use crate::error::ServerError;
use axum::http::{HeaderMap, header};
use percent_encoding::percent_decode_str;
use std::time::{SystemTime, UNIX_EPOCH};

/// The name that stands for all files.
const EVERYTHING: &str = "*";
/// Name of the cookie that holds a grant.
pub(crate) const COOKIE: &str = "marquetry-grant";
const KEY_CONTEXT: &str = "marquetry 2026 signed URLs";

/// What lets requests in.
#[derive(Default)]
pub(crate) struct Auth {
    /// Hashes, so that comparing tells nothing of the tokens.
    tokens: Vec<blake3::Hash>,
    key: Option<[u8; 32]>,
}

impl std::fmt::Debug for Auth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Auth")
            .field("tokens", &self.tokens.len())
            .field("key", &self.key.is_some())
            .finish()
    }
}

/// A request may not have what it asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Denied {
    /// It carries nothing: 401.
    Nothing,
    /// What it carries is wrong, for something else, or expired: 403.
    Wrong,
}

impl Auth {
    /// Reads what the settings name.
    pub(crate) fn new(settings: &Settings) -> Result<Self, ServerError> {
        let read = |path: &std::path::PathBuf| {
            std::fs::read_to_string(path).map_err(|source| ServerError::Path {
                path: path.clone(),
                source,
            })
        };
        let mut tokens = settings.tokens.clone();
        if let Some(path) = &settings.token_file {
            tokens.extend(read(path)?.lines().map(str::to_owned));
        }
        let mut key = settings.signing_key.clone();
        if let Some(path) = &settings.signing_key_file {
            key = read(path)?.lines().next().map(str::to_owned);
        }
        let too_short = |what| ServerError::Secret { what };
        let hash = |token: &str| match token.trim() {
            "" => None,
            token if token.len() < 8 => Some(Err(too_short("a token has at least 8 characters"))),
            token => Some(Ok(blake3::hash(token.as_bytes()))),
        };
        Ok(Self {
            tokens: tokens
                .iter()
                .filter_map(|token| hash(token))
                .collect::<Result<_, _>>()?,
            key: match key.as_deref().map(str::trim) {
                None => None,
                Some(key) if key.len() < 16 => {
                    return Err(too_short("a signing key has at least 16 characters"));
                }
                Some(key) => Some(blake3::derive_key(KEY_CONTEXT, key.as_bytes())),
            },
        })
    }

    /// Whether everyone may read everything.
    pub(crate) fn is_open(&self) -> bool {
        self.tokens.is_empty() && self.key.is_none()
    }

    /// Whether a request for the file `name` (`None`: for the catalogue) may be answered.
    pub(crate) fn check(
        &self,
        headers: &HeaderMap,
        query: Option<&str>,
        name: Option<&str>,
    ) -> Result<(), Denied> {
        if self.is_open() {
            return Ok(());
        }
        let mut denied = Denied::Nothing;
        if let Some(value) = headers.get(header::AUTHORIZATION) {
            denied = Denied::Wrong;
            let token = value
                .to_str()
                .ok()
                .and_then(|value| value.split_once(' '))
                .filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
            // Hashes compare in constant time.
            if let Some((_, token)) = token
                && let found = blake3::hash(token.trim().as_bytes())
                && self.tokens.contains(&found)
            {
                return Ok(());
            }
        }
        if let Some(grant) = query.and_then(|query| Grant::of_query(query, name)) {
            denied = Denied::Wrong;
            if self.holds(&grant, name) {
                return Ok(());
            }
        }
        for grant in cookies(headers).filter_map(Grant::of_cookie) {
            denied = Denied::Wrong;
            if self.holds(&grant, name) {
                return Ok(());
            }
        }
        Err(denied)
    }

    fn holds(&self, grant: &Grant, name: Option<&str>) -> bool {
        let now = now();
        (grant.name == EVERYTHING || Some(grant.name.as_str()) == name)
            && grant.expires > now
            && self
                .signature(&grant.name, grant.expires)
                .is_some_and(|signature| {
                    blake3::Hash::from_hex(&grant.signature).is_ok_and(|found| found == signature)
                })
    }

    fn signature(&self, name: &str, expires: u64) -> Option<blake3::Hash> {
        let key = self.key.as_ref()?;
        Some(blake3::keyed_hash(
            key,
            format!("{name}\n{expires}").as_bytes(),
        ))
    }

    /// The query that opens `name` (`*`: everything) until `expires`, seconds since 1970.
    pub(crate) fn query(&self, name: &str, expires: u64) -> Option<String> {
        let signature = self.signature(name, expires)?;
        let scope = if name == EVERYTHING { "&scope=*" } else { "" };
        Some(format!(
            "expires={expires}&signature={}{scope}",
            signature.to_hex()
        ))
    }

    /// The cookie for a viewer opened with `query`, if that holds for the file that the query names.
    pub(crate) fn cookie(&self, query: &str, secure: bool) -> Option<String> {
        let file = parameter(query, "file");
        let grant = Grant::of_query(query, file.as_deref())?;
        if !self.holds(&grant, file.as_deref()) {
            return None;
        }
        let (expires, signature) = (grant.expires, &grant.signature);
        let name: String =
            percent_encoding::utf8_percent_encode(&grant.name, percent_encoding::NON_ALPHANUMERIC)
                .collect();
        let age = expires.saturating_sub(now());
        let secure = if secure { "; Secure" } else { "" };
        Some(format!(
            "{COOKIE}={name}.{expires}.{signature}; Path=/; Max-Age={age}; HttpOnly; SameSite=Strict{secure}"
        ))
    }
}

/// The query that opens the file `name` (`*`: everything) for `valid` from now on, to be appended to its URL; `None`
/// without a signing key.
///
/// # Errors
/// When the settings name a file that cannot be read, or a key that is too short.
pub fn sign(
    settings: &Settings,
    name: &str,
    valid: std::time::Duration,
) -> Result<Option<String>, ServerError> {
    let name = name.strip_suffix(".marq").unwrap_or(name);
    Ok(Auth::new(settings)?.query(name, now().saturating_add(valid.as_secs())))
}

fn now() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(u64::MAX, |passed| passed.as_secs())
}

/// A right that somebody claims.
#[derive(Debug, PartialEq, Eq)]
struct Grant {
    name: String,
    expires: u64,
    signature: String,
}

impl Grant {
    fn of_query(query: &str, name: Option<&str>) -> Option<Self> {
        let name = match parameter(query, "scope") {
            Some(scope) => scope,
            None => name?.to_owned(),
        };
        Some(Self {
            name,
            expires: parameter(query, "expires")?.parse().ok()?,
            signature: parameter(query, "signature")?,
        })
    }

    fn of_cookie(value: &str) -> Option<Self> {
        let mut parts = value.split('.');
        let (name, expires, signature) = (parts.next()?, parts.next()?, parts.next()?);
        Some(Self {
            name: percent_decode_str(name).decode_utf8().ok()?.into_owned(),
            expires: expires.parse().ok()?,
            signature: signature.to_owned(),
        })
    }
}

/// The value of `name` in `query`, decoded.
fn parameter(query: &str, name: &str) -> Option<String> {
    query.split('&').find_map(|pair| {
        let (found, value) = pair.split_once('=')?;
        let value = (found == name).then_some(value)?;
        Some(percent_decode_str(value).decode_utf8().ok()?.into_owned())
    })
}

fn cookies(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    headers
        .get_all(header::COOKIE)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'))
        .filter_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn auth() -> Auth {
        Auth::new(&Settings {
            tokens: vec!["correct horse".into()],
            signing_key: Some("battery staple battery".into()),
            ..Settings::default()
        })
        .unwrap()
    }

    fn with(name: header::HeaderName, value: &str) -> HeaderMap {
        let value = HeaderValue::from_str(value).unwrap();
        HeaderMap::from_iter([(name, value)])
    }

    #[test]
    fn without_settings_everything_is_open() {
        let open = Auth::default();
        assert_eq!(open.check(&HeaderMap::new(), None, Some("a")), Ok(()));
    }

    #[test]
    fn a_token_opens_everything() {
        let auth = auth();
        for (value, expected) in [
            ("Bearer correct horse", Ok(())),
            ("bearer correct horse", Ok(())),
            ("Bearer wrong horse", Err(Denied::Wrong)),
            ("Bearer ", Err(Denied::Wrong)),
            ("Basic correct horse", Err(Denied::Wrong)),
            ("correct horse", Err(Denied::Wrong)),
        ] {
            let headers = with(header::AUTHORIZATION, value);
            assert_eq!(auth.check(&headers, None, None), expected, "{value}");
        }
        let nothing = HeaderMap::new();
        assert_eq!(auth.check(&nothing, None, Some("a")), Err(Denied::Nothing));
    }

    #[test]
    fn a_signed_url_opens_one_file_until_it_expires() {
        let auth = auth();
        let nothing = HeaderMap::new();
        let check = |query: &str, name| auth.check(&nothing, Some(query), name);
        let later = now() + 100;
        let good = auth.query("a/b c", later).unwrap();
        assert_eq!(check(&good, Some("a/b c")), Ok(()));
        assert_eq!(check(&good, Some("other")), Err(Denied::Wrong));
        assert_eq!(check(&good, None), Err(Denied::Nothing));
        let prolonged = good.replace(&later.to_string(), &(later + 1).to_string());
        assert_eq!(check(&prolonged, Some("a/b c")), Err(Denied::Wrong));
        let expired = auth.query("a", now() - 1).unwrap();
        assert_eq!(check(&expired, Some("a")), Err(Denied::Wrong));
        let everything = auth.query("*", later).unwrap();
        assert_eq!(check(&everything, Some("a")), Ok(()));
        assert_eq!(check(&everything, None), Ok(()));
        for query in ["", "expires=1", "expires=x&signature=y", "signature=00"] {
            assert_eq!(check(query, Some("a")), Err(Denied::Nothing), "{query}");
        }
    }

    #[test]
    fn the_viewer_gets_its_grant_as_a_cookie() {
        let auth = auth();
        let query = auth.query("a b", now() + 100).unwrap();
        let cookie = auth.cookie(&format!("file=a%20b&{query}"), true).unwrap();
        assert!(cookie.contains("HttpOnly") && cookie.ends_with("; Secure"));
        let sent = cookie.split(';').next().unwrap();
        let headers = with(header::COOKIE, &format!("x=y; {sent}"));
        assert_eq!(auth.check(&headers, None, Some("a b")), Ok(()));
        assert_eq!(auth.check(&headers, None, Some("b")), Err(Denied::Wrong));
        assert_eq!(auth.cookie(&format!("file=b&{query}"), false), None);
        assert_eq!(auth.cookie(&query, false), None);
    }
}
