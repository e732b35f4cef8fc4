//! Header and section table: the first bytes of a file.
//!
//! Sections lie one after the other without gaps, in table order, from the end of the table to the end of
//! the file, so every byte belongs to something that is checksummed.

use crate::Error;
use crate::bytes::Cursor;
use std::ops::Range;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// First bytes of every file. As PNG's: a byte above 127, CR LF and Control-Z show a transfer as text.
pub const MAGIC: [u8; 8] = *b"\x8aMARQ\r\n\x1a";
/// Major version that this crate reads and writes.
pub const MAJOR: u16 = 1;
/// Minor version that this crate writes; files of any minor version are read.
pub const MINOR: u16 = 0;
/// Bytes of the fixed header.
pub const HEADER_BYTES: u64 = 64;
/// Bytes of one entry of the section table.
pub const SECTION_ENTRY_BYTES: u64 = 32;
/// Most sections a file may have; the table always fits the first read.
pub const MAX_SECTIONS: u32 = 64;
/// Flag of a section that a reader must refuse when it does not know its type.
pub const MUST_UNDERSTAND: u32 = 1;

/// Types of sections. 1 to 6 make an atlas and are in every file; of the others this version knows the clusters'.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum SectionKind {
    /// [`Metadata`](crate::Metadata).
    Metadata = 1,
    /// Directory of the index blocks.
    Directory = 2,
    /// Charts and glue.
    Charts = 3,
    /// All charts at coarse resolutions.
    Base = 4,
    /// Index blocks.
    IndexBlocks = 5,
    /// Atlas pages.
    Pages = 6,
    /// Heightfield pages.
    Terrain = 16,
    /// Tree of clusters, and the mesh of its root.
    Clusters = 17,
    /// Colour texels by node.
    ColourTiles = 18,
    /// Behaviour over time.
    Time = 19,
    /// Whole-model stand-in; ignorable.
    Proxy = 20,
    /// A picture of the model ([`thumbnail`](crate::thumbnail)); ignorable.
    Thumbnail = 21,
    /// Meshes of the clusters below the root.
    ClusterPages = 22,
    /// Which charts have colour tiles, and where; ignorable.
    ColourDirectory = 23,
}

/// The types that make an atlas, in the order in which they must lie in the file.
pub(crate) const ATLAS_SECTIONS: [SectionKind; 6] = [
    SectionKind::Metadata,
    SectionKind::Directory,
    SectionKind::Charts,
    SectionKind::Base,
    SectionKind::IndexBlocks,
    SectionKind::Pages,
];

/// The types that make a cluster layer: both are in a file, or none.
pub(crate) const CLUSTER_SECTIONS: [SectionKind; 2] =
    [SectionKind::Clusters, SectionKind::ClusterPages];

/// One entry of the section table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Section {
    /// Type; see [`SectionKind`].
    pub kind: u32,
    /// Flags; see [`MUST_UNDERSTAND`].
    pub flags: u32,
    /// Bytes of the file.
    pub range: Range<u64>,
    /// xxh3-64 of the bytes, seeded with the content id.
    pub checksum: u64,
}

impl Section {
    /// Length in bytes.
    pub fn length(&self) -> u64 {
        self.range.end.saturating_sub(self.range.start)
    }
}

/// Header and section table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// Minor version of the file.
    pub minor: u16,
    /// Length of the whole file.
    pub file_length: u64,
    /// Content id.
    pub content_id: [u8; 16],
    /// Everything up to and including the base.
    pub front_length: u64,
    /// Section table.
    pub sections: Vec<Section>,
}

/// Seed of every checksum of a file.
pub(crate) fn seed(content_id: &[u8; 16]) -> u64 {
    let [a, b, c, d, e, f, g, h, ..] = *content_id;
    u64::from_le_bytes([a, b, c, d, e, f, g, h])
}

