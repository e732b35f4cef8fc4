//! The accept loop: connections, their deadlines and their number, and an orderly end.
//!
//! `axum::serve` lets a client hold a half-sent header, or a response it does not read, for ever; so
//! connections are driven here, HTTP/1.1 and HTTP/2, with TLS and without. A connection ends when a deadline of its
//! [`Monitor`] passes or when the server stops. An address has so many connections and no more.

pub(crate) mod monitor;
mod stream;
pub(crate) mod tls;
pub(crate) mod workers;

use crate::config::ConnectionLimits;
use crate::limits::{Connections, Slot};
use crate::metrics::Metrics;
use crate::service::{Client, Service};
use hyper::server::conn::{http1, http2};
use hyper::service::service_fn;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use monitor::{Monitor, Overdue};
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use stream::Stream;
use tls::Tls;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use workers::Workers;

/// Pause after a failed accept, mostly for want of file descriptors: others may be freed meanwhile.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// Bytes of a request's header, the request line included. Larger: 431.
const HEADER_BYTES: usize = 16 * 1024;
/// Fields of a header.
const HEADER_FIELDS: usize = 64;
/// Requests under way on one HTTP/2 connection.
const STREAMS: u32 = 128;
/// Bytes of one HTTP/2 stream that wait for the client to take them.
const STREAM_BUFFER_BYTES: usize = 128 * 1024;
/// Bytes that wait in the kernel unsent: fewer show sooner that a client is slow, and take less memory.
const UNSENT_BYTES: u32 = 256 * 1024;
/// Silence on an HTTP/2 connection after which the client is asked whether it is there.
const PING_INTERVAL: Duration = Duration::from_secs(20);

/// Everything that connections share.
#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) limits: ConnectionLimits,
    pub(crate) tls: Option<Arc<Tls>>,
    pub(crate) service: Arc<Service>,
    pub(crate) connections: Arc<Connections>,
}

/// Accepts and serves connections until `stopping` says so, then drains them.
pub(crate) async fn serve(
    listener: TcpListener,
    door: Arc<Door>,
    workers: Arc<Workers>,
    mut stopping: watch::Receiver<bool>,
) {
    let slots = Arc::new(Semaphore::new(door.limits.open));
    let (stop, stopped) = watch::channel(false);
    let mut connections = JoinSet::new();
    loop {
        let next = tokio::select! {
            _ = stopping.wait_for(|&stop| stop) => break,
            Some(_) = connections.join_next() => continue,
            next = accept(&listener, &slots) => next,
        };
        match next {
            Ok((socket, address, slot)) => {
                let Some(place) = door.enter(address) else {
                    door.metrics().refused_connections.add();
                    tracing::debug!(%address, "too many connections of one address");
                    continue;
                };
                let (door, stopped) = (Arc::clone(&door), stopped.clone());
                let (worker, seat) = workers.seat();
                let served = async move {
                    door.metrics().connections.begin();
                    match TcpStream::from_std(socket) {
                        Ok(socket) => connection(socket, address, &door, stopped).await,
                        Err(error) => tracing::warn!(%error, "a connection could not be served"),
                    }
                    door.metrics().connections.end();
                    drop((slot, place, seat));
                };
                connections.spawn_on(served, worker);
            }
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(ACCEPT_PAUSE).await;
            }
        }
    }
    drop(listener);
    stop.send_replace(true);
    let drained = async { while connections.join_next().await.is_some() {} };
    if tokio::time::timeout(door.limits.drain, drained)
        .await
        .is_err()
    {
        tracing::warn!(count = connections.len(), "connections still busy were cut");
    }
}

impl Door {
    fn metrics(&self) -> &Metrics {
        self.service.metrics()
    }

    fn enter(&self, address: SocketAddr) -> Option<Slot> {
        let limit = if self.service.trusts(address.ip()) {
            0
        } else {
            self.limits.per_address
        };
        self.connections.enter(address.ip(), limit)
    }
}

/// Waits for a free slot, then for a connection. Safe to cancel.
async fn accept(
    listener: &TcpListener,
    slots: &Arc<Semaphore>,
) -> std::io::Result<(std::net::TcpStream, SocketAddr, OwnedSemaphorePermit)> {
    let slot = Arc::clone(slots)
        .acquire_owned()
        .await
        .map_err(std::io::Error::other)?;
    let (socket, address) = listener.accept().await?;
    // To be watched by its worker, not here.
    Ok((socket.into_std()?, address, slot))
}

