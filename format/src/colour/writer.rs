//! Writing the colour directory and the tiles.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "no bytes of a file come here, and sums of sizes in memory fit 64 bits"
)]

use super::block::encode_facts;
use super::directory::{BlockRecord, Directory, content_of};
use super::{BLOCK_TILES, TexelSize, decode_vp8};
use crate::header::checksum;
use crate::parallel::map_ordered;
use crate::quadtree::MAX_LEVEL;
use crate::{Error, Limits};

/// One tile, as the converter made it.
#[derive(Debug, Clone, Default)]
pub struct TileInput {
    /// A VP8 key frame of the chart's size with its gutter.
    pub bytes: Vec<u8>,
    /// Children by quadrant.
    pub children: [Option<Box<TileInput>>; 4],
}

/// The texels of one chart.
#[derive(Debug, Clone)]
pub struct ChartTiles {
    /// Texels of each tile.
    pub size: TexelSize,
    /// The tile of the whole chart.
    pub root: TileInput,
}

/// The tiles of a file: one a chart, `None` for charts whose samples' colours say all.
pub type ColourInput = Vec<Option<ChartTiles>>;

/// Everything that does not depend on the content id.
pub(crate) struct Prepared<'a> {
    tiles: Vec<&'a TileInput>,
    directory: Directory,
    facts: Vec<Vec<u8>>,
}

impl<'a> Prepared<'a> {
    /// Numbers and checks the tiles.
    pub(crate) fn new(input: &'a ColourInput, chart_count: usize) -> Result<Self, Error> {
        let refuse = |rule, detail| Err(Error::Input { rule, detail });
        if input.len() != chart_count {
            return refuse(
                "there is one entry of tiles a chart",
                format!("{} entries, {chart_count} charts", input.len()),
            );
        }
        let mut tiles: Vec<&TileInput> = input.iter().flatten().map(|c| &c.root).collect();
        let mut sizes: Vec<TexelSize> = input.iter().flatten().map(|c| c.size).collect();
        let (mut level, mut start) = (0, 0);
        while start < tiles.len() {
            let end = tiles.len();
            for tile in start..end {
                let parent = tiles[tile];
                tiles.extend(parent.children.iter().flatten().map(Box::as_ref));
                sizes.resize(tiles.len(), sizes[tile]);
            }
            (start, level) = (end, level + 1);
            if level > usize::from(MAX_LEVEL) + 1 {
                return refuse("tiles are at most 15 levels deep", format!("level {level}"));
            }
        }
        let limits = Limits::default();
        if tiles.len() > limits.tiles as usize {
            return refuse("there are not too many tiles", tiles.len().to_string());
        }
        let numbers: Vec<usize> = (0..tiles.len()).collect();
        let checks = map_ordered(&numbers, |&tile| {
            let bytes = &tiles[tile].bytes;
            if bytes.len() > limits.page_bytes as usize {
                let detail = format!("{} bytes", bytes.len());
                return Err(Error::Input {
                    rule: "a tile is not too long",
                    detail,
                });
            }
            decode_vp8(sizes[tile], bytes).map(|_| ())
        });
        checks.into_iter().collect::<Result<(), Error>>()?;
        let facts = tiles
            .chunks(BLOCK_TILES as usize)
            .map(|block| encode_facts(&block.iter().map(|t| facts_of(t)).collect::<Vec<_>>()))
            .collect::<Result<Vec<_>, Error>>()?;
        let directory = Directory {
            tile_count: u32::try_from(tiles.len()).unwrap_or(u32::MAX),
            sizes: input
                .iter()
                .map(|chart| chart.as_ref().map(|c| c.size))
                .collect(),
            // Their number is part of the content, the rest follows once the content id is known.
            blocks: facts
                .iter()
                .map(|_| BlockRecord {
                    range: 0..0,
                    checksum: 0,
                    first_tile_offset: 0,
                    first_child: 0,
                })
                .collect(),
        };
        Ok(Self {
            tiles,
            directory,
            facts,
        })
    }

    /// Adds what the content id covers.
    pub(crate) fn hash(&self, hasher: &mut blake3::Hasher) -> Result<(), Error> {
        for part in content_of(&self.directory.encode()?) {
            hasher.update(part);
        }
        for block in &self.facts {
            hasher.update(block);
        }
        for tile in &self.tiles {
            hasher.update(&tile.bytes);
        }
        Ok(())
    }

    /// The bodies of the two sections, which lie one after the other from `start`.
    pub(crate) fn sections(
        mut self,
        content_id: &[u8; 16],
        start: u64,
    ) -> Result<[Vec<u8>; 2], Error> {
        let tiles_start = start + self.directory.encode()?.len() as u64;
        let blocks: Vec<Vec<u8>> = self
            .tiles
            .chunks(BLOCK_TILES as usize)
            .zip(&self.facts)
            .map(|(tiles, facts)| {
                let sum = |tile: &&TileInput| {
                    let [a, b, c, d, ..] = checksum(content_id, &tile.bytes).to_le_bytes();
                    [a, b, c, d]
                };
                tiles
                    .iter()
                    .flat_map(sum)
                    .chain(facts.iter().copied())
                    .collect()
            })
            .collect();
        let mut offset = tiles_start;
        let mut tile_offset = offset + blocks.iter().map(|b| b.len() as u64).sum::<u64>();
        let mut child =
            u32::try_from(self.directory.sizes.iter().flatten().count()).unwrap_or(u32::MAX);
        let parts = blocks.iter().zip(self.tiles.chunks(BLOCK_TILES as usize));
        self.directory.blocks = parts
            .map(|(block, tiles)| {
                let range = offset..offset + block.len() as u64;
                offset = range.end;
                let record = BlockRecord {
                    range,
                    checksum: checksum(content_id, block),
                    first_tile_offset: tile_offset,
                    first_child: child,
                };
                for tile in tiles {
                    let (length, children) = facts_of(tile);
                    tile_offset += u64::from(length);
                    child += children.count_ones();
                }
                record
            })
            .collect();
        let mut body = blocks.concat();
        for tile in &self.tiles {
            body.extend_from_slice(&tile.bytes);
        }
        Ok([self.directory.encode()?, body])
    }
}

/// Length and children of a tile.
fn facts_of(tile: &TileInput) -> (u32, u8) {
    let mask = (0u8..).zip(&tile.children);
    let children = mask.fold(0, |mask, (q, child)| mask | u8::from(child.is_some()) << q);
    (
        u32::try_from(tile.bytes.len()).unwrap_or(u32::MAX),
        children,
    )
}
