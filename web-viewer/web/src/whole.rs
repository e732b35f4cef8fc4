//! A file in memory, of which everything is decoded at once: how fast that is (`cargo xtask bench-decode`).

use marquetry_format::{ChartId, ClusterId, Document, Error, Limits, PageId, PageSamples};
#[cfg(target_arch = "wasm32")]
use wasm_bindgen::prelude::*;

/// A file, open, with its whole index.
#[derive(Debug)]
#[cfg_attr(target_arch = "wasm32", wasm_bindgen)]
pub struct Whole {
    document: Document,
    bytes: Vec<u8>,
}

/// What was decoded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Decoded {
    /// Samples of charts: 33² of a page.
    pub samples: usize,
    /// Vertices of clusters.
    pub vertices: usize,
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

    /// Decodes all pages and all clusters, one after the other.
    ///
    /// # Errors
    /// When one is damaged.
    pub fn decode(&self) -> Result<Decoded, Error> {
        let mut decoded = Decoded::default();
        for id in (0..self.document.chart_count()).map(ChartId) {
            let root = PageId(id.0);
            let samples = self.document.decode_root(id, self.page(root))?;
            decoded.samples += samples.positions.len();
            self.decode_below(root, &samples, &mut decoded)?;
        }
        for (id, node) in (0..).map(ClusterId).zip(
            self.document
                .clusters
                .iter()
                .flat_map(|clusters| &clusters.nodes),
        ) {
            let mesh = self.document.decode_cluster(id, self.part(&node.range))?;
            decoded.vertices += mesh.positions.len();
        }
        Ok(decoded)
    }

    fn decode_below(
        &self,
        page: PageId,
        samples: &PageSamples,
        decoded: &mut Decoded,
    ) -> Result<(), Error> {
        let Some(first) = self.document.first_child(page) else {
            return Ok(());
        };
        for child in (first.0..).take(4).map(PageId) {
            let Some(quadrant) = self.document.quadrant(child) else {
                continue;
            };
            let own = self
                .document
                .decode_child(child, quadrant, samples, self.page(child))?;
            decoded.samples += own.positions.len();
            self.decode_below(child, &own, decoded)?;
        }
        Ok(())
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

    /// As [`Whole::decode`]: samples, and vertices.
    ///
    /// # Errors
    /// As there, in words.
    #[wasm_bindgen(js_name = decode)]
    pub fn decode_here(&self) -> Result<Vec<u32>, JsError> {
        let Decoded { samples, vertices } = self.decode()?;
        let count = |n| u32::try_from(n).unwrap_or(u32::MAX);
        Ok(vec![count(samples), count(vertices)])
    }
}
