//! Checks of the colour tiles, where a file has them.

use super::{Report, in_words};
use crate::parallel::map_ordered;
use crate::quadtree::MAX_LEVEL;
use crate::rules::Tally;
use crate::{ByteSource, ChartId, ColourIndex, Document, Error, Limits, Quadrant, TileId};

/// Adds all checks of colour tiles to `report`.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let loaded = ColourIndex::of(document, Limits::default()).and_then(|index| match index {
        None => Ok(None),
        Some(mut index) => index.load(source).map(|()| Some(index)),
    });
    let mut opened = Tally::default();
    let index = match loaded {
        Ok(None) => return,
        Ok(Some(index)) => {
            opened.check(true, String::new);
            Some(index)
        }
        Err(error) => {
            opened.check(false, || error.to_string());
            None
        }
    };
    report.add("colour index", opened);
    let Some(index) = index else { return };
    let (tiles, order) = in_order(document, &index);
    let sound = order.failures.is_empty();
    report.add("colour tile order", order);
    if !sound {
        return;
    }
    let decoded = map_ordered(&tiles, |&(chart, tile)| decode(&index, source, chart, tile));
    let mut tally = Tally::default();
    for ((_, tile), result) in tiles.iter().zip(decoded) {
        tally.check(result.is_ok(), || {
            format!("colour tile {}: {}", tile.0, in_words(result))
        });
    }
    report.add("colour tile checksums and decoding", tally);
}

fn decode(
    index: &ColourIndex,
    source: &dyn ByteSource,
    chart: ChartId,
    tile: TileId,
) -> Result<(), Error> {
    let range = index.tile_range(tile).ok_or(Error::NoSuch {
        what: "colour tile",
        number: tile.0,
    })?;
    index.decode(chart, tile, &source.read(range)?).map(|_| ())
}

/// Every tile with its chart, level by level; and whether that is the order of their numbers, not too deep.
fn in_order(document: &Document, index: &ColourIndex) -> (Vec<(ChartId, TileId)>, Tally) {
    let mut tally = Tally::default();
    let charts = (0..document.chart_count()).map(ChartId);
    let mut level: Vec<(ChartId, TileId)> = charts
        .filter_map(|chart| Some((chart, index.root(chart)?)))
        .collect();
    let (mut all, mut depth) = (Vec::new(), 0);
    while !level.is_empty() && depth <= MAX_LEVEL {
        let mut below = Vec::new();
        for &(chart, tile) in &level {
            let expected = u32::try_from(all.len()).unwrap_or(u32::MAX);
            tally.check(tile.0 == expected, || {
                format!("tile {} lies where tile {expected} should", tile.0)
            });
            all.push((chart, tile));
            below.extend((0..4).filter_map(|q| Some((chart, index.child(tile, Quadrant(q))?))));
        }
        level = below;
        depth = depth.saturating_add(1);
    }
    tally.check(level.is_empty(), || {
        format!("there are tiles below level {MAX_LEVEL}")
    });
    let count = u64::from(index.tile_count());
    tally.check(all.len() as u64 == count, || {
        format!("{} tiles hang in the trees, {count} are stored", all.len())
    });
    (all, tally)
}
