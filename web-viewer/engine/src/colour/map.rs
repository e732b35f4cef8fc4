//! What each place of a drawn node shows.
//!
//! A node's part of the map is a grid of 2^m × 2^m entries over its square, fine enough for the deepest tile below it; a node
//! under a coarser tile has one. An entry takes the node's (u, v) to the texture: see `shaders/shared/tiles.wgsl`.

use super::slots::{LAYER_SIZE, MARGIN};
use super::store::{Resident, TileStore};
use marquetry_format::{ColourIndex, NodeId, Quadrant, TexelSize, TileId};

/// Entries in one row of the map's texture, of two texels each.
pub const ROW_ENTRIES: u32 = 512;
/// log2 of the most entries a side: as deep as tiles are below a root.
const MOST_DEPTH: u8 = 5;

/// In [`MapPlace`] for a node without tiles.
pub const NO_TILES: u32 = u32::MAX;

/// Where a node's entries are: number of the first, and log2 of the entries a side (or [`NO_TILES`]).
pub type MapPlace = [u32; 2];

/// The map of one picture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TileMap {
    /// Offset x, y and scale x, y to texture coordinates; layer, least mip, weight over the samples' colours, nothing.
    pub entries: Vec<[f32; 8]>,
}

/// Which tiles may be shown, and since when they have been.
#[derive(Debug)]
pub struct Shown<'a, F> {
    /// The index.
    pub index: &'a ColourIndex,
    /// The tiles in memory.
    pub store: &'a TileStore,
    /// Which of them the view wants.
    pub is_wanted: F,
    /// The viewer's clock, seconds.
    pub now: f64,
    /// Seconds that a tile fades in for.
    pub fade_seconds: f64,
}

/// A resident tile and where it lies.
#[derive(Debug, Clone, Copy)]
struct Cover {
    resident: Resident,
    size: TexelSize,
    node: NodeId,
}

impl<F: Fn(TileId) -> bool> Shown<'_, F> {
    fn cover(&self, tile: TileId, node: NodeId) -> Option<Cover> {
        let resident = self.store.get(tile).filter(|_| (self.is_wanted)(tile))?;
        let size = self.index.size(node.chart)?;
        Some(Cover {
            resident,
            size,
            node,
        })
    }

    /// Adds the entries of a drawn node to `map`.
    pub fn add(&self, map: &mut TileMap, node: NodeId) -> MapPlace {
        const NOTHING: MapPlace = [0, NO_TILES];
        let Some(root) = self.index.root(node.chart) else {
            return NOTHING;
        };
        let mut at = NodeId::root(node.chart);
        let mut tile = Some(root);
        let mut best = self.cover(root, at);
        for level in (0..node.level).rev() {
            let bit = |c: u32| u8::from(c >> level & 1 == 1);
            let quadrant = Quadrant(bit(node.x) | bit(node.y) << 1);
            at = at.child(quadrant);
            tile = tile.and_then(|tile| self.index.child(tile, quadrant));
            let found = tile.and_then(|tile| self.cover(tile, at));
            best = found.or(best);
        }
        let depth = tile.map_or(0, |tile| self.depth(tile, at, 0));
        if depth == 0 && best.is_none() {
            return NOTHING;
        }
        let first = map.entries.len();
        let side = 1usize << depth;
        map.entries.resize(first + side * side, [0.0; 8]);
        if let Some(entries) = map.entries.get_mut(first..) {
            let square = Square { side, x: 0, y: 0 };
            self.fill(entries, side, square, tile, at, node, best);
        }
        [u32::try_from(first).unwrap_or(u32::MAX), u32::from(depth)]
    }

    /// How deep below `tile` anything is shown.
    fn depth(&self, tile: TileId, node: NodeId, so_far: u8) -> u8 {
        if so_far >= MOST_DEPTH {
            return so_far;
        }
        let below = (0..4).map(Quadrant).filter_map(|quadrant| {
            let child = self.index.child(tile, quadrant)?;
            let deeper = self.depth(child, node.child(quadrant), so_far + 1);
            let shown = deeper > so_far + 1 || self.cover(child, node.child(quadrant)).is_some();
            shown.then_some(deeper)
        });
        below.max().unwrap_or(so_far)
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "a recursion and what it walks over"
    )]
    fn fill(
        &self,
        entries: &mut [[f32; 8]],
        row: usize,
        square: Square,
        tile: Option<TileId>,
        at: NodeId,
        drawn: NodeId,
        best: Option<Cover>,
    ) {
        let own = tile.and_then(|tile| self.cover(tile, at)).or(best);
        let Square { side, x, y } = square;
        let shows_below = side > 1 && tile.is_some_and(|tile| self.depth(tile, at, 0) > 0);
        if !shows_below {
            let entry = own.map_or([0.0; 8], |cover| self.entry(cover, drawn));
            for j in y..y + side {
                if let Some(line) = entries.get_mut(j * row + x..j * row + x + side) {
                    line.fill(entry);
                }
            }
            return;
        }
        for quadrant in (0..4).map(Quadrant) {
            let half = side / 2;
            let part = Square {
                side: half,
                x: x + half * usize::from(quadrant.0 & 1),
                y: y + half * usize::from(quadrant.0 >> 1),
            };
            let child = tile.and_then(|tile| self.index.child(tile, quadrant));
            self.fill(entries, row, part, child, at.child(quadrant), drawn, own);
        }
    }

    fn entry(&self, cover: Cover, drawn: NodeId) -> [f32; 8] {
        let Cover {
            resident,
            size,
            node,
        } = cover;
        let ratio = (f64::from(node.level) - f64::from(drawn.level)).exp2();
        let across = |slot: u32, texels: u32, place: u32, tile: u32| {
            let texels = f64::from(texels);
            let first = f64::from(place) * ratio - f64::from(tile);
            let offset = f64::from(slot + MARGIN) + first * texels;
            [offset, ratio * texels].map(|t| narrow(t / f64::from(LAYER_SIZE)))
        };
        let slot = resident.slot;
        let [offset_x, scale_x] = across(slot.x, size.width, drawn.x, node.x);
        let [offset_y, scale_y] = across(slot.y, size.height, drawn.y, node.y);
        let age = self.now - resident.since;
        let shown = if self.fade_seconds > 0.0 {
            narrow((age / self.fade_seconds).clamp(0.0, 1.0))
        } else {
            1.0
        };
        // A root appears over the samples' colours; a child appears as its parent magnified, that is as its own mip 1.
        let (least_mip, weight) = if node.level == 0 {
            (0.0, shown)
        } else {
            (1.0 - shown, 1.0)
        };
        let layer = narrow(f64::from(slot.layer));
        [
            offset_x, offset_y, scale_x, scale_y, layer, least_mip, weight, 0.0,
        ]
    }
}

