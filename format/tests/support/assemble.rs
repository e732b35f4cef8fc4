//! Files taken apart and put together again, with right checksums and one thing wrong.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "every test binary uses a part of this"
)]

use marquetry_format::header::{HEADER_BYTES, Header, SECTION_ENTRY_BYTES};
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// A section as the table states it, and its bytes.
#[derive(Clone)]
pub struct Part {
    pub kind: u32,
    pub flags: u32,
    pub body: Vec<u8>,
}

/// A file in parts.
#[derive(Clone)]
pub struct Parts {
    pub major: u16,
    pub flags: u32,
    pub content_id: [u8; 16],
    pub sections: Vec<Part>,
}

impl Parts {
    pub fn of(file: &[u8]) -> Self {
        let header = Header::parse(file).unwrap();
        let parts = header.sections.iter().map(|section| Part {
            kind: section.kind,
            flags: section.flags,
            body: file[section.range.start as usize..section.range.end as usize].to_vec(),
        });
        Self {
            major: 1,
            flags: 0,
            content_id: header.content_id,
            sections: parts.collect(),
        }
    }

    pub fn body(&mut self, kind: u32) -> &mut Vec<u8> {
        &mut self
            .sections
            .iter_mut()
            .find(|part| part.kind == kind)
            .unwrap()
            .body
    }

    pub fn checksum(&self, bytes: &[u8]) -> u64 {
        xxh3_64_with_seed(
            bytes,
            u64::from_le_bytes(self.content_id[..8].try_into().unwrap()),
        )
    }

    /// The file, after `damage` was done to the section table.
    pub fn file_with(&self, damage: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
        let mut end = HEADER_BYTES + SECTION_ENTRY_BYTES * self.sections.len() as u64;
        let mut front = end;
        let mut table = Vec::new();
        for Part { kind, flags, body } in &self.sections {
            table.extend(kind.to_le_bytes());
            table.extend(flags.to_le_bytes());
            table.extend(end.to_le_bytes());
            table.extend((body.len() as u64).to_le_bytes());
            table.extend(self.checksum(body).to_le_bytes());
            end += body.len() as u64;
            if *kind == 4 {
                front = end;
            }
        }
        damage(&mut table);
        let mut file = b"\x8aMARQ\r\n\x1a".to_vec();
        file.extend(self.major.to_le_bytes());
        file.extend(0u16.to_le_bytes());
        file.extend(self.flags.to_le_bytes());
        file.extend(end.to_le_bytes());
        file.extend(self.content_id);
        file.extend(front.to_le_bytes());
        file.extend((table.len() as u32 / 32).to_le_bytes());
        file.extend(0u32.to_le_bytes());
        file.extend(self.checksum(&[&file[..], &table].concat()).to_le_bytes());
        file.extend(table);
        file.extend(self.sections.iter().flat_map(|part| &part.body));
        file
    }

    pub fn file(&self) -> Vec<u8> {
        self.file_with(|_| {})
    }
}
