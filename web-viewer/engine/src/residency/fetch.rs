//! What to fetch, in which order, and what to do when it fails.

use marquetry_format::PageId;
use std::ops::Range;

/// Names a [`Request`] until it is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RequestId(pub u64);

/// What a request is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestKind {
    /// One block of the index; to be had as a byte range only.
    IndexBlock(u32),
    /// The pages `first..=last`, side by side in the file: as a byte range, or as `/pages/NAME/CID/FIRST-LAST`.
    Pages {
        /// First page.
        first: PageId,
        /// Last page, included.
        last: PageId,
    },
}

/// Bytes that the engine wants. Answer with [`Viewer::deliver`](crate::Viewer::deliver), exactly once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// To answer with.
    pub id: RequestId,
    /// What is asked for.
    pub kind: RequestKind,
    /// The same as bytes of the file; never empty.
    pub range: Range<u64>,
}
