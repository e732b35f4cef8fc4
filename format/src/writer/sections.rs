//! Which sections a file has, and writing them.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "sums of sizes in memory fit 64 bits, and sections are few"
)]

use crate::Error;
use crate::header::{
    ATLAS_SECTIONS, CLUSTER_SECTIONS, Header, MINOR, MUST_UNDERSTAND, Section, SectionKind,
    checksum,
};

/// Order of the sections of a file with clusters: their graph in the front, their pages after the atlas's.
const SECTIONS_WITH_CLUSTERS: [SectionKind; 8] = [
    SectionKind::Metadata,
    SectionKind::Directory,
    SectionKind::Charts,
    CLUSTER_SECTIONS[0],
    SectionKind::Base,
    SectionKind::IndexBlocks,
    SectionKind::Pages,
    CLUSTER_SECTIONS[1],
];

/// The sections of a file, in order.
pub(super) fn kinds_of(
    has_clusters: bool,
    has_colour_tiles: bool,
    has_thumbnail: bool,
) -> Vec<SectionKind> {
    let mut kinds = if has_clusters {
        SECTIONS_WITH_CLUSTERS.to_vec()
    } else {
        ATLAS_SECTIONS.to_vec()
    };
    if has_colour_tiles {
        kinds.extend([SectionKind::ColourDirectory, SectionKind::ColourTiles]);
    }
    // Last, so that nobody reads it who wants the model.
    if has_thumbnail {
        kinds.push(SectionKind::Thumbnail);
    }
    kinds
}

/// Writes header, table and `bodies` to `out`; the length of the file.
pub(super) fn put(
    content_id: [u8; 16],
    front_length: u64,
    bodies: &[(SectionKind, &[u8])],
    out: &mut dyn std::io::Write,
) -> Result<u64, Error> {
    let mut end = Header::encoded_length(bodies.len() as u32);
    let mut sections = Vec::new();
    for &(kind, body) in bodies {
        let range = end..end + body.len() as u64;
        end = range.end;
        let checksum = checksum(&content_id, body);
        sections.push(Section {
            kind: kind as u32,
            flags: if matches!(
                kind,
                SectionKind::ColourDirectory | SectionKind::ColourTiles | SectionKind::Thumbnail
            ) {
                0
            } else {
                MUST_UNDERSTAND
            },
            range,
            checksum,
        });
    }
    let header = Header {
        minor: MINOR,
        file_length: end,
        content_id,
        front_length,
        sections,
    };
    out.write_all(&header.encode()).map_err(Error::Output)?;
    for (_, body) in bodies {
        out.write_all(body).map_err(Error::Output)?;
    }
    Ok(end)
}
