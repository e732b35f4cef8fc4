//! A file in memory, of which everything is decoded at once: how fast that is (`cargo xtask bench-decode`).

use marquetry_format::{
    ChartId, ClusterId, ClusterNode, Document, Error, Limits, PageId, PageSamples,
};
#[cfg(target_arch = "wasm32")]
use wasm_bindgen::prelude::*;

/// A file, open, with its whole index.
#[derive(Debug)]
#[cfg_attr(target_arch = "wasm32", wasm_bindgen)]
pub struct Whole {
    document: Document,
    bytes: Vec<u8>,
}

impl Whole {
    /// Opens the file that is `bytes`.
    ///
    /// # Errors
    /// When it is none, or damaged.
    pub fn open(bytes: Vec<u8>) -> Result<Self, Error> {
        let mut document = Document::open(&bytes, Limits::default())?;
        document.load_index(&bytes)?;
        Ok(Self { document, bytes })
    }

    /// Decodes all pages of charts, one after the other; their samples, 33² of a page.
    ///
    /// # Errors
    /// When one is damaged.
    pub fn decode_charts(&self) -> Result<usize, Error> {
        let charts = (0..self.document.chart_count()).map(ChartId);
        charts.map(|id| self.decode_chart(id)).sum()
    }

    /// Decodes all clusters, one after the other; their vertices.
    ///
    /// # Errors
    /// When one is damaged.
    pub fn decode_clusters(&self) -> Result<usize, Error> {
        let clusters = self.document.clusters.iter();
        let nodes = clusters.flat_map(|clusters| &clusters.nodes);
        let decode = |(id, node): (ClusterId, &ClusterNode)| {
            let mesh = self.document.decode_cluster(id, self.part(&node.range))?;
            Ok(mesh.positions.len())
        };
        (0..).map(ClusterId).zip(nodes).map(decode).sum()
    }

    fn decode_chart(&self, id: ChartId) -> Result<usize, Error> {
        let root = PageId(id.0);
        let samples = self.document.decode_root(id, self.page(root))?;
        Ok(samples.positions.len() + self.decode_below(root, &samples)?)
    }

    fn decode_below(&self, page: PageId, samples: &PageSamples) -> Result<usize, Error> {
        let mut decoded = 0;
        let Some(first) = self.document.first_child(page) else {
            return Ok(decoded);
        };
        for child in (first.0..).take(4).map(PageId) {
            let Some(quadrant) = self.document.quadrant(child) else {
                continue;
            };
            let own = self
                .document
                .decode_child(child, quadrant, samples, self.page(child))?;
            decoded += own.positions.len() + self.decode_below(child, &own)?;
        }
        Ok(decoded)
    }

    fn page(&self, page: PageId) -> &[u8] {
        let range = self.document.page_range(page).unwrap_or_default();
        self.part(&range)
    }

    fn part(&self, range: &std::ops::Range<u64>) -> &[u8] {
        let [start, end] = [range.start, range.end].map(|at| usize::try_from(at).unwrap_or(0));
        self.bytes.get(start..end).unwrap_or_default()
    }
}

#[cfg(target_arch = "wasm32")]
#[wasm_bindgen]
impl Whole {
    /// As [`Whole::open`].
    ///
    /// # Errors
    /// As there, in words.
    #[wasm_bindgen(constructor)]
    pub fn of(bytes: Vec<u8>) -> Result<Whole, JsError> {
        Ok(Self::open(bytes)?)
    }

    /// As [`Whole::decode_charts`].
    ///
    /// # Errors
    /// As there, in words.
    #[wasm_bindgen(js_name = decodeCharts)]
    pub fn decode_charts_here(&self) -> Result<usize, JsError> {
        Ok(self.decode_charts()?)
    }

    /// As [`Whole::decode_clusters`].
    ///
    /// # Errors
    /// As there, in words.
    #[wasm_bindgen(js_name = decodeClusters)]
    pub fn decode_clusters_here(&self) -> Result<usize, JsError> {
        Ok(self.decode_clusters()?)
    }
}
