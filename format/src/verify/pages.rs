//! Checks of the decoded content: every page, and what holds between pages.

use super::{Report, WHOLE_READ_BYTES};
use crate::header::SectionKind;
use crate::parallel::map_ordered;
use crate::quadtree::MAX_LEVEL;
use crate::rules::{Border, Tally, Topology, smallest_cosine};
use crate::{
    Bounds, ByteSource, ChartId, Document, Error, LatticePoint, NodeId, PageEntry, PageId,
    PageSamples, Quadrant,
};

/// Cones may miss the true cosine by the rounding of `f32` axes.
const COSINE_TOLERANCE: f64 = 1e-6;

/// Adds all checks of pages to `report`; the index is loaded.
pub(super) fn check(document: &Document, source: &dyn ByteSource, report: &mut Report) {
    let (topology, levels) = topology_of(document);
    let sound = levels.failures.is_empty();
    report.add("page order", levels);
    if !sound {
        return;
    }
    let bytes = PageBytes::new(document, source);
    let charts: Vec<ChartId> = (0..document.chart_count()).map(ChartId).collect();
    let walks = map_ordered(&charts, |&chart| {
        let mut walk = Walk {
            document,
            bytes: &bytes,
            found: Found::default(),
        };
        walk.root(chart);
        walk.found
    });
    let mut found = Found::default();
    let mut borders: Vec<Option<Border>> = vec![None; topology.nodes.len()];
    for walk in walks {
        for (page, border) in walk.borders {
            if let Some(slot) = borders.get_mut(at(page.0)) {
                *slot = Some(border);
            }
        }
        found.decoded.merge(walk.decoded);
        found.bounds.merge(walk.bounds);
        found.cones.merge(walk.cones);
    }
    report.add("page checksums and decoding", found.decoded);
    report.add("glue both ways", topology.check_glue());
    report.add("shared borders bit-equal", topology.check_borders(&borders));
    report.add("balance across borders", topology.check_balance());
    let mut errors = topology.check_errors(|page| {
        document
            .page(PageId(page))
            .map_or(&[], |entry| entry.errors.as_slice())
    });
    check_base_errors(document, &mut errors);
    report.add("errors monotone up the tree", errors);
    report.add("bounds", found.bounds);
    report.add("normal cones", found.cones);
}

fn at(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

/// The trees, and whether their pages are stored level by level, not too deep.
fn topology_of(document: &Document) -> (Topology, Tally) {
    let mut tally = Tally::default();
    let mut topology = Topology {
        glue: document.charts.iter().map(|chart| chart.glue).collect(),
        nodes: (0..document.chart_count())
            .map(|chart| NodeId::root(ChartId(chart)))
            .collect(),
        ..Topology::default()
    };
    let mut level = 0;
    for page in 0..document.page_count() {
        let (Some(&node), Some(entry)) =
            (topology.nodes.get(at(page)), document.page(PageId(page)))
        else {
            tally.check(false, || format!("page {page} is no page's child"));
            break;
        };
        tally.check(node.level >= level, || {
            format!(
                "page {page} of level {} comes after level {level}",
                node.level
            )
        });
        level = node.level;
        let first_child = document.first_child(PageId(page));
        tally.check(first_child.is_none() || node.level < MAX_LEVEL, || {
            format!("page {page} has children below level {MAX_LEVEL}")
        });
        if let Some(first) = first_child {
            tally.check(at(first.0) == topology.nodes.len(), || {
                format!("the children of page {page} are not where its place in the order says")
            });
            if node.level < MAX_LEVEL {
                topology
                    .nodes
                    .extend((0..4).map(|quadrant| node.child(Quadrant(quadrant))));
            }
        }
        topology.first_children.push(first_child.map(|page| page.0));
        topology.resolutions.push(entry.resolution);
    }
    (topology, tally)
}

/// The errors in the front are those of the index.
fn check_base_errors(document: &Document, tally: &mut Tally) {
    for (page, chart) in (0u32..).zip(&document.charts) {
        let equal = document
            .page(PageId(page))
            .is_some_and(|entry| entry.errors.starts_with(&chart.base_errors));
        tally.check(equal, || {
            format!("the front and the index state other errors for chart {page}")
        });
    }
}

/// Where pages are read from.
struct PageBytes<'a> {
    source: &'a dyn ByteSource,
    /// Offset and bytes of the whole pages section, where it is small enough.
    whole: Option<(u64, Vec<u8>)>,
}

