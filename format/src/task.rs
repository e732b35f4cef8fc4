//! Decoding apart from the document: a page or an image with everything that decoding it takes, for another thread or a
//! browser's worker.

use crate::cluster::{ClusterNode, directory};
use crate::codec::page::{self, Coding};
use crate::colour::decode_frame;
use crate::{ClusterMesh, Error, PageId, PageSamples, Quadrant, TileTexels};
use std::sync::Arc;

/// A page to decode; [`Document`](crate::Document) makes it.
#[derive(Debug, Clone)]
pub struct PageTask {
    pub(crate) coding: Coding,
    pub(crate) what: What,
    pub(crate) bytes: Vec<u8>,
}

/// What a page is, and what it is decoded from.
#[derive(Debug, Clone)]
pub(crate) enum What {
    /// A chart's root page, from its part of the base.
    Root { base: PageSamples, resolution: u8 },
    /// A page below a root, from its parent's samples.
    Child {
        page: PageId,
        quadrant: Quadrant,
        parent: Arc<PageSamples>,
    },
    /// The mesh of a cluster, which its checksum has still to be compared of.
    Cluster {
        node: Box<ClusterNode>,
        content_id: [u8; 16],
    },
}

/// A decoded page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DecodedPage {
    /// A chart's.
    Samples(PageSamples),
    /// A cluster's.
    Cluster(ClusterMesh),
}

impl PageTask {
    /// Decodes the page.
    ///
    /// # Errors
    /// When the bytes do not match their checksum or do not decode to the exact size.
    pub fn decode(&self) -> Result<DecodedPage, Error> {
        let Self {
            coding,
            what,
            bytes,
        } = self;
        match what {
            What::Root { base, resolution } => page::decode_root(*coding, base, *resolution, bytes),
            What::Child {
                page,
                quadrant,
                parent,
            } => decode_child(*coding, *page, *quadrant, parent, bytes),
            What::Cluster { node, content_id } => {
                return directory::decode_node(*coding, node, content_id, bytes)
                    .map(DecodedPage::Cluster);
            }
        }
        .map(DecodedPage::Samples)
    }
}

pub(crate) fn decode_child(
    coding: Coding,
    page: PageId,
    quadrant: Quadrant,
    parent: &PageSamples,
    bytes: &[u8],
) -> Result<PageSamples, Error> {
    page::decode_child(coding, quadrant, parent, bytes).unwrap_or(Err(Error::WrongParent {
        page: page.0,
        resolution: parent.resolution,
    }))
}

/// A VP8 key frame to decode: a colour tile, or a cluster's texture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageTask {
    /// Texels across that the frame must have.
    pub width: u32,
    /// Texels down, as `width`.
    pub height: u32,
    /// The frame.
    pub frame: Vec<u8>,
}

impl ImageTask {
    /// Decodes the image.
    ///
    /// # Errors
    /// When the frame is no key frame of exactly that size.
    pub fn decode(&self) -> Result<TileTexels, Error> {
        decode_frame([self.width, self.height], &self.frame)
    }
}