/// Checksum of `bytes` in the file named `content_id`.
pub(crate) fn checksum(content_id: &[u8; 16], bytes: &[u8]) -> u64 {
    xxh3_64_with_seed(bytes, seed(content_id))
}

/// Refuses `bytes` whose checksum is not `stored`.
pub(crate) fn check(
    what: &'static str,
    offset: u64,
    content_id: &[u8; 16],
    bytes: &[u8],
    stored: u64,
) -> Result<(), Error> {
    let computed = checksum(content_id, bytes);
    if computed == stored {
        Ok(())
    } else {
        Err(Error::Checksum {
            what,
            offset,
            stored,
            computed,
        })
    }
}

impl Header {
    /// Bytes of header and table.
    pub fn encoded_length(section_count: u32) -> u64 {
        HEADER_BYTES.saturating_add(SECTION_ENTRY_BYTES.saturating_mul(u64::from(section_count)))
    }

    /// Reads header and table from the start of a file; more bytes may follow.
    ///
    /// # Errors
    /// When the magic, the version, the checksum or the layout is wrong, or `bytes` end before the table does.
    pub fn parse(bytes: &[u8]) -> Result<Self, Error> {
        let known = bytes.len().min(MAGIC.len());
        if bytes.get(..known) != MAGIC.get(..known) {
            return Err(Error::NotMarq {
                found: bytes.get(..known).unwrap_or_default().to_vec(),
            });
        }
        let mut cursor = Cursor::new("header", bytes);
        cursor.take(MAGIC.len())?;
        let (major, minor) = (cursor.u16()?, cursor.u16()?);
        if major != MAJOR {
            return Err(Error::UnsupportedVersion { major, minor });
        }
        let flags = cursor.u32()?;
        let file_length = cursor.u64()?;
        let content_id = cursor.bytes16()?;
        let front_length = cursor.u64()?;
        let section_count = cursor.u32()?;
        let reserved = cursor.u32()?;
        let stored = cursor.u64()?;
        if section_count > MAX_SECTIONS {
            let limit = u64::from(MAX_SECTIONS);
            return Err(Error::Limit {
                what: "sections",
                limit,
                found: u64::from(section_count),
            });
        }
        let table_length = Self::encoded_length(section_count).saturating_sub(HEADER_BYTES);
        let table = cursor.take(usize::try_from(table_length).unwrap_or(usize::MAX))?;
        let computed = Self::checksum_of(&content_id, bytes, table);
        if computed != stored {
            return Err(Error::Checksum {
                what: "header",
                offset: 0,
                stored,
                computed,
            });
        }
        if flags != 0 {
            return Err(Error::Reserved {
                what: "header flags",
                value: u64::from(flags),
            });
        }
        if reserved != 0 {
            return Err(Error::Reserved {
                what: "header",
                value: u64::from(reserved),
            });
        }
        let sections = Self::parse_table(table, section_count)?;
        let header = Self {
            minor,
            file_length,
            content_id,
            front_length,
            sections,
        };
        header.check_layout()?;
        Ok(header)
    }

    fn checksum_of(content_id: &[u8; 16], bytes: &[u8], table: &[u8]) -> u64 {
        let mut covered = bytes.get(..56).unwrap_or_default().to_vec();
        covered.extend_from_slice(table);
        checksum(content_id, &covered)
    }

