//! Charts of a surface, from its handles to their samples.

use super::{Conversion, ConvertError, Frame};
use crate::atlas::patch::Patch;
use crate::atlas::{build, chart_graph};
use crate::mesh::{ManifoldMesh, NONE, handles};
use crate::parameterize::{self, Parametrization};
use crate::quadrangulate::{self, Layout};
use crate::report::{AreaReport, LayoutReport};
use crate::segment::{self, Segmentation};
use crate::texture::stage::Textures;
use marquetry_format::writer::ColourInput;
use rayon::prelude::*;

/// Charts, colour tiles, and what the layout came to.
#[derive(Default)]
pub(super) struct Charts {
    pub(super) atlas: build::Atlas,
    pub(super) colour: Option<ColourInput>,
    pub(super) layout: LayoutReport,
}

/// Handles are cut where a cap stays within so many targets of the surface.
const CAP_OVER_TARGET: f64 = 25.0;

/// Part of the squared error that all caps together may take. Two round caps of radius r add about 2 r⁴ to its integral.
const CAP_SHARE: f64 = 0.06;

/// Rounds of splitting regions at protrusions; each halves what is left of them.
const SPLIT_ROUNDS: u32 = 3;

impl Conversion<'_> {
    /// Charts of `mesh`, all the way to their samples; none where it has no triangles, `None` where that takes more than
    /// `most_samples`. Handles are cut in the mesh; triangles of caps come last and are taken off again.
    pub(super) fn charts(
        &mut self,
        mesh: &mut ManifoldMesh,
        textures: &Textures,
        frame: &Frame,
        most_samples: u64,
    ) -> Result<Option<Charts>, ConvertError> {
        if mesh.triangles.is_empty() {
            return Ok(Some(Charts::default()));
        }
        self.begin("handles")?;
        let triangles = mesh.triangles.len();
        let cut = handles::cut(mesh, cap_reach(mesh, frame.target));
        self.begin("segment")?;
        let segmentation = segment::segment(
            mesh,
            target_regions(mesh.triangles.len(), handle_count(mesh)),
        );
        self.begin("quadrangulate")?;
        let Layout {
            mut patches,
            borders,
            regions,
            ..
        } = self.layout(mesh, segmentation)?;
        // Caps are no part of the source.
        mesh.triangles.truncate(triangles);
        let layout = LayoutReport {
            regions,
            chart_area: AreaReport::of(patches.par_iter().map(Patch::area).collect()),
            handles_cut: cut.handles,
            cap_triangles: cut.cap_triangles,
            cap_distance_rel: cut.distance / frame.diagonal.max(f64::MIN_POSITIVE),
        };
        let extent = (frame.max - frame.min).max_element();
        chart_graph::sort_along_curve(&mut patches, frame.min, extent.max(f64::MIN_POSITIVE));
        let glue = chart_graph::glue(&patches, borders.len());

        self.begin("parametrize")?;
        let parametrizations: Vec<Parametrization> = patches
            .par_iter_mut()
            .map(|patch| parameterize::parameterize(patch, &borders))
            .collect();

        self.begin("resample")?;
        let progress = self.stages.progress;
        let surface = build::Surface {
            patches: &patches,
            parametrizations: &parametrizations,
            borders: &borders,
            glue: &glue,
            lattice: frame.lattice,
            colours: frame.has_colours,
            target: frame.target,
            cap_distance: cut.distance,
        };
        let Some(atlas) = build::build(&surface, most_samples, &|done| progress.fraction(done))
        else {
            return Ok(None);
        };
        if textures.has_images() {
            self.begin("textures")?;
        }
        let colour = textures
            .tiles(&patches, &parametrizations, &glue, &|done| {
                progress.fraction(done);
            })
            .map_err(|source| self.texture_error(source))?;
        Ok(Some(Charts {
            atlas,
            colour,
            layout,
        }))
    }

    /// Quads of the regions; regions with protrusions that no flattening shows are split.
    fn layout(
        &self,
        mesh: &ManifoldMesh,
        mut segmentation: Segmentation,
    ) -> Result<Layout, ConvertError> {
        let quadrangulate = |segmentation: &Segmentation| {
            quadrangulate::quadrangulate(mesh, segmentation).map_err(|source| {
                ConvertError::Layout {
                    path: self.input.to_owned(),
                    source,
                }
            })
        };
        let mut layout = quadrangulate(&segmentation)?;
        let mut split = vec![false; mesh.positions.len()];
        for _ in 0..SPLIT_ROUNDS {
            if layout.specks.is_empty() {
                break;
            }
            let Some(parts) = segment::split_at(mesh, &segmentation, &layout.specks, &mut split)
            else {
                break;
            };
            segmentation = parts;
            layout = quadrangulate(&segmentation)?;
        }
        if !layout.specks.is_empty() {
            tracing::warn!(
                regions = layout.specks.len(),
                "protrusions stay that are too long to be sampled well"
            );
        }
        Ok(layout)
    }
}

/// Regions wanted: about 30 for 100 k triangles, 250 for 5 M, and three for every handle.
///
/// Handles force regions of their own whatever is wanted; asking for too few makes the others ragged (the dragon, 55
/// handles: 12% of its area lies in ragged regions at 120 wanted, 2% at 250).
fn target_regions(triangles: usize, handles: usize) -> u32 {
    let regions = 30.0 * (triangles as f64 / 1e5).powf(0.55) + 3.0 * handles as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let regions = regions.round().clamp(4.0, 1e6) as u32;
    regions
}

/// How far from the surface a cap may be, where every handle got such a one.
fn cap_reach(mesh: &ManifoldMesh, target: f64) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    let each = CAP_SHARE * target.powi(2) * total / handle_count(mesh).max(1) as f64;
    (CAP_OVER_TARGET * target).min((each / 2.0).powf(0.25))
}

/// Handles of all components together, from the Euler characteristic; 0 where cuts make that meaningless.
fn handle_count(mesh: &ManifoldMesh) -> usize {
    let open = mesh.twins.iter().filter(|&&t| t == NONE).count();
    let edges = mesh.twins.len().midpoint(open);
    let (_, components) = mesh.components();
    let loops = boundary_loops(mesh);
    // V - E + F = 2 (components - handles) - loops
    let vertices_and_faces = mesh.positions.len() + mesh.triangles.len() + loops;
    let doubled = (2 * components as usize + edges).saturating_sub(vertices_and_faces);
    doubled / 2
}

fn boundary_loops(mesh: &ManifoldMesh) -> usize {
    let corner = |h: usize| mesh.triangles[h / 3][h % 3];
    let mut following = vec![NONE; mesh.positions.len()];
    for h in (0..mesh.twins.len()).filter(|&h| mesh.twins[h] == NONE) {
        following[corner(h) as usize] = corner(h / 3 * 3 + (h % 3 + 1) % 3);
    }
    let mut loops = 0;
    for start in 0..following.len() {
        let mut at = start;
        let mut length = 0;
        while following[at] != NONE {
            at = std::mem::replace(&mut following[at], NONE) as usize;
            length += 1;
        }
        loops += usize::from(length > 0);
    }
    loops
}
