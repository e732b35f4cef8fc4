//! A response body read from an open file, a chunk at a time.

use crate::source::OpenFile;
use hyper::body::{Body, Bytes, Frame, SizeHint};
use marquetry_format::SourceError;
use std::collections::VecDeque;
use std::io;
use std::ops::Range;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::task::JoinHandle;

/// Read at once: large enough that the hop to a blocking thread costs little, small enough that a
/// thousand slow clients hold 256 MiB.
const CHUNK_BYTES: u64 = 256 * 1024;

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
#[derive(Debug)]
pub(crate) struct FileBody {
    file: Arc<OpenFile>,
    pieces: VecDeque<Piece>,
    reading: Option<JoinHandle<Result<Vec<u8>, SourceError>>>,
    remaining: u64,
}

impl FileBody {
    /// A body of `pieces`; their stored ranges lie inside `file`.
    pub(crate) fn new(file: Arc<OpenFile>, pieces: impl IntoIterator<Item = Piece>) -> Self {
        let pieces: VecDeque<_> = pieces.into_iter().collect();
        let remaining = pieces.iter().map(Piece::length).sum();
        Self {
            file,
            pieces,
            reading: None,
            remaining,
        }
    }

    /// Starts reading the next chunk, or gives the next literal.
    fn advance(&mut self) -> Option<Bytes> {
        match self.pieces.pop_front()? {
            Piece::Literal(bytes) => return Some(bytes),
            Piece::Stored(range) => {
                let end = range.end.min(range.start.saturating_add(CHUNK_BYTES));
                if end < range.end {
                    self.pieces.push_front(Piece::Stored(end..range.end));
                }
                let file = Arc::clone(&self.file);
                let read = move || file.read(range.start..end);
                self.reading = Some(tokio::task::spawn_blocking(read));
            }
        }
        None
    }
}

impl Body for FileBody {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        if self.reading.is_none() {
            if self.remaining == 0 {
                return Poll::Ready(None);
            }
            if let Some(literal) = self.advance() {
                self.remaining -= literal.len() as u64;
                return Poll::Ready(Some(Ok(Frame::data(literal))));
            }
        }
        let Some(reading) = self.reading.as_mut() else {
            return Poll::Ready(None);
        };
        let outcome = std::task::ready!(Pin::new(reading).poll(context));
        self.reading = None;
        let result = match outcome {
            Ok(Ok(bytes)) => {
                self.remaining -= bytes.len() as u64;
                Ok(Frame::data(Bytes::from(bytes)))
            }
            Ok(Err(error)) => Err(io::Error::other(error)),
            Err(error) => Err(io::Error::other(error)),
        };
        if let Err(error) = &result {
            tracing::warn!(%error, "response cut short");
        }
        Poll::Ready(Some(result))
    }

    fn is_end_stream(&self) -> bool {
        self.remaining == 0
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.remaining)
    }
}
