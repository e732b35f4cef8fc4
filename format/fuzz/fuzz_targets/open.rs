//! Opens any bytes, as they are and as the sections of a file with right checksums, and decodes every page.
//!
//! `cargo +nightly fuzz run open -- -max_total_time=60`, in `format/`; seeds: `tests/data`.
#![no_main]

#[path = "../../tests/support/assemble.rs"]
mod assemble;

use assemble::{Part, Parts};
use libfuzzer_sys::fuzz_target;
use marquetry_format::{ByteSource, ChartId, ClusterId, Document, Limits, PageId, PageSamples, SliceSource};

/// Small, so that what is found is a fault and not a large allocation.
const LIMITS: Limits = Limits {
    charts: 1 << 10,
    pages: 1 << 12,
    clusters: 1 << 10,
    metadata_bytes: 1 << 12,
    section_bytes: 1 << 20,
    page_bytes: 1 << 14,
    tiles: 1 << 12,
};

fuzz_target!(|data: &[u8]| {
    read(data);
    read(&from_sections(data));
});

/// All sections that are understood, in the order of the writer.
const KINDS: [u32; 8] = [1, 2, 3, 17, 4, 5, 6, 22];

/// Each section's body comes after its length, two bytes; the last takes the rest.
fn from_sections(mut data: &[u8]) -> Vec<u8> {
    let mut sections = Vec::new();
    for kind in KINDS {
        let mut body = data;
        if let (true, Some((length, rest))) = (kind != 22, data.split_first_chunk::<2>()) {
            let length = usize::from(u16::from_le_bytes(*length)).min(rest.len());
            (body, data) = rest.split_at(length);
        }
        sections.push(Part {
            kind,
            flags: 1,
            body: body.to_vec(),
        });
    }
    Parts {
        major: 1,
        flags: 0,
        content_id: [0; 16],
        sections,
    }
    .file()
}

fn read(bytes: &[u8]) {
    let source = SliceSource(bytes);
    let Ok(mut document) = Document::open(&source, LIMITS) else {
        return;
    };
    if document.load_index(&source).is_err() {
        return;
    }
    check_groups(&document);
    let clusters = document.clusters.as_ref().map_or(0, |clusters| clusters.count());
    for id in (0..clusters.min(64)).map(ClusterId) {
        let node = document.clusters.as_ref().and_then(|clusters| clusters.node(id));
        if let Some(Ok(bytes)) = node.map(|node| source.read(node.range.clone())) {
            let _ = document.decode_cluster(id, &bytes);
        }
    }
    let mut pages: Vec<Option<PageSamples>> = Vec::new();
    for page in (0..document.page_count().min(64)).map(PageId) {
        let bytes = document
            .page_range(page)
            .and_then(|range| source.read(range).ok());
        let samples = bytes.and_then(|bytes| match document.parent(page) {
            None => document.decode_root(ChartId(page.0), &bytes).ok(),
            Some((parent, quadrant)) => {
                let parent = pages.get(parent.0 as usize)?.as_ref()?;
                document.decode_child(page, quadrant, parent, &bytes).ok()
            }
        });
        let node = document.node_of_page(page);
        assert!(node.is_none_or(|node| document.page_of_node(node) == Some(page)));
        pages.push(samples);
    }
}

/// Every cluster but the root is a child of one group, whose members come before it.
fn check_groups(document: &Document) {
    let Some(clusters) = &document.clusters else {
        return;
    };
    let mut parents = vec![None; clusters.nodes.len()];
    for group in &clusters.groups {
        assert!(group.children.len() > 1 && group.members.is_sorted());
        for child in group.children.clone() {
            assert!(group.members.iter().all(|member| member.0 < child));
            let parent = parents[child as usize].replace(group.members[0]);
            assert_eq!(parent, None);
        }
    }
    for (node, parent) in clusters.nodes.iter().zip(parents) {
        assert_eq!(node.parent, parent);
        let children = node.group.and_then(|group| clusters.group(group));
        assert_eq!(node.children, children.map_or(0..0, |group| group.children.clone()));
    }
}
