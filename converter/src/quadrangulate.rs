//! Regions into four-sided patches with shared borders.
//!
//! The regions are the dual of a coarse triangulation, so a region with n neighbours is an n-gon. It is flattened to a
//! convex n-gon (Tutte, "How to Draw a Graph", 1963; Floater, "Parametrization and smooth approximation of surface
//! triangulations", 1997) and cut along the straight spokes from its centre to the middles of its sides: the preimages
//! of the spokes are simple and meet only in the centre, so no path search is needed. Every corner of the region then
//! has its own quad: centre, middle of a side, corner, middle of the next side.
//!
//! Limit: a protrusion inside a region shrinks to a speck of the polygon; it is reported for the region to be split.

mod arcs;
mod region;
mod spokes;
#[cfg(test)]
mod tests;

use crate::atlas::patch::{Border, Patch};
use crate::mesh::ManifoldMesh;
use crate::parameterize::Flat;
use crate::segment::Segmentation;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Four-sided patches and the borders that they share.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// One patch a chart-to-be.
    pub patches: Vec<Patch>,
    /// Border curves; a border is used by one side (open) or two (glued).
    pub borders: Vec<Border>,
    /// Regions that the patches were cut from.
    pub regions: u32,
    /// Vertices of the mesh around which a flattening has shrunk the surface too much: tips of protrusions, at which to
    /// split the regions.
    pub specks: Vec<u32>,
}

/// A region that could not be cut into quads.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QuadrangulateError {
    /// The labels do not have the structure that [`Segmentation`] promises.
    #[error("region {region}: {fault}")]
    Structure {
        /// The region.
        region: u32,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// The flattened region folds over itself, so a spoke has no simple preimage.
    #[error("region {region} ({triangles} triangles) cannot be flattened without folds")]
    Folded {
        /// The region.
        region: u32,
        /// Its triangles.
        triangles: usize,
    },
}

/// Flattenings by the content of their regions: when some regions are split the others stay as they are.
#[derive(Debug, Default)]
pub struct Flattenings(HashMap<u128, Arc<Flat>>);

/// Cuts every region of `segmentation` into as many quads as it has corners.
///
/// Regions whose flattening is in `known` are not flattened again; afterwards it holds those of this segmentation.
///
/// # Errors
/// When the labels break the promises of [`Segmentation`], or a region's flattening folds.
pub fn quadrangulate(
    mesh: &ManifoldMesh,
    segmentation: &Segmentation,
    known: &mut Flattenings,
) -> Result<Layout, QuadrangulateError> {
    let arcs::Cut {
        points,
        arcs,
        regions,
    } = arcs::cut(mesh, segmentation)?;
    let mut borders: Vec<Border> = Vec::with_capacity(2 * arcs.len());
    for arc in &arcs {
        borders.push(points.border(&arc.points[..=arc.middle]));
        borders.push(points.border(&arc.points[arc.middle..]));
    }
    let cut: Vec<spokes::CutRegion> = regions
        .into_par_iter()
        .enumerate()
        .map(|(id, outline)| {
            let id = u32::try_from(id).unwrap_or(u32::MAX);
            let region = region::Region::new(id, mesh.positions.len(), &points, &arcs, &outline)?;
            spokes::cut(region, &known.0)
        })
        .collect::<Result<_, _>>()?;
    known.0 = cut.iter().map(|c| (c.key, c.flat.clone())).collect();
    let specks = cut.iter().filter_map(|c| c.speck).collect();
    let mut patches = Vec::with_capacity(cut.iter().map(|c| c.patches.len()).sum());
    for mut region in cut {
        let first_spoke = u32::try_from(borders.len()).unwrap_or(u32::MAX);
        for patch in &mut region.patches {
            patch.borders[0].0 += first_spoke;
            patch.borders[3].0 += first_spoke;
        }
        borders.append(&mut region.spokes);
        patches.append(&mut region.patches);
    }
    Ok(Layout {
        patches,
        borders,
        regions: segmentation.regions,
        specks,
    })
}
