//! Charts of a surface, from its handles to their samples.

use super::{Conversion, ConvertError, Frame};
use crate::atlas::patch::Patch;
use crate::atlas::{build, chart_graph};
use crate::cluster::select::{DROPPED, Selection};
use crate::mesh::fingers::{self, Fingers};
use crate::mesh::{ManifoldMesh, NONE, caps, handles};
use crate::parameterize::{self, Parametrization};
use crate::quadrangulate::{self, Flattenings, Layout};
use crate::report::{AreaReport, LayoutReport};
use crate::segment::{self, Segmentation};
use crate::texture::stage::Textures;
use marquetry_format::writer::ColourInput;
use rayon::prelude::*;

/// Charts, colour tiles, and what the layout came to.
#[derive(Default)]
pub(super) struct Charted {
    pub(super) atlas: build::Atlas,
    pub(super) colour: Option<ColourInput>,
    pub(super) layout: LayoutReport,
}

/// Handles and fingers are cut where a cap stays within so many targets of the surface.
const CAP_OVER_TARGET: f64 = 25.0;

/// Part of the squared error that all caps of handles together may take, and those of fingers.
const CAP_SHARE: f64 = 0.03;

/// Rounds of splitting regions at protrusions; each halves what is left of them.
const SPLIT_ROUNDS: u32 = 3;

/// What was cut off a surface before charts are made of it, and the caps that closed it.
pub(super) struct Caps {
    handles: caps::Caps,
    fingers: caps::Caps,
    /// Triangles of the surface that were imported; those after them are caps.
    pub(super) source_triangles: usize,
}

impl Caps {
    /// Bound of the distance from any point of a cap to the imported surface.
    fn distance(&self) -> f64 {
        self.handles.distance.max(self.fingers.distance)
    }

    /// About what the caps add to the integral of the squared error: both of a handle are seen, and one of a finger.
    fn squares(&self) -> f64 {
        2.0 * self.handles.squares + self.fingers.squares
    }
}

impl Conversion<'_> {
    /// Cuts handles, and where there are no images fingers, which become small components.
    pub(super) fn cut(
        &mut self,
        selection: &mut Selection,
        textures: &Textures,
        frame: &Frame,
    ) -> Result<Caps, ConvertError> {
        self.begin("handles")?;
        let mesh = &mut selection.rest;
        let mut source_triangles = mesh.triangles.len();
        let (reach, budget) = cap_reach(mesh, frame.target);
        // Each handle gets two caps.
        let each = budget / (2 * handle_count(mesh).max(1)) as f64;
        let handles = handles::cut(mesh, reach.min(caps::reach(each)));
        // Not measured with images: no textured scan at hand has any.
        if textures.has_images() {
            return Ok(Caps {
                handles,
                fingers: caps::Caps::default(),
                source_triangles,
            });
        }
        let Fingers { caps: fingers, of } = fingers::cut(mesh, reach, budget);
        if fingers.loops > 0 {
            let is_source = |t: usize| t < source_triangles;
            let taken = (0..source_triangles).filter(|&t| of[t] != NONE).count();
            selection.take(|t| {
                if is_source(t) || of[t] == NONE {
                    of[t]
                } else {
                    DROPPED
                }
            });
            source_triangles -= taken;
        }
        Ok(Caps {
            handles,
            fingers,
            source_triangles,
        })
    }

    /// Charts of `mesh`, all the way to their samples; none where it has no triangles, `None` where that takes more than
    /// `most_samples`.
    pub(super) fn charts(
        &mut self,
        mesh: &ManifoldMesh,
        caps: &Caps,
        textures: &Textures,
        frame: &Frame,
        most_samples: u64,
    ) -> Result<Option<Charted>, ConvertError> {
        if mesh.triangles.is_empty() {
            return Ok(Some(Charted::default()));
        }
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
        let layout = LayoutReport {
            regions,
            chart_area: AreaReport::of(patches.par_iter().map(Patch::area).collect()),
            handles_cut: caps.handles.loops,
            fingers_cut: caps.fingers.loops,
            cap_triangles: mesh.triangles.len() - caps.source_triangles,
            cap_distance_rel: caps.distance() / frame.diagonal.max(f64::MIN_POSITIVE),
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
            distance: frame.decimated.bound,
            cap_distance: caps.distance(),
            cap_squares: caps.squares(),
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
        Ok(Some(Charted {
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
        let mut known = Flattenings::default();
        let mut quadrangulate = |segmentation: &Segmentation| {
            quadrangulate::quadrangulate(mesh, segmentation, &mut known).map_err(|source| {
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

/// How far from the surface caps may be, and what they may all together add to the integral of the squared error.
fn cap_reach(mesh: &ManifoldMesh, target: f64) -> (f64, f64) {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    (CAP_OVER_TARGET * target, CAP_SHARE * target.powi(2) * total)
}

/// Handles of all components together, from the Euler characteristic; 0 where cuts make that meaningless.
fn handle_count(mesh: &ManifoldMesh) -> usize {
    let open = mesh.twins.iter().filter(|&&t| t == NONE).count();
    let edges = mesh.twins.len().midpoint(open);
    let (_, components) = mesh.components();
    let loops = mesh.boundary_loops().len();
    // V - E + F = 2 (components - handles) - loops
    let vertices_and_faces = mesh.positions.len() + mesh.triangles.len() + loops;
    let doubled = (2 * components as usize + edges).saturating_sub(vertices_and_faces);
    doubled / 2
}
