//! Writing a file from decoded samples.
//!
//! Everything is held in memory until the content id is known, since every checksum depends on it. The bytes
//! are the same for any number of threads. Nothing is written before the input was checked against every rule
//! that [`verify`](crate::verify) checks.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "no bytes of a file come here, the input is checked first, and sums of sizes in memory fit 64 bits"
)]

mod clusters;
mod input;
mod sections;

pub use crate::BytesByPart;
pub use crate::colour::writer::{ChartTiles, ColourInput, TileInput};
pub use crate::reader::FIRST_IMAGE_BYTES;

use crate::chart::encode_charts;
use crate::cluster::ClusterMesh;
use crate::codec::page::{Coding, encode_base, encode_child, encode_root};
use crate::codec::payload::PartBytes;
use crate::colour;
use crate::header::{Header, SectionKind, checksum};
use crate::index::BLOCK_PAGES;
use crate::index::block::{PageFacts, encode_facts};
use crate::index::directory::{BlockRecord, Directory};
use crate::index::quantize::{BoundsCode, cosine_code, error_code, widen_cone};
use crate::parallel::map_ordered;
use crate::{Error, Glue, Lattice, Metadata, NormalCone, PageSamples, thumbnail};
use clusters::ClusterLayer;
use input::Pages;
use sections::{kinds_of, put};

/// One node of a chart's tree, as the converter made it.
#[derive(Debug, Clone)]
pub struct NodeInput {
    /// Samples; positions are multiples of `2^lattice.shift`. Targets may be empty: the writer ignores them.
    pub samples: PageSamples,
    /// As [`PageEntry::errors`](crate::PageEntry::errors).
    pub errors: Vec<f32>,
    /// All triangle normals.
    pub cone: NormalCone,
    /// The four children in order (0,0) (1,0) (0,1) (1,1), or none. A child repeats, at its even samples,
    /// the parent's positions of its quadrant.
    pub children: Option<Box<[NodeInput; 4]>>,
}

/// One chart, as the converter made it.
#[derive(Debug, Clone)]
pub struct ChartInput {
    /// Glue by side.
    pub glue: [Option<Glue>; 4],
    /// The root node.
    pub root: NodeInput,
}

/// One cluster, as the converter made it.
#[derive(Debug, Clone, Default)]
pub struct ClusterInput {
    /// Its triangles, 1 to 256 with at most 256 vertices; the writer orders triangles and vertices anew.
    pub mesh: ClusterMesh,
    /// As [`ClusterNode::error`](crate::ClusterNode::error), lattice units: equal for nodes with the same children, and never
    /// below these children's.
    pub error: f32,
    /// Length of a texel of the mesh's texture, lattice units, above 0; `None` without one.
    pub texel: Option<f32>,
    /// Places, in the list of all clusters, of the nodes that replace it: none for a leaf, or 2 to 65 535. Nodes with equal
    /// lists are replaced together; other lists have no node in common.
    pub children: Vec<u32>,
}

/// What a file holds. Either may be missing, not both.
#[derive(Debug, Clone, Copy, Default)]
pub struct Content<'a> {
    /// The atlas.
    pub charts: &'a [ChartInput],
    /// The clusters: none, or the root and then the others in any order; the file does not depend on it.
    pub clusters: &'a [ClusterInput],
    /// Colour tiles, one entry a chart.
    pub colour: Option<&'a ColourInput>,
    /// A picture of the model, as [`thumbnail::decode`] takes it.
    pub thumbnail: Option<&'a [u8]>,
}

/// A page ready to be stored.
struct Encoded {
    bytes: Vec<u8>,
    parts: PartBytes,
    facts: PageFacts,
}

/// Writes a whole file with an atlas alone to `out`; see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_atlas(
    metadata: &Metadata,
    lattice: &Lattice,
    charts: &[ChartInput],
    out: &mut dyn std::io::Write,
) -> Result<BytesByPart, Error> {
    let content = Content {
        charts,
        ..Content::default()
    };
    write(metadata, lattice, &content, out)
}

