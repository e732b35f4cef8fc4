//! From the first bytes to a document, in at most two reads.

use super::document::Document;
use crate::chart::decode_charts;
use crate::cluster::{Clusters, directory as cluster_directory};
use crate::codec::page::{Coding, base_count, decode_base};
use crate::header::{Header, Section, SectionKind, check};
use crate::index::directory::Directory;
use crate::{Error, Limits, Metadata};
use std::ops::Range;

/// Bytes of the first read of a file.
pub const FIRST_READ_BYTES: u64 = 64 * 1024;
/// Bytes that everything up to the base should fit, so that a first image takes few bytes.
pub const FIRST_IMAGE_BYTES: u64 = 256 * 1024;

/// Decoded bytes that the base takes a sample, colours included.
const BASE_SAMPLE_BYTES: u64 = 14;

/// A file being opened.
#[derive(Debug)]
pub struct Opening {
    limits: Limits,
    /// Once the first read has come: the header and all bytes so far.
    first: Option<(Header, Vec<u8>)>,
}

/// What an [`Opening`] wants next.
#[derive(Debug)]
pub enum Step {
    /// Feed these bytes.
    Need(Opening, Range<u64>),
    /// Open.
    Done(Box<Document>),
}

impl Opening {
    /// Starts; the first read is bytes `0..min(FIRST_READ_BYTES, length)`; a shorter answer means a short file.
    pub fn new(limits: Limits) -> (Self, Range<u64>) {
        (
            Self {
                limits,
                first: None,
            },
            0..FIRST_READ_BYTES,
        )
    }

    /// Length of the whole file, once the first read has come.
    pub fn file_length(&self) -> Option<u64> {
        self.first.as_ref().map(|(header, _)| header.file_length)
    }

    /// Takes the bytes asked for. At most two reads in all.
    ///
    /// # Errors
    /// When the bytes are no valid front of a `.marq` file.
    pub fn feed(self, bytes: &[u8]) -> Result<Step, Error> {
        let found = bytes.len() as u64;
        let (header, front) = match self.first {
            None => {
                let header = Header::parse(bytes)?;
                check_limits(&header, &self.limits)?;
                let expected = header.file_length.min(FIRST_READ_BYTES);
                if found < expected {
                    return Err(Error::Truncated {
                        what: "file",
                        expected,
                        found,
                    });
                }
                if found > header.file_length {
                    return Err(Error::TrailingBytes {
                        what: "file",
                        expected: header.file_length,
                        found,
                    });
                }
                if found < header.front_length {
                    let need = found..header.front_length;
                    let first = Some((header, bytes.to_vec()));
                    return Ok(Step::Need(
                        Self {
                            limits: self.limits,
                            first,
                        },
                        need,
                    ));
                }
                (header, bytes.to_vec())
            }
            Some((header, mut front)) => {
                let expected = header.front_length.saturating_sub(front.len() as u64);
                if found < expected {
                    return Err(Error::Truncated {
                        what: "front",
                        expected,
                        found,
                    });
                }
                if found > expected {
                    return Err(Error::TrailingBytes {
                        what: "front",
                        expected,
                        found,
                    });
                }
                front.extend_from_slice(bytes);
                (header, front)
            }
        };
        let document = document_of(header, &front, self.limits)?;
        Ok(Step::Done(Box::new(document)))
    }
}

fn check_limits(header: &Header, limits: &Limits) -> Result<(), Error> {
    for section in &header.sections {
        let limit = if section.kind == SectionKind::Metadata as u32 {
            limits.metadata_bytes
        } else if section.range.end <= header.front_length {
            limits.section_bytes
        } else {
            continue;
        };
        if section.length() > limit {
            return Err(Error::Limit {
                what: "bytes of a section",
                limit,
                found: section.length(),
            });
        }
    }
    Ok(())
}

/// The bytes of `section`, which lies in the front, checked.
fn section_bytes<'a>(
    what: &'static str,
    header: &Header,
    section: &Section,
    front: &'a [u8],
) -> Result<&'a [u8], Error> {
    let Range { start, end } = section.range;
    let bounds = usize::try_from(start).ok().zip(usize::try_from(end).ok());
    let Some(bytes) = bounds.and_then(|(start, end)| front.get(start..end)) else {
        return Err(Error::Truncated {
            what,
            expected: end,
            found: front.len() as u64,
        });
    };
    check(what, start, &header.content_id, bytes, section.checksum)?;
    Ok(bytes)
}

fn document_of(header: Header, front: &[u8], limits: Limits) -> Result<Document, Error> {
    let atlas = SectionKind::Base as u32;
    for section in header
        .sections
        .iter()
        .filter(|section| section.range.end <= header.front_length)
    {
        if section.kind > atlas && section.kind != SectionKind::Clusters as u32 {
            section_bytes("an additional section", &header, section, front)?;
        }
    }
    let bytes = |what, kind| section_bytes(what, &header, header.section(kind)?, front);
    let metadata = Metadata::decode(bytes("metadata", SectionKind::Metadata)?, &limits)?;
    let (charts, base_resolution) = decode_charts(bytes("charts", SectionKind::Charts)?, &limits)?;
    let directory = Directory::parse(
        bytes("directory", SectionKind::Directory)?,
        header.section(SectionKind::IndexBlocks)?,
        header.section(SectionKind::Pages)?,
        u32::try_from(charts.len()).unwrap_or(u32::MAX),
        &limits,
    )?;
    let resolutions: Vec<u8> = charts.iter().map(|chart| chart.resolution).collect();
    let decoded =
        (base_count(&resolutions, base_resolution) as u64).saturating_mul(BASE_SAMPLE_BYTES);
    if decoded > limits.section_bytes {
        return Err(Error::Limit {
            what: "base",
            limit: limits.section_bytes,
            found: decoded,
        });
    }
    let coding = Coding {
        shift: metadata.lattice.shift,
        has_colours: metadata.has_colours,
    };
    let clusters = clusters_of(&header, front, coding, &limits)?;
    if charts.is_empty() && clusters.is_none() {
        return Err(Error::Value {
            what: "number of charts",
            found: 0,
        });
    }
    let base_bytes = bytes("base", SectionKind::Base)?;
    let base = decode_base(coding, &resolutions, base_resolution, base_bytes)?;
    let base_parts = crate::codec::payload::parts("base", coding.has_colours, base_bytes)?;
    Ok(Document::new(
        header,
        limits,
        directory,
        base_parts,
        metadata,
        charts,
        resolutions,
        base_resolution,
        base,
        clusters,
    ))
}

/// The clusters, if the file has any.
fn clusters_of(
    header: &Header,
    front: &[u8],
    coding: Coding,
    limits: &Limits,
) -> Result<Option<Clusters>, Error> {
    let Ok(own) = header.section(SectionKind::Clusters) else {
        return Ok(None);
    };
    let pages = header.section(SectionKind::ClusterPages)?;
    let bytes = section_bytes("clusters", header, own, front)?;
    let id = &header.content_id;
    cluster_directory::decode(coding, bytes, own, pages, id, limits).map(Some)
}
