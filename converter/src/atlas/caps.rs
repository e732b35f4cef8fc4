//! Where a chart holds caps of cut handles, which are no part of the source.
//!
//! Errors are taken against the patch; what the patch has beyond the source comes on top, where it is.

use super::patch::Patch;
use crate::parameterize::Parametrization;
use glam::DVec2;
use marquetry_format::NodeId;

/// The bounding square of one cap triangle in (u, v).
#[derive(Debug, Clone, Copy)]
pub(super) struct Square {
    low: DVec2,
    high: DVec2,
}

impl Square {
    /// Whether a node holds part of it.
    pub(super) fn touches(self, node: NodeId) -> bool {
        let size = f64::from(1u32 << node.level).recip();
        let low = DVec2::new(f64::from(node.x), f64::from(node.y)) * size;
        self.high.cmpge(low).all() && self.low.cmple(low + size).all()
    }
}

/// Squares of all cap triangles of a patch.
pub(super) fn squares(patch: &Patch, parametrization: &Parametrization) -> Vec<Square> {
    let inside = |&v: &u32| patch.attributes[v as usize].cap > 0.0;
    let caps = patch.triangles.iter().filter(|t| t.iter().any(inside));
    caps.map(|t| {
        let [a, b, c] = t.map(|v| parametrization.uv[v as usize]);
        Square {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
        }
    })
    .collect()
}