/// Writes a whole file to `out`.
///
/// Chooses the largest base resolution with which everything up to the base fits [`FIRST_IMAGE_BYTES`], or 0.
/// Cones are widened until they hold every triangle normal of their node.
///
/// # Errors
/// When the input breaks a rule of the format, or `out` fails.
pub fn write(
    metadata: &Metadata,
    lattice: &Lattice,
    content: &Content<'_>,
    out: &mut dyn std::io::Write,
) -> Result<BytesByPart, Error> {
    check(metadata, lattice, content)?;
    let metadata_bytes = metadata.encode()?;
    let coding = Coding {
        shift: lattice.shift,
        has_colours: metadata.has_colours,
    };
    let charts = content.charts;
    let clusters = if content.clusters.is_empty() {
        None
    } else {
        Some(ClusterLayer::new(content.clusters, coding)?)
    };
    let pages = Pages::new(charts, coding)?;
    let block_count = u32::try_from(pages.flat.len())
        .unwrap_or(u32::MAX)
        .div_ceil(BLOCK_PAGES);

    let colour = content
        .colour
        .map(|input| colour::writer::Prepared::new(input, charts.len()))
        .transpose()?;
    let kinds = kinds_of(
        clusters.is_some(),
        colour.is_some(),
        content.thumbnail.is_some(),
    );
    let before_charts = Header::encoded_length(kinds.len() as u32)
        + metadata_bytes.len() as u64
        + Directory::encoded_length(block_count);
    let graph_bytes = clusters.as_ref().map_or(0, ClusterLayer::graph_bytes);
    let front = Front::new(charts, coding, before_charts + graph_bytes)?;
    let encoded = encode_pages(&pages, coding, front.base_resolution)?;

    let facts = facts_of_blocks(&encoded)?;
    let content_id = content_id(
        &metadata_bytes,
        &front,
        &facts,
        &encoded,
        clusters.as_ref(),
        colour.as_ref(),
        content.thumbnail,
    )?;

    let index_start = before_charts + graph_bytes + (front.charts.len() + front.base.len()) as u64;
    let (index_bytes, directory) = index(&content_id, charts.len(), index_start, &encoded, &facts);
    let page_bytes: Vec<u8> = encoded
        .iter()
        .flat_map(|page| &page.bytes)
        .copied()
        .collect();

    let (graph, cluster_pages) = match &clusters {
        Some(layer) => (
            layer.graph_section(&content_id),
            layer.pages().collect::<Vec<_>>().concat(),
        ),
        None => (Vec::new(), Vec::new()),
    };
    let directory_bytes = directory.encode();
    let before_colour = Header::encoded_length(kinds.len() as u32)
        + [&metadata_bytes, &directory_bytes, &front.charts, &graph]
            .iter()
            .chain(&[&front.base, &index_bytes, &cluster_pages, &page_bytes])
            .map(|body| body.len() as u64)
            .sum::<u64>();
    let [colour_directory, colour_tiles] = match colour {
        Some(colour) => colour.sections(&content_id, before_colour)?,
        None => [Vec::new(), Vec::new()],
    };
    let body_of = |kind| match kind {
        SectionKind::Thumbnail => content.thumbnail.unwrap_or_default(),
        SectionKind::Metadata => &metadata_bytes,
        SectionKind::Directory => &directory_bytes,
        SectionKind::Charts => &front.charts,
        SectionKind::Clusters => &graph,
        SectionKind::Base => &front.base,
        SectionKind::IndexBlocks => &index_bytes,
        SectionKind::ClusterPages => &cluster_pages,
        SectionKind::ColourDirectory => &colour_directory,
        SectionKind::ColourTiles => &colour_tiles,
        _ => &page_bytes,
    };
    let bodies: Vec<(SectionKind, &[u8])> =
        kinds.iter().map(|&kind| (kind, body_of(kind))).collect();
    let total = put(content_id, index_start, &bodies, out)?;

    let [geometry, normals, colour] = directory.part_bytes;
    let [more_geometry, more_normals, more_colour] =
        clusters.as_ref().map_or([0; 3], |layer| layer.part_bytes);
    let root_bytes = clusters.as_ref().map_or(0, ClusterLayer::root_bytes);
    let index = directory_bytes.len() + front.charts.len() + index_bytes.len() + graph.len();
    Ok(BytesByPart {
        total,
        header: Header::encoded_length(kinds.len() as u32) + metadata_bytes.len() as u64,
        index: index as u64 - root_bytes,
        geometry: geometry + front.base_parts.geometry + more_geometry,
        normals: normals + front.base_parts.normals + more_normals,
        colour: colour
            + front.base_parts.colours
            + more_colour
            + (colour_directory.len() + colour_tiles.len()) as u64,
        thumbnail: content.thumbnail.map_or(0, <[u8]>::len) as u64,
    })
}

