//! Checks of the stored bytes, whatever they mean.

use super::in_words;
use crate::cluster::directory::content_of;
use crate::header::{SectionKind, seed};
use crate::index::block::facts_of;
use crate::reader::FIRST_IMAGE_BYTES;
use crate::rules::Tally;
use crate::{ByteSource, ColourIndex, Document, Error, Limits, colour};
use std::ops::Range;
use xxhash_rust::xxh3::Xxh3;

/// Bytes read at a time.
const CHUNK_BYTES: u64 = 1 << 23;

/// Only a file whose coarsest base is too large may have a front above the first image's bytes.
pub(super) fn check_front(document: &Document) -> Tally {
    let mut tally = Tally::default();
    let bytes = document.front_bytes();
    tally.check(
        bytes <= FIRST_IMAGE_BYTES || document.base_resolution == 0,
        || {
            let k = document.base_resolution;
            format!("the base at resolution {k} ends at byte {bytes}, past {FIRST_IMAGE_BYTES}")
        },
    );
    tally
}

fn for_each_chunk(
    source: &dyn ByteSource,
    range: Range<u64>,
    mut take: impl FnMut(&[u8]),
) -> Result<(), Error> {
    let mut start = range.start;
    while start < range.end {
        let end = start.saturating_add(CHUNK_BYTES).min(range.end);
        take(&source.read(start..end)?);
        start = end;
    }
    Ok(())
}

/// Every section has the checksum that the table states.
pub(super) fn check_sections(document: &Document, source: &dyn ByteSource) -> Tally {
    let mut tally = Tally::default();
    for (index, section) in document.header().sections.iter().enumerate() {
        let mut hasher = Xxh3::with_seed(seed(&document.content_id));
        let computed = for_each_chunk(source, section.range.clone(), |chunk| hasher.update(chunk))
            .and_then(|()| {
                let (stored, computed) = (section.checksum, hasher.digest());
                if stored == computed {
                    return Ok(());
                }
                Err(Error::Checksum {
                    what: "section",
                    offset: section.range.start,
                    stored,
                    computed,
                })
            });
        tally.check(computed.is_ok(), || {
            format!(
                "section {index} (type {}): {}",
                section.kind,
                in_words(computed)
            )
        });
    }
    tally
}

/// The content id is that of the content.
pub(super) fn check_content_id(document: &Document, source: &dyn ByteSource) -> Tally {
    let mut tally = Tally::default();
    let computed = compute_content_id(document, source);
    let equal = matches!(&computed, Ok(id) if *id == document.content_id);
    tally.check(equal, || match computed {
        Ok(id) => format!("{:02x?} stored, {id:02x?} computed", document.content_id),
        Err(error) => error.to_string(),
    });
    tally
}

fn compute_content_id(document: &Document, source: &dyn ByteSource) -> Result<[u8; 16], Error> {
    let mut hasher = blake3::Hasher::new();
    let range = |kind| {
        document
            .header()
            .section(kind)
            .map(|section| section.range.clone())
    };
    let mut add = |range: Range<u64>| {
        for_each_chunk(source, range, |chunk| {
            hasher.update(chunk);
        })
    };
    for kind in [
        SectionKind::Metadata,
        SectionKind::Charts,
        SectionKind::Base,
    ] {
        add(range(kind)?)?;
    }
    for block in 0..document.index_block_count() {
        let bytes = source.read(document.index_block_range(block))?;
        hasher.update(facts_of(document.index_block_pages(block).len(), &bytes));
    }
    for_each_chunk(source, range(SectionKind::Pages)?, |chunk| {
        hasher.update(chunk);
    })?;
    if document.clusters.is_some() {
        let tree = source.read(range(SectionKind::Clusters)?)?;
        for part in content_of(&tree) {
            hasher.update(part);
        }
        for_each_chunk(source, range(SectionKind::ClusterPages)?, |chunk| {
            hasher.update(chunk);
        })?;
    }
    if let Some(mut index) = ColourIndex::of(document, Limits::default())? {
        let directory = source.read(index.directory_range())?;
        index.load_directory(&directory)?;
        for part in colour::content_of(&directory) {
            hasher.update(part);
        }
        let mut end = range(SectionKind::ColourTiles)?.start;
        for block in 0..index.block_count() {
            let bytes = source.read(index.block_range(block))?;
            hasher.update(colour::facts_of(index.block_tiles(block).len(), &bytes));
            end = index.block_range(block).end;
        }
        for_each_chunk(source, end..range(SectionKind::ColourTiles)?.end, |chunk| {
            hasher.update(chunk);
        })?;
    }
    if let Ok(section) = document.header().section(SectionKind::Thumbnail) {
        for_each_chunk(source, section.range.clone(), |chunk| {
            hasher.update(chunk);
        })?;
    }
    let mut id = [0; 16];
    hasher.finalize_xof().fill(&mut id);
    Ok(id)
}
