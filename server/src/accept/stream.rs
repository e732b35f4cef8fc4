//! A client's socket that tells its monitor what it does, and can give back what was read of it.

use super::monitor::Monitor;
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;

/// What every HTTP/2 connection begins with (RFC 9113, section 3.4).
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// A watched socket.
#[derive(Debug)]
pub(super) struct Stream {
    socket: TcpStream,
    monitor: Arc<Monitor>,
    /// Read already, but not yet by the protocol; where in it the next read begins.
    seen: ([u8; PREFACE.len()], u8, u8),
}

impl Stream {
    pub(super) fn new(socket: TcpStream, monitor: Arc<Monitor>) -> Self {
        Self {
            socket,
            monitor,
            seen: ([0; PREFACE.len()], 0, 0),
        }
    }

    /// Reads until it is plain whether the client speaks HTTP/2 from the start. What was read is read again.
    pub(super) async fn speaks_http2(&mut self) -> io::Result<bool> {
        let mut length = 0;
        while length < PREFACE.len() {
            let read = self.socket.read(&mut self.seen.0[length..]).await?;
            self.monitor.heard();
            length += read;
            self.seen.1 = u8::try_from(length).unwrap_or(u8::MAX);
            if read == 0 || self.seen.0[..length] != PREFACE[..length] {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        if self.monitor.is_aborted() {
            // Without this the kernel would keep what was not taken, and try for minutes to deliver it.
            let _ = socket2::SockRef::from(&self.socket).set_linger(Some(Duration::ZERO));
        }
    }
}

impl AsyncRead for Stream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let (bytes, end, begin) = self.seen;
        if begin < end {
            let rest = &bytes[usize::from(begin)..usize::from(end)];
            let count = rest.len().min(buffer.remaining());
            buffer.put_slice(&rest[..count]);
            self.seen.2 += u8::try_from(count).unwrap_or(u8::MAX);
            return Poll::Ready(Ok(()));
        }
        let before = buffer.filled().len();
        let result = Pin::new(&mut self.socket).poll_read(context, buffer);
        if buffer.filled().len() > before {
            self.monitor.heard();
        }
        result
    }
}

impl Stream {
    fn wrote(&self, result: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        match &result {
            Poll::Ready(Ok(bytes)) => self.monitor.sent(*bytes),
            Poll::Ready(Err(_)) => {}
            Poll::Pending => self.monitor.blocked(),
        }
        result
    }
}

impl AsyncWrite for Stream {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.socket).poll_write(context, bytes);
        self.wrote(result)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.socket).poll_write_vectored(context, slices);
        self.wrote(result)
    }

    fn is_write_vectored(&self) -> bool {
        self.socket.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_shutdown(context)
    }
}