    fn parse_table(table: &[u8], section_count: u32) -> Result<Vec<Section>, Error> {
        let mut cursor = Cursor::new("section table", table);
        let mut sections = Vec::new();
        for index in 0..section_count {
            let (kind, flags) = (cursor.u32()?, cursor.u32()?);
            let (offset, length, checksum) = (cursor.u64()?, cursor.u64()?, cursor.u64()?);
            if flags & !MUST_UNDERSTAND != 0 {
                return Err(Error::Reserved {
                    what: "section flags",
                    value: u64::from(flags),
                });
            }
            if flags & MUST_UNDERSTAND != 0
                && !ATLAS_SECTIONS
                    .iter()
                    .chain(&CLUSTER_SECTIONS)
                    .any(|&known| known as u32 == kind)
            {
                return Err(Error::UnknownSection { index, kind });
            }
            let Some(end) = offset.checked_add(length) else {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "ends beyond any file",
                });
            };
            sections.push(Section {
                kind,
                flags,
                range: offset..end,
                checksum,
            });
        }
        Ok(sections)
    }

    fn check_layout(&self) -> Result<(), Error> {
        let mut end = Self::encoded_length(u32::try_from(self.sections.len()).unwrap_or(u32::MAX));
        let mut atlas = ATLAS_SECTIONS.iter().map(|&kind| kind as u32).peekable();
        for (index, section) in (0u32..).zip(&self.sections) {
            let kind = section.kind;
            if section.range.start != end {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "does not start where the one before it ends",
                });
            }
            end = section.range.end;
            if atlas.peek() == Some(&kind) {
                atlas.next();
            } else if ATLAS_SECTIONS.iter().any(|&known| known as u32 == kind) {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "is out of order or there twice",
                });
            }
            if kind == SectionKind::Base as u32 && end != self.front_length {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "does not end where the front does",
                });
            }
        }
        if let Some(kind) = atlas.next() {
            return Err(Error::MissingSection { kind });
        }
        self.check_clusters()?;
        if end != self.file_length {
            return Err(Error::Mismatch {
                what: "end of the last section",
                expected: self.file_length,
                found: end,
            });
        }
        Ok(())
    }

    /// The cluster sections are both there, once, the tree within the front.
    fn check_clusters(&self) -> Result<(), Error> {
        let mut found = [None; 2];
        for (index, section) in (0u32..).zip(&self.sections) {
            let kind = section.kind;
            let place = CLUSTER_SECTIONS.iter().position(|&own| own as u32 == kind);
            let Some(slot) = place.and_then(|place| found.get_mut(place)) else {
                continue;
            };
            if slot.replace(index).is_some() {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "is there twice",
                });
            }
            if kind == SectionKind::Clusters as u32 && section.range.end > self.front_length {
                return Err(Error::Section {
                    index,
                    kind,
                    fault: "does not lie in the front",
                });
            }
        }
        for (place, other) in [(0, 1), (1, 0)] {
            if found.get(place) == Some(&None) && found.get(other) != Some(&None) {
                return Err(Error::MissingSection {
                    kind: CLUSTER_SECTIONS
                        .get(place)
                        .map_or(0, |&section| section as u32),
                });
            }
        }
        Ok(())
    }

    /// The section of `kind`.
    ///
    /// # Errors
    /// When there is none.
    pub fn section(&self, kind: SectionKind) -> Result<&Section, Error> {
        let kind = kind as u32;
        self.sections
            .iter()
            .find(|section| section.kind == kind)
            .ok_or(Error::MissingSection { kind })
    }

    /// Header and table as bytes, checksum included.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        out.extend(MAJOR.to_le_bytes());
        out.extend(self.minor.to_le_bytes());
        out.extend(0u32.to_le_bytes());
        out.extend(self.file_length.to_le_bytes());
        out.extend(self.content_id);
        out.extend(self.front_length.to_le_bytes());
        out.extend(
            u32::try_from(self.sections.len())
                .unwrap_or(u32::MAX)
                .to_le_bytes(),
        );
        out.extend(0u32.to_le_bytes());
        let mut table = Vec::new();
        for section in &self.sections {
            table.extend(section.kind.to_le_bytes());
            table.extend(section.flags.to_le_bytes());
            table.extend(section.range.start.to_le_bytes());
            table.extend(section.length().to_le_bytes());
            table.extend(section.checksum.to_le_bytes());
        }
        out.extend(Self::checksum_of(&self.content_id, &out, &table).to_le_bytes());
        out.extend(table);
        out
    }
}