/// Serves one connection to its end.
async fn connection(
    socket: TcpStream,
    address: SocketAddr,
    door: &Arc<Door>,
    stopped: watch::Receiver<bool>,
) {
    // Pages are small: waiting to fill a segment costs a round trip each. Failing only costs speed.
    let _ = socket.set_nodelay(true);
    #[cfg(target_os = "linux")]
    let _ = socket2::SockRef::from(&socket).set_tcp_notsent_lowat(UNSENT_BYTES);
    let monitor = Arc::new(Monitor::new());
    let client = Client {
        address,
        secure: door.tls.is_some(),
        monitor: Arc::clone(&monitor),
    };
    let stream = Stream::new(socket, Arc::clone(&monitor));
    let overdue = async {
        let why = monitor.overdue(&door.limits).await;
        // Here, since the conversation is dropped before the branch below runs.
        if matches!(why, Overdue::Stall | Overdue::Response) {
            monitor.abort();
        }
        why
    };
    let outcome = tokio::select! {
        outcome = converse(stream, client, door, stopped) => outcome,
        why = overdue => {
            door.metrics().cut(why);
            tracing::debug!(%address, why = why.name(), "connection cut");
            Ok(())
        }
    };
    door.metrics().bytes_sent.add_many(monitor.bytes_sent());
    if let Err(error) = outcome {
        tracing::debug!(%address, %error, "connection ended early");
    }
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Finds out which protocol is spoken, and speaks it.
async fn converse(
    mut stream: Stream,
    client: Client,
    door: &Arc<Door>,
    mut stopped: watch::Receiver<bool>,
) -> Result<(), Failure> {
    let greeting = async {
        let Some(tls) = &door.tls else {
            let http2 = stream.speaks_http2().await?;
            return Ok::<_, std::io::Error>((Err(stream), http2));
        };
        let stream = tls.acceptor().accept(stream).await?;
        let http2 = stream.get_ref().1.alpn_protocol() == Some(b"h2");
        Ok((Ok(Box::new(stream)), http2))
    };
    let (stream, http2) = tokio::select! {
        greeting = greeting => greeting?,
        // Nothing was asked yet.
        _ = stopped.wait_for(|&stop| stop) => return Ok(()),
    };
    if http2 {
        client.monitor.speaks_http2();
    }
    match (stream, http2) {
        (Ok(stream), true) => speak_http2(stream, client, door, stopped).await,
        (Err(stream), true) => speak_http2(stream, client, door, stopped).await,
        (Ok(stream), false) => speak_http1(stream, client, door, stopped).await,
        (Err(stream), false) => speak_http1(stream, client, door, stopped).await,
    }
}

async fn speak_http1(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send,
    client: Client,
    door: &Arc<Door>,
    mut stopped: watch::Receiver<bool>,
) -> Result<(), Failure> {
    let service = Arc::clone(&door.service);
    let answer = service_fn(move |request| {
        let (service, client) = (Arc::clone(&service), client.clone());
        async move { Ok::<_, std::convert::Infallible>(service.answer(request, &client).await) }
    });
    let mut connection = pin!(
        http1::Builder::new()
            // The monitor has the deadlines: one timer a connection, not one a request.
            .header_read_timeout(None)
            .max_buf_size(HEADER_BYTES)
            .max_headers(HEADER_FIELDS)
            .serve_connection(TokioIo::new(stream), answer)
    );
    tokio::select! {
        result = &mut connection => return Ok(result?),
        _ = stopped.wait_for(|&stop| stop) => connection.as_mut().graceful_shutdown(),
    }
    Ok(connection.await?)
}

async fn speak_http2(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send,
    client: Client,
    door: &Arc<Door>,
    mut stopped: watch::Receiver<bool>,
) -> Result<(), Failure> {
    let service = Arc::clone(&door.service);
    let answer = service_fn(move |request| {
        let (service, client) = (Arc::clone(&service), client.clone());
        async move { Ok::<_, std::convert::Infallible>(service.answer(request, &client).await) }
    });
    let mut connection = pin!(
        http2::Builder::new(TokioExecutor::new())
            .timer(TokioTimer::new())
            .max_concurrent_streams(STREAMS)
            .max_header_list_size(u32::try_from(HEADER_BYTES).unwrap_or(u32::MAX))
            .max_send_buf_size(STREAM_BUFFER_BYTES)
            .keep_alive_interval(PING_INTERVAL)
            .keep_alive_timeout(door.limits.write_stall)
            .serve_connection(TokioIo::new(stream), answer)
    );
    tokio::select! {
        result = &mut connection => return Ok(result?),
        _ = stopped.wait_for(|&stop| stop) => connection.as_mut().graceful_shutdown(),
    }
    Ok(connection.await?)
}
