//! TLS with rustls: certificate and key from PEM files, read anew when they change.
//!
//! A pair that cannot be used later on (a certificate written, its key not yet) is logged and the old one stays.

use crate::config::Tls as Settings;
use crate::error::ServerError;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, SystemTime};
use tokio_rustls::TlsAcceptor;

/// How often the files are looked at.
const LOOK: Duration = Duration::from_secs(10);

/// The protocols offered, most wanted first.
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// Certificate and key in use.
#[derive(Debug)]
pub(crate) struct Tls {
    settings: Settings,
    current: RwLock<Arc<ServerConfig>>,
}

impl Tls {
    /// Reads certificate and key.
    pub(crate) fn new(settings: &Settings) -> Result<Self, ServerError> {
        let current = read(settings)?;
        Ok(Self {
            settings: settings.clone(),
            current: RwLock::new(Arc::new(current)),
        })
    }

    /// What greets the next connection.
    pub(crate) fn acceptor(&self) -> TlsAcceptor {
        let current = self.current.read().unwrap_or_else(PoisonError::into_inner);
        TlsAcceptor::from(Arc::clone(&current))
    }

    /// Follows changes of the files, for ever.
    pub(crate) async fn follow(&self) {
        let changed = || [&self.settings.certificate, &self.settings.key].map(|path| time_of(path));
        let mut known = changed();
        loop {
            tokio::time::sleep(LOOK).await;
            let now = changed();
            if now == known {
                continue;
            }
            match read(&self.settings) {
                Ok(new) => {
                    known = now;
                    *self.current.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(new);
                    tracing::info!("the certificate was read anew");
                }
                Err(error) => tracing::warn!(%error, "the old certificate stays in use"),
            }
        }
    }
}

fn time_of(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path)
        .and_then(|metadata| metadata.modified())
        .ok()
}

fn read(settings: &Settings) -> Result<ServerConfig, ServerError> {
    let wrong = |path: &Path, message: String| ServerError::Tls {
        path: path.to_owned(),
        message,
    };
    let chain = CertificateDer::pem_file_iter(&settings.certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|error| wrong(&settings.certificate, error.to_string()))?;
    let key = PrivateKeyDer::from_pem_file(&settings.key)
        .map_err(|error| wrong(&settings.key, error.to_string()))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| {
            let builder = builder.with_no_client_auth();
            builder.with_single_cert(chain, key)
        })
        .map_err(|error| wrong(&settings.certificate, error.to_string()))?;
    config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
    Ok(config)
}
