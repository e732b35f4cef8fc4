//! Opening a `.marq` file, on disk or behind a URL, with messages that say what to do.

use anyhow::Context;
use marquetry_format::{ByteSource, Document, Error, Limits};

/// A file and where its bytes come from.
pub(super) struct Opened {
    pub(super) source: Box<dyn ByteSource>,
    pub(super) document: Document,
}

/// Opens `file`, a path or an `http(s)://` URL, and reads its front.
pub(super) fn open(file: &str) -> anyhow::Result<Opened> {
    let source = source(file)?;
    let document = Document::open(source.as_ref(), Limits::default())
        .map_err(|error| explain(file, &error))?;
    Ok(Opened { source, document })
}

/// Opens `file` and reads its whole index.
pub(super) fn open_indexed(file: &str) -> anyhow::Result<Opened> {
    let mut opened = open(file)?;
    opened
        .document
        .load_index(opened.source.as_ref())
        .map_err(|error| explain(file, &error))?;
    Ok(opened)
}

/// The bytes of `file`, a path or a URL.
pub(super) fn source(file: &str) -> anyhow::Result<Box<dyn ByteSource>> {
    marquetry_native::source::open(file).with_context(|| format!("{file}: cannot be opened"))
}

/// Names the file, and says what can be done.
pub(super) fn explain(file: &str, error: &Error) -> anyhow::Error {
    let advice = match error {
        Error::NotMarq { .. } => "; `marquetry convert` makes one of a scan",
        Error::Truncated { .. }
        | Error::TrailingBytes { .. }
        | Error::Checksum { .. }
        | Error::Compression { .. } => {
            "; copy or download the file again, or convert its input again"
        }
        Error::UnsupportedVersion { .. } | Error::UnknownSection { .. } => {
            "; use the version of marquetry that wrote it, or convert its input again"
        }
        _ => "",
    };
    anyhow::anyhow!("{file}: {error}{advice}")
}
