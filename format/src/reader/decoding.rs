//! Decoding the pages of an open file, here or elsewhere.

use super::document::{Document, at};
use crate::cluster::directory;
use crate::codec::page;
use crate::task::{self, PageTask, What};
use crate::{ChartId, ClusterId, ClusterMesh, ClusterNode, Error, PageId, PageSamples, Quadrant};
use std::sync::Arc;

impl Document {
    /// Checks and decodes a root page; needs nothing but the base and the page's index block, and not even that
    /// where the base holds all of the chart.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode to the exact size.
    pub fn decode_root(&self, chart: ChartId, bytes: &[u8]) -> Result<PageSamples, Error> {
        let (resolution, base) = self.check_root(chart, bytes)?;
        page::decode_root(self.coding(), base, resolution, bytes)
    }

    /// Checks and decodes a page below the root from its parent's samples.
    ///
    /// # Errors
    /// As [`Document::decode_root`].
    pub fn decode_child(
        &self,
        page: PageId,
        quadrant: Quadrant,
        parent: &PageSamples,
        bytes: &[u8],
    ) -> Result<PageSamples, Error> {
        self.check_child(page, quadrant, bytes)?;
        task::decode_child(self.coding(), page, quadrant, parent, bytes)
    }

    /// Checks and decodes the mesh of a cluster from the bytes of its page (or, for the root, of its range).
    ///
    /// # Errors
    /// When there is no such cluster, or the bytes do not match their checksum or do not decode to the exact size.
    pub fn decode_cluster(&self, id: ClusterId, bytes: &[u8]) -> Result<ClusterMesh, Error> {
        let node = self.cluster_node(id)?;
        directory::decode_node(self.coding(), node, &self.content_id, bytes)
    }

    /// [`Document::decode_root`] as a task of its own, the checksum compared.
    ///
    /// # Errors
    /// When the bytes do not match their checksum.
    pub fn root_task(&self, chart: ChartId, bytes: Vec<u8>) -> Result<PageTask, Error> {
        let (resolution, base) = self.check_root(chart, &bytes)?;
        let base = base.clone();
        Ok(self.task(What::Root { base, resolution }, bytes))
    }

    /// [`Document::decode_child`] as a task of its own, the checksum compared.
    ///
    /// # Errors
    /// When the bytes do not match their checksum.
    pub fn child_task(
        &self,
        page: PageId,
        quadrant: Quadrant,
        parent: Arc<PageSamples>,
        bytes: Vec<u8>,
    ) -> Result<PageTask, Error> {
        self.check_child(page, quadrant, &bytes)?;
        let what = What::Child {
            page,
            quadrant,
            parent,
        };
        Ok(self.task(what, bytes))
    }

    /// [`Document::decode_cluster`] as a task of its own.
    ///
    /// # Errors
    /// When there is no such cluster.
    pub fn cluster_task(&self, id: ClusterId, bytes: Vec<u8>) -> Result<PageTask, Error> {
        let what = What::Cluster {
            node: Box::new(self.cluster_node(id)?.clone()),
            content_id: self.content_id,
        };
        Ok(self.task(what, bytes))
    }

    fn task(&self, what: What, bytes: Vec<u8>) -> PageTask {
        PageTask {
            coding: self.coding(),
            what,
            bytes,
        }
    }

    fn cluster_node(&self, id: ClusterId) -> Result<&ClusterNode, Error> {
        let tree = self.clusters.as_ref();
        tree.and_then(|tree| tree.node(id)).ok_or(Error::NoSuch {
            what: "cluster",
            number: id.0,
        })
    }

    /// The finest resolution of a chart's root page and what it is decoded from, the checksum compared.
    fn check_root(&self, chart: ChartId, bytes: &[u8]) -> Result<(u8, &PageSamples), Error> {
        let parts = self.charts.get(at(chart.0)).zip(self.base.get(at(chart.0)));
        let (info, base) = parts.ok_or(Error::NoSuch {
            what: "chart",
            number: chart.0,
        })?;
        if info.resolution > base.resolution {
            self.check_page(PageId(chart.0), bytes)?;
        }
        Ok((info.resolution, base))
    }

    fn check_child(&self, page: PageId, quadrant: Quadrant, bytes: &[u8]) -> Result<(), Error> {
        self.check_page(page, bytes)?;
        let expected = self.quadrant(page).ok_or(Error::NoSuch {
            what: "page below a root",
            number: page.0,
        })?;
        if expected != quadrant {
            let (expected, found) = (u64::from(expected.0), u64::from(quadrant.0));
            return Err(Error::Mismatch {
                what: "quadrant of a page",
                expected,
                found,
            });
        }
        Ok(())
    }
}