/// What can be told before anything is encoded.
fn check(metadata: &Metadata, lattice: &Lattice, content: &Content<'_>) -> Result<(), Error> {
    if metadata.lattice != *lattice {
        return Err(Error::Input {
            rule: "the metadata repeats the lattice",
            detail: format!("{:?} and {lattice:?}", metadata.lattice),
        });
    }
    if content.charts.is_empty() && content.clusters.is_empty() {
        return Err(Error::Input {
            rule: "a file has a chart or a cluster",
            detail: "neither was given".to_owned(),
        });
    }
    content.thumbnail.map_or(Ok(()), |picture| {
        thumbnail::decode(picture).map(|_picture| ())
    })
}

/// The packed facts of every index block.
fn facts_of_blocks(pages: &[Encoded]) -> Result<Vec<Vec<u8>>, Error> {
    pages
        .chunks(BLOCK_PAGES as usize)
        .map(|block| {
            let facts: Vec<PageFacts> = block.iter().map(|page| page.facts.clone()).collect();
            encode_facts(&facts)
        })
        .collect()
}

/// What the front holds besides metadata and directory.
struct Front {
    base_resolution: u8,
    charts: Vec<u8>,
    base: Vec<u8>,
    base_parts: PartBytes,
}

impl Front {
    /// With the largest base resolution that fits, if any does.
    fn new(charts: &[ChartInput], coding: Coding, before_charts: u64) -> Result<Self, Error> {
        let finest = charts
            .iter()
            .map(|chart| chart.root.samples.resolution)
            .max()
            .unwrap_or(0);
        for base_resolution in (1..=finest).rev() {
            let front = Self::at(charts, coding, base_resolution)?;
            if before_charts + (front.charts.len() + front.base.len()) as u64 <= FIRST_IMAGE_BYTES {
                return Ok(front);
            }
        }
        Self::at(charts, coding, 0)
    }

    fn at(charts: &[ChartInput], coding: Coding, base_resolution: u8) -> Result<Self, Error> {
        let (base, base_parts) = encode_base(
            coding,
            charts.iter().map(|chart| &chart.root.samples),
            base_resolution,
        )?;
        let glue: Vec<_> = charts.iter().map(|chart| chart.glue).collect();
        let resolutions: Vec<u8> = charts
            .iter()
            .map(|chart| chart.root.samples.resolution)
            .collect();
        let errors = charts.iter().flat_map(|chart| {
            let count = usize::from(chart.root.samples.resolution.min(base_resolution)) + 1;
            chart.root.errors.iter().take(count)
        });
        let errors = errors
            .map(|&error| coded(error))
            .collect::<Result<Vec<_>, Error>>()?;
        let charts = encode_charts(&glue, &resolutions, &errors, base_resolution)?;
        Ok(Self {
            base_resolution,
            charts,
            base,
            base_parts,
        })
    }
}

fn coded(error: f32) -> Result<u16, Error> {
    let rule = "an error is a finite length, not below zero";
    error_code(error).ok_or_else(|| Error::Input {
        rule,
        detail: error.to_string(),
    })
}

