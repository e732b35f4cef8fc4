//! What can be wrong with a file, or with what was asked of it.

use crate::source::SourceError;

/// A file that cannot be read or written, and why.
///
/// `what` names the part of the file; offsets count bytes from the start of the file, lengths are bytes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The output of the writer failed.
    #[error("cannot write: {0}")]
    Output(#[source] std::io::Error),
    /// The first bytes are not those of a `.marq` file.
    #[error("not a .marq file: it starts with {found:02x?}")]
    NotMarq {
        /// The bytes in place of the magic; fewer when the file is shorter.
        found: Vec<u8>,
    },
    /// The file was written for another major version of the format.
    #[error(
        "format version {major}.{minor} is not supported, this reader knows {}.x",
        crate::header::MAJOR
    )]
    UnsupportedVersion {
        /// Major version of the file.
        major: u16,
        /// Minor version of the file.
        minor: u16,
    },
    /// Something ends early.
    #[error("{what} is cut short: {expected} bytes expected, {found} found")]
    Truncated {
        /// The part.
        what: &'static str,
        /// Bytes that should be there.
        expected: u64,
        /// Bytes that are.
        found: u64,
    },
    /// Something goes on after its end.
    #[error("{what} has bytes after its end: {expected} bytes expected, {found} found")]
    TrailingBytes {
        /// The part.
        what: &'static str,
        /// Bytes that should be there.
        expected: u64,
        /// Bytes that are.
        found: u64,
    },
    /// Stored and computed checksums differ: the bytes were damaged.
    #[error(
        "{what} at byte {offset} is damaged: checksum {stored:#018x} stored, {computed:#018x} computed"
    )]
    Checksum {
        /// The part.
        what: &'static str,
        /// Where it starts.
        offset: u64,
        /// Checksum in the file.
        stored: u64,
        /// Checksum of the bytes read.
        computed: u64,
    },
    /// Reserved bits are set.
    #[error("reserved bits of {what} are set: {value:#x}")]
    Reserved {
        /// The field.
        what: &'static str,
        /// Its value.
        value: u64,
    },
    /// A section that a reader must understand, and this one does not.
    #[error("section {index} has type {kind}, which must be understood and is not")]
    UnknownSection {
        /// Place in the section table.
        index: u32,
        /// Its type.
        kind: u32,
    },
    /// The section table is not well formed.
    #[error("section {index} (type {kind}) {fault}")]
    Section {
        /// Place in the section table.
        index: u32,
        /// Its type.
        kind: u32,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// A section that every file has is missing.
    #[error("there is no section of type {kind}")]
    MissingSection {
        /// The type.
        kind: u32,
    },
    /// The file asks for more than the reader's [`Limits`](crate::Limits).
    #[error("{what}: {found} is above the limit of {limit}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// What the file asks for.
        found: u64,
    },
    /// A compressed stream is not valid.
    #[error("{what} does not decompress: {reason}")]
    Compression {
        /// The part.
        what: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// A value outside its range.
    #[error("{what}: {found} is not allowed")]
    Value {
        /// The field.
        what: &'static str,
        /// Its value.
        found: u64,
    },
    /// Two statements of the file contradict each other.
    #[error("{what}: {expected} expected, {found} found")]
    Mismatch {
        /// What is stated twice.
        what: &'static str,
        /// By the first statement.
        expected: u64,
        /// By the second.
        found: u64,
    },
    /// The metadata does not decode.
    #[error("metadata: {0}")]
    Metadata(String),
    /// An index block must be loaded first; the caller's mistake.
    #[error("index block {block} is not loaded")]
    IndexNotLoaded {
        /// The block.
        block: u32,
    },
    /// There is no such page, block or chart; the caller's mistake.
    #[error("there is no {what} {number}")]
    NoSuch {
        /// Page, index block or chart.
        what: &'static str,
        /// The number asked for.
        number: u32,
    },
    /// The parent handed to the decoder is not a full page; the caller's mistake.
    #[error("the parent of page {page} was given at resolution {resolution}, not as a full page")]
    WrongParent {
        /// The page to decode.
        page: u32,
        /// Resolution of what was given.
        resolution: u8,
    },
    /// What the writer was given breaks a rule of the format.
    #[error("cannot be written: {rule}: {detail}")]
    Input {
        /// The rule.
        rule: &'static str,
        /// Where and how it is broken.
        detail: String,
    },
}
