//! Checks of the picture of the model.

use super::{Report, in_words};
use crate::header::{Section, SectionKind};
use crate::rules::Tally;
use crate::thumbnail::{MAX_BYTES, decode};
use crate::{ByteSource, Document, Error};

/// Adds that there is at most one, that it is no part of the front, and that it decodes; nothing where there is none.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let is_picture = |section: &&Section| section.kind == SectionKind::Thumbnail as u32;
    let mut pictures = document.header().sections.iter().filter(is_picture);
    let Some(section) = pictures.next() else {
        return;
    };
    let mut tally = Tally::default();
    let range = section.range.clone();
    // One byte too many is enough to be refused.
    let end = range
        .end
        .min(range.start.saturating_add(MAX_BYTES).saturating_add(1));
    let decoded = source
        .read(range.start..end)
        .map_err(Error::from)
        .and_then(|bytes| decode(&bytes));
    tally.check(decoded.is_ok(), || in_words(decoded));
    tally.check(range.start >= document.front_bytes(), || {
        "it lies in the front, which every viewer reads".to_owned()
    });
    tally.check(pictures.next().is_none(), || {
        "there is more than one".to_owned()
    });
    report.add("thumbnail", tally);
}