fn encode_pages(
    pages: &Pages<'_>,
    coding: Coding,
    base_resolution: u8,
) -> Result<Vec<Encoded>, Error> {
    let indices: Vec<usize> = (0..pages.flat.len()).collect();
    let encode = |&index: &usize| -> Result<Encoded, Error> {
        let page = &pages.flat[index];
        let samples = &page.node.samples;
        let (bytes, parts) = match page.parent {
            None => encode_root(coding, samples, base_resolution)?,
            Some((parent, quadrant)) => {
                encode_child(coding, samples, &pages.flat[parent].node.samples, quadrant)?
            }
        };
        let (axis, widened) = widen_cone(&page.node.cone);
        let coded_axis = crate::codec::octahedral::decode(axis);
        let measured = crate::rules::smallest_cosine(samples, coded_axis);
        let cosine = measured.map_or(widened, |measured| widened.min(measured - 1e-6));
        let facts = PageFacts {
            length: u32::try_from(bytes.len()).unwrap_or(u32::MAX),
            errors: page
                .node
                .errors
                .iter()
                .map(|&error| coded(error))
                .collect::<Result<_, _>>()?,
            axis,
            cosine: cosine_code(cosine),
            bounds: BoundsCode::new(&pages.bounds[index]),
            has_children: page.node.children.is_some(),
        };
        Ok(Encoded {
            bytes,
            parts,
            facts,
        })
    };
    map_ordered(&indices, encode).into_iter().collect()
}

fn content_id(
    metadata: &[u8],
    front: &Front,
    facts: &[Vec<u8>],
    pages: &[Encoded],
    clusters: Option<&ClusterLayer>,
    colour: Option<&colour::writer::Prepared<'_>>,
    thumbnail: Option<&[u8]>,
) -> Result<[u8; 16], Error> {
    let mut hasher = blake3::Hasher::new();
    for part in [metadata, &front.charts, &front.base] {
        hasher.update(part);
    }
    for block in facts {
        hasher.update(block);
    }
    for page in pages {
        hasher.update(&page.bytes);
    }
    if let Some(layer) = clusters {
        for part in layer.graph.iter().map(Vec::as_slice).chain(layer.pages()) {
            hasher.update(part);
        }
    }
    if let Some(colour) = colour {
        colour.hash(&mut hasher)?;
    }
    hasher.update(thumbnail.unwrap_or_default());
    let mut id = [0; 16];
    hasher.finalize_xof().fill(&mut id);
    Ok(id)
}

/// Index blocks and directory of a file whose index starts at `index_start`.
fn index(
    content_id: &[u8; 16],
    chart_count: usize,
    index_start: u64,
    pages: &[Encoded],
    facts: &[Vec<u8>],
) -> (Vec<u8>, Directory) {
    let blocks: Vec<Vec<u8>> = pages
        .chunks(BLOCK_PAGES as usize)
        .zip(facts)
        .map(|(pages, facts)| {
            let checksums = pages
                .iter()
                .flat_map(|page| (checksum(content_id, &page.bytes) as u32).to_le_bytes());
            checksums.chain(facts.iter().copied()).collect()
        })
        .collect();
    let mut part_bytes = [0; 3];
    for PartBytes {
        geometry,
        normals,
        colours,
    } in pages.iter().map(|page| page.parts)
    {
        for (sum, part) in part_bytes.iter_mut().zip([geometry, normals, colours]) {
            *sum += part;
        }
    }
    let mut block_start = index_start;
    let mut first_page_offset =
        index_start + blocks.iter().map(|block| block.len() as u64).sum::<u64>();
    let mut first_child = u32::try_from(chart_count).unwrap_or(u32::MAX);
    let mut records = Vec::new();
    for (block, pages) in blocks.iter().zip(pages.chunks(BLOCK_PAGES as usize)) {
        let range = block_start..block_start + block.len() as u64;
        block_start = range.end;
        let checksum = checksum(content_id, block);
        records.push(BlockRecord {
            range,
            checksum,
            first_page_offset,
            first_child,
        });
        first_page_offset += pages
            .iter()
            .map(|page| page.bytes.len() as u64)
            .sum::<u64>();
        first_child += 4 * pages
            .iter()
            .map(|page| u32::from(page.facts.has_children))
            .sum::<u32>();
    }
    let page_count = u32::try_from(pages.len()).unwrap_or(u32::MAX);
    (
        blocks.concat(),
        Directory {
            page_count,
            part_bytes,
            blocks: records,
        },
    )
}