#[derive(Debug, Clone, Copy)]
struct Square {
    side: usize,
    x: usize,
    y: usize,
}

fn narrow(value: f64) -> f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a texture coordinate or a weight"
    )]
    let value = value as f32;
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residency::ids::IdSet;
    use crate::testing::{Random, Shape, random_finest};
    use marquetry_format::{ChartId, Document, Limits};

    /// The shader's look-up: texture coordinates and layer at (u, v) of a node.
    fn look_up(map: &TileMap, place: MapPlace, u: f64, v: f64) -> Option<[f64; 3]> {
        if place[1] == NO_TILES {
            return None;
        }
        let side = 1u32 << place[1];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to the number of cells"
        )]
        let cell = |t: f64| ((t * f64::from(side)) as u32).min(side - 1);
        let entry = map.entries[(place[0] + cell(v) * side + cell(u)) as usize].map(f64::from);
        let [x, y, width, height, layer, _, weight, _] = entry;
        (weight > 0.0).then_some([x + u * width, y + v * height, layer])
    }

    /// The same the long way: the deepest wanted resident tile over the place.
    fn deepest(
        index: &ColourIndex,
        store: &TileStore,
        wanted: &[TileId],
        node: NodeId,
        u: f64,
        v: f64,
    ) -> Option<[f64; 3]> {
        let nodes = f64::from(1u32 << node.level);
        let [u, v] = [
            (f64::from(node.x) + u) / nodes,
            (f64::from(node.y) + v) / nodes,
        ];
        let mut found = None;
        let mut tile = index.root(node.chart);
        let (mut x, mut y, mut tiles) = (0, 0, 1u32);
        while let Some(here) = tile {
            if let (Some(resident), true) = (store.get(here), wanted.contains(&here)) {
                let place = |slot: u32, t: f64, k: u32| {
                    let own = t * f64::from(tiles) - f64::from(k);
                    (f64::from(slot + MARGIN) + 8.0 * own) / f64::from(LAYER_SIZE)
                };
                let slot = resident.slot;
                found = Some([
                    place(slot.x, u, x),
                    place(slot.y, v, y),
                    f64::from(slot.layer),
                ]);
            }
            tiles *= 2;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to the number of tiles"
            )]
            let child = |t: f64| (t * f64::from(tiles)) as u32;
            (x, y) = (child(u), child(v));
            let quadrant = Quadrant(u8::try_from((x & 1) | (y & 1) << 1).unwrap());
            tile = index.child(here, quadrant);
        }
        found
    }

    #[test]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places within a node"
    )]
    fn entries_lead_to_the_deepest_tile_over_each_place() {
        let mut random = Random::new(2);
        let finest = random_finest(&mut random, &Shape::Cube.charts(5), 2, 5);
        let mut choose = Random::new(3);
        let mut has_child = |node: NodeId| node.level <= 4 && choose.below(5) > 0;
        let file = Shape::Cube.write_textured(&finest, &mut has_child).unwrap();
        let document = Document::open(&file, Limits::default()).unwrap();
        let mut index = ColourIndex::of(&document, Limits::default())
            .unwrap()
            .unwrap();
        index.load(&file).unwrap();
        let mut store = TileStore::default();
        let size = index.size(ChartId(0)).unwrap();
        let mut wanted = Vec::new();
        for tile in (0..index.tile_count()).map(TileId) {
            if random.below(3) > 0 {
                assert!(store.reserve(tile, size, u64::MAX, &IdSet::default()));
                store.insert(tile, Vec::new(), 0.0);
            }
            if random.below(8) > 0 {
                wanted.push(tile);
            }
        }
        let shown = Shown {
            index: &index,
            store: &store,
            is_wanted: |tile| wanted.contains(&tile),
            now: 1.0,
            fade_seconds: 0.0,
        };
        let (mut map, mut found) = (TileMap::default(), 0);
        for _ in 0..400 {
            let level = u8::try_from(random.below(4)).unwrap();
            let node = NodeId {
                chart: ChartId(random.below(6)),
                level,
                x: random.below(1 << level),
                y: random.below(1 << level),
            };
            let place = shown.add(&mut map, node);
            for _ in 0..20 {
                let (u, v) = (random.unit(), random.unit());
                let fast = look_up(&map, place, u, v);
                let naive = deepest(&index, &store, &wanted, node, u, v);
                found += usize::from(naive.is_some());
                match (fast, naive) {
                    (Some(a), Some(b)) => {
                        let far = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
                        assert!(far < 1e-5, "{node:?} at {u}, {v}: {a:?} {b:?}");
                    }
                    (a, b) => assert_eq!(a, b, "{node:?} at {u}, {v}"),
                }
            }
        }
        assert!(found > 4000, "{found}");
    }
}
