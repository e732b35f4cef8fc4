//! The server as a whole: its listening sockets, its life.

use crate::accept::tls::Tls;
use crate::accept::workers::Workers;
use crate::accept::{self, Door};
use crate::auth::Auth;
use crate::config::{Config, ConnectionLimits};
use crate::error::ServerError;
use crate::limits::{Connections, Network, RateLimit};
use crate::metrics::Metrics;
use crate::routes::{self, Shared};
use crate::service::Service;
use crate::source::Sources;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use tokio::net::{TcpListener, TcpSocket};
use tokio::runtime::Handle;
use tokio::sync::watch;

/// Connections that wait to be accepted.
const BACKLOG: u32 = 4096;
/// Descriptors that are not connections: files, sockets to upstream, the runtime's own.
const OTHER_DESCRIPTORS: u64 = 512;

/// A server that listens and is ready to run.
#[derive(Debug)]
pub struct Server {
    main: Listening,
    admin: Option<Listening>,
    tls: Option<Arc<Tls>>,
    workers: Arc<Workers>,
    draining: Arc<AtomicBool>,
    limits: ConnectionLimits,
}

#[derive(Debug)]
struct Listening {
    listener: TcpListener,
    address: SocketAddr,
    door: Arc<Door>,
}

impl Server {
    /// Checks what is to be served and starts to listen. Connections wait until [`Server::run`].
    ///
    /// Connections have threads of their own, as many as the runtime has that this is called in.
    ///
    /// # Errors
    /// When a path cannot be served, an address cannot be listened on, or the system has no more threads.
    pub async fn bind(config: Config) -> Result<Self, ServerError> {
        config.check()?;
        use_ring();
        let mut limits = config.connections;
        limits.open = limits.open.min(descriptors(limits.open));
        let metrics = Arc::new(Metrics::default());
        let sources = Sources::new(&config.paths, &config.upstream, &metrics).await?;
        let shared = Shared {
            sources: Arc::new(sources),
            metrics: Arc::clone(&metrics),
            draining: Arc::default(),
        };
        let tls = match &config.tls {
            Some(settings) => Some(Arc::new(Tls::new(settings)?)),
            None => None,
        };
        let service = |auth, router| {
            let sources = Arc::clone(&shared.sources);
            Service::new(sources, auth, Arc::clone(&metrics), router)
        };
        let router = routes::main(shared.clone(), config.admin_listen.is_none());
        let mut service_of_all = service(Auth::new(&config.auth)?, router);
        let requests = &config.requests;
        service_of_all.rate = RateLimit::new(requests.per_second, requests.burst);
        service_of_all.proxies = (requests.trusted_proxies.iter())
            .filter_map(|text| Network::parse(text))
            .collect();
        service_of_all.log_requests = config.log.requests;
        let main = Door {
            limits,
            tls: tls.clone(),
            service: Arc::new(service_of_all),
            connections: Arc::default(),
        };
        let admin = match &config.admin_listen {
            None => None,
            Some(address) => {
                let router = routes::admin(shared.clone());
                let mut service = service(Auth::default(), router);
                service.serves_files = false;
                let door = Door {
                    limits,
                    tls: None,
                    service: Arc::new(service),
                    connections: Arc::new(Connections::default()),
                };
                Some(Listening::new(address, door).await?)
            }
        };
        let threads = Handle::current().metrics().num_workers();
        let workers = Workers::start(threads).map_err(ServerError::Workers)?;
        Ok(Self {
            main: Listening::new(&config.listen, main).await?,
            admin,
            tls,
            workers: Arc::new(workers),
            draining: shared.draining,
            limits,
        })
    }

    /// The address listened on, with the port that the system picked.
    pub fn local_addr(&self) -> SocketAddr {
        self.main.address
    }

    /// The admin address, if there is one.
    pub fn admin_addr(&self) -> Option<SocketAddr> {
        self.admin.as_ref().map(|listening| listening.address)
    }

    /// Whether the server speaks TLS.
    pub fn is_secure(&self) -> bool {
        self.tls.is_some()
    }

    /// Answers requests until `shutdown` resolves; then lets requests under way end, for as long as the
    /// configuration says.
    pub async fn run(self, shutdown: impl Future<Output = ()>) {
        let (stop, stopping) = watch::channel(false);
        let (stop_admin, stopping_admin) = watch::channel(false);
        let follow = self.tls.clone().map(|tls| {
            tokio::spawn(async move {
                tls.follow().await;
            })
        });
        let admin = self.admin.map(|admin| {
            let Listening { listener, door, .. } = admin;
            let workers = Arc::clone(&self.workers);
            tokio::spawn(accept::serve(listener, door, workers, stopping_admin))
        });
        let Listening { listener, door, .. } = self.main;
        let main = tokio::spawn(accept::serve(listener, door, self.workers, stopping));
        shutdown.await;
        self.draining.store(true, Relaxed);
        if !self.limits.drain_delay.is_zero() {
            tracing::info!("no longer ready; still listening");
            tokio::time::sleep(self.limits.drain_delay).await;
        }
        stop.send_replace(true);
        // An error is a panic, which the runtime has reported.
        let _ = main.await;
        stop_admin.send_replace(true);
        if let Some(admin) = admin {
            let _ = tokio::time::timeout(Duration::from_secs(1), admin).await;
        }
        if let Some(follow) = follow {
            follow.abort();
        }
    }
}

impl Listening {
    async fn new(address: &str, door: Door) -> Result<Self, ServerError> {
        let failed = |source| ServerError::Listen {
            address: address.to_owned(),
            source,
        };
        let mut last = std::io::Error::other("no such address");
        for resolved in tokio::net::lookup_host(address).await.map_err(failed)? {
            match listen(resolved) {
                Ok(listener) => {
                    return Ok(Self {
                        address: listener.local_addr().map_err(failed)?,
                        listener,
                        door: Arc::new(door),
                    });
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }
}

fn listen(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() {
        TcpSocket::new_v4()?
    } else {
        TcpSocket::new_v6()?
    };
    // Connections of the process before may linger; they do not matter to us.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// Makes `ring` what TLS clients use, unless the program has chosen something else.
fn use_ring() {
    // An error means that there is a provider already.
    let _ = rustls::crypto::ring::default_provider().install_default();
}

/// Asks for the descriptors that `connections` need; says how many connections there can be.
#[cfg(unix)]
fn descriptors(connections: usize) -> usize {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let wanted = (connections as u64).saturating_add(OTHER_DESCRIPTORS);
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current.is_some_and(|current| current < wanted) {
        limit.current = Some(limit.maximum.map_or(wanted, |maximum| maximum.min(wanted)));
        if let Err(error) = setrlimit(Resource::Nofile, limit) {
            tracing::warn!(%error, "the limit on open files cannot be raised");
            limit = getrlimit(Resource::Nofile);
        }
    }
    let possible = limit.current.map_or(u64::MAX, |current| {
        current.saturating_sub(OTHER_DESCRIPTORS).max(64)
    });
    let possible = usize::try_from(possible).unwrap_or(usize::MAX);
    if possible < connections {
        tracing::warn!(
            connections = possible,
            wanted = connections,
            "the limit on open files allows fewer connections than configured"
        );
    }
    possible
}

#[cfg(not(unix))]
fn descriptors(connections: usize) -> usize {
    connections
}