impl<'a> PageBytes<'a> {
    fn new(document: &Document, source: &'a dyn ByteSource) -> Self {
        let section = document.header().section(SectionKind::Pages).ok();
        let section = section.filter(|section| section.length() <= WHOLE_READ_BYTES);
        // A source that cannot give them all at once is asked page by page, and each failure reported.
        let whole = section.and_then(|section| {
            Some((
                section.range.start,
                source.read(section.range.clone()).ok()?,
            ))
        });
        Self { source, whole }
    }

    fn page(&self, entry: &PageEntry) -> Result<Vec<u8>, Error> {
        if let Some((offset, bytes)) = &self.whole {
            let start = usize::try_from(entry.offset.saturating_sub(*offset)).unwrap_or(usize::MAX);
            if let Some(page) = bytes.get(start..start.saturating_add(at(entry.length))) {
                return Ok(page.to_vec());
            }
        }
        Ok(self
            .source
            .read(entry.offset..entry.offset.saturating_add(u64::from(entry.length)))?)
    }
}

/// What the pages of a chart gave.
#[derive(Default)]
struct Found {
    borders: Vec<(PageId, Border)>,
    decoded: Tally,
    bounds: Tally,
    cones: Tally,
}

/// Decodes the pages of a chart, parents first.
struct Walk<'a> {
    document: &'a Document,
    bytes: &'a PageBytes<'a>,
    found: Found,
}

impl Walk<'_> {
    fn root(&mut self, chart: ChartId) {
        let page = PageId(chart.0);
        let Some(entry) = self.document.page(page) else {
            return;
        };
        let samples = self.bytes.page(entry).and_then(|bytes| {
            // The base may hold all of a chart; its empty page must still be sound.
            self.document.check_page(page, &bytes)?;
            self.document.decode_root(chart, &bytes)
        });
        self.take(page, &samples);
    }

    // Recursion is as deep as the tree, at most MAX_LEVEL.
    fn take(&mut self, page: PageId, samples: &Result<PageSamples, Error>) {
        let failure = || {
            samples
                .as_ref()
                .err()
                .map_or_else(String::new, |error| format!("page {}: {error}", page.0))
        };
        self.found.decoded.check(samples.is_ok(), failure);
        let (Ok(samples), Some(entry)) = (samples, self.document.page(page)) else {
            return;
        };
        self.found.borders.push((page, Border::new(samples)));
        self.check_bounds(page, entry, samples);
        let smallest = smallest_cosine(samples, entry.cone.axis);
        let inside = smallest
            .is_none_or(|smallest| smallest >= f64::from(entry.cone.cos) - COSINE_TOLERANCE);
        self.found.cones.check(inside, || {
            format!(
                "page {}: a normal at cosine {smallest:?} is outside the cone of cosine {}",
                page.0, entry.cone.cos
            )
        });
        let Some(first) = self.document.first_child(page) else {
            return;
        };
        for quadrant in 0..4 {
            let child = PageId(first.0.saturating_add(u32::from(quadrant)));
            let Some(entry) = self.document.page(child) else {
                continue;
            };
            let decoded = self.bytes.page(entry).and_then(|bytes| {
                self.document
                    .decode_child(child, Quadrant(quadrant), samples, &bytes)
            });
            self.take(child, &decoded);
        }
    }

    fn check_bounds(&mut self, page: PageId, entry: &PageEntry, samples: &PageSamples) {
        let outside = samples
            .positions
            .iter()
            .find(|point| !contains(&entry.bounds, point));
        self.found.bounds.check(outside.is_none(), || {
            format!(
                "page {}: sample {outside:?} is outside {:?}",
                page.0, entry.bounds
            )
        });
        let Some(first) = self.document.first_child(page) else {
            return;
        };
        for child in first.0..first.0.saturating_add(4) {
            let inside = self.document.page(PageId(child)).is_some_and(|child| {
                contains(&entry.bounds, &child.bounds.min)
                    && contains(&entry.bounds, &child.bounds.max)
            });
            self.found.bounds.check(inside, || {
                format!(
                    "the bounds of page {child} leave those of its parent {}",
                    page.0
                )
            });
        }
    }
}

fn contains(bounds: &Bounds, point: &LatticePoint) -> bool {
    bounds.min.iter().zip(point).all(|(min, c)| min <= c)
        && bounds.max.iter().zip(point).all(|(max, c)| c <= max)
}
