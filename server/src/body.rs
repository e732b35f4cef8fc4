//! Response bodies: bytes at hand, or read from an open file a chunk at a time.

use crate::accept::monitor::Guard;
use crate::source::{OpenFile, ReadError};
use axum::body::Body as AxumBody;
use futures_util::future::BoxFuture;
use hyper::body::{Body, Bytes, Frame, SizeHint};
use std::collections::VecDeque;
use std::io;
use std::ops::Range;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

/// Read at once: large enough that system calls cost little, small enough that a thousand slow clients hold 128 MiB.
const CHUNK_BYTES: u64 = 128 * 1024;

/// A piece of a body.
#[derive(Debug)]
pub(crate) enum Piece {
    /// These bytes.
    Literal(Bytes),
    /// This range of the file.
    Stored(Range<u64>),
}

impl Piece {
    fn length(&self) -> u64 {
        match self {
            Self::Literal(bytes) => bytes.len() as u64,
            Self::Stored(range) => range.end - range.start,
        }
    }
}

/// Pieces of one file, one after the other. Its length is known, so it is sent with `Content-Length`; a
/// read that fails half-way ends the connection.
pub(crate) struct FileBody {
    file: Arc<OpenFile>,
    pieces: VecDeque<Piece>,
    ready: Option<Bytes>,
    reading: Option<BoxFuture<'static, Result<Bytes, ReadError>>>,
    remaining: u64,
}

impl std::fmt::Debug for FileBody {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FileBody")
            .field("pieces", &self.pieces)
            .field("remaining", &self.remaining)
            .finish_non_exhaustive()
    }
}

impl FileBody {
    /// A body of `pieces`; their stored ranges lie inside `file`. Reads the first chunk, so that a source that fails
    /// at once is an error with a status of its own.
    pub(crate) async fn new(
        file: Arc<OpenFile>,
        pieces: impl IntoIterator<Item = Piece>,
    ) -> Result<Self, ReadError> {
        let pieces: VecDeque<_> = pieces.into_iter().collect();
        let remaining = pieces.iter().map(Piece::length).sum();
        let mut body = Self {
            file,
            pieces,
            ready: None,
            reading: None,
            remaining,
        };
        body.ready = match body.start() {
            Some(bytes) => Some(bytes?),
            None => match body.reading.take() {
                Some(reading) => Some(reading.await?),
                None => None,
            },
        };
        Ok(body)
    }

    /// The next chunk where it is at hand; else begins to read it.
    fn start(&mut self) -> Option<Result<Bytes, ReadError>> {
        let range = match self.pieces.pop_front()? {
            Piece::Literal(bytes) => return Some(Ok(bytes)),
            Piece::Stored(range) => range,
        };
        let end = (range.end)
            .min(range.start.saturating_add(CHUNK_BYTES))
            .min(self.file.convenient_end(range.start));
        if end < range.end {
            self.pieces.push_front(Piece::Stored(end..range.end));
        }
        let chunk = range.start..end;
        if let Some(result) = self.file.read_now(&chunk) {
            return Some(result);
        }
        let file = Arc::clone(&self.file);
        self.reading = Some(Box::pin(async move { file.read(chunk).await }));
        None
    }

    fn poll_chunk(&mut self, context: &mut Context<'_>) -> Poll<Option<Result<Bytes, ReadError>>> {
        if let Some(bytes) = self.ready.take() {
            return Poll::Ready(Some(Ok(bytes)));
        }
        if self.reading.is_none() {
            if self.remaining == 0 {
                return Poll::Ready(None);
            }
            if let Some(result) = self.start() {
                return Poll::Ready(Some(result));
            }
        }
        let Some(reading) = self.reading.as_mut() else {
            return Poll::Ready(None);
        };
        let result = std::task::ready!(reading.as_mut().poll(context));
        self.reading = None;
        Poll::Ready(Some(result))
    }
}

/// What a response is made of.
#[derive(Debug)]
pub(crate) enum Outgoing {
    /// Bytes at hand, until they are taken.
    Full(Option<Bytes>),
    /// Pieces of a file.
    File(Box<FileBody>),
    /// What a route of the router made.
    Other(AxumBody),
}

impl From<Bytes> for Outgoing {
    fn from(bytes: Bytes) -> Self {
        Self::Full((!bytes.is_empty()).then_some(bytes))
    }
}

/// A body, with the guard that tells the connection's monitor that it is under way.
#[derive(Debug)]
pub(crate) struct Watched {
    outgoing: Outgoing,
    guard: Option<Guard>,
}

impl Watched {
    pub(crate) fn new(outgoing: Outgoing, guard: Guard) -> Self {
        Self {
            outgoing,
            guard: Some(guard),
        }
    }
}

impl Body for Watched {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        let frame = match &mut self.outgoing {
            Outgoing::Full(bytes) => {
                return Poll::Ready(bytes.take().map(|bytes| Ok(Frame::data(bytes))));
            }
            Outgoing::Other(body) => {
                return Pin::new(body).poll_frame(context).map_err(io::Error::other);
            }
            Outgoing::File(body) => body.poll_chunk(context).map(|chunk| match chunk {
                None => None,
                Some(Ok(bytes)) => {
                    body.remaining -= bytes.len() as u64;
                    Some(Ok(Frame::data(bytes)))
                }
                Some(Err(error)) => {
                    tracing::warn!(%error, "response cut short");
                    Some(Err(io::Error::other(error)))
                }
            }),
        };
        if let Some(guard) = &mut self.guard {
            guard.set_waiting(frame.is_pending());
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        match &self.outgoing {
            Outgoing::Full(bytes) => bytes.is_none(),
            Outgoing::File(body) => body.remaining == 0,
            Outgoing::Other(body) => body.is_end_stream(),
        }
    }

    fn size_hint(&self) -> SizeHint {
        match &self.outgoing {
            Outgoing::Full(bytes) => {
                SizeHint::with_exact(bytes.as_ref().map_or(0, |bytes| bytes.len() as u64))
            }
            Outgoing::File(body) => SizeHint::with_exact(body.remaining),
            Outgoing::Other(body) => body.size_hint(),
        }
    }
}
