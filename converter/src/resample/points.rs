//! Points of the source that stand for its area.
//!
//! Triangles that are large against the cells are cut along them, smaller ones are halved a few times; every piece has the
//! three points of the quadrature rule that is exact for quadratic functions (Strang and Fix, 1973), so the mean square of
//! a height that is linear over a piece comes out exactly.
//!
//! Limit: a triangle of up to [`WHOLE`] cells may reach over several facets of the image; there the mean is an estimate.
//! Guaranteed errors come from [`super::errors`].

use super::Window;
use super::overlay::{Place, Scratch, visit};
use super::surfaces::{Image, Source};
use super::tighten::unit_normal;
use glam::{DVec2, DVec3};

/// Extent in cells, the longest side's, up to which triangles are not cut along cells.
const WHOLE: f64 = 3.0;

/// A point of the source.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SourcePoint {
    /// Where in the window, in cells.
    pub(crate) place: DVec2,
    /// Where in space.
    pub(crate) surface: DVec3,
    /// Its triangle in the patch.
    pub(crate) triangle: u32,
    /// Normal of its triangle, unit length or zero.
    pub(crate) normal: DVec3,
    /// The area that it stands for.
    pub(crate) area: f64,
}

/// Barycentric coordinates of the three points of a piece.
const RULE: [[f64; 3]; 3] = [
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

/// Calls `emit` with the points of `triangles` that lie in the window. Windows that tile a chart at one resolution share
/// no point and miss none, up to rounding on their borders.
pub(super) fn visit_points(
    source: &Source,
    window: Window,
    triangles: &[u32],
    mut emit: impl FnMut(&SourcePoint),
) {
    let image = Image::of(window, 0, &[]);
    let mut scratch = Scratch::default();
    let end = f64::from(window.cells);
    let last = (1u32 << window.resolution) - window.cells;
    // The last window along an axis has the points on the chart's far side too.
    let closed = [window.x == last, window.y == last];
    let within = |place: DVec2| {
        place.min_element() >= 0.0 && (place.x < end || closed[0]) && (place.y < end || closed[1])
    };
    for &triangle in triangles {
        let corners = source.patch.triangles[triangle as usize].map(|vertex| Place {
            place: source.uv[vertex as usize] * image.scale - image.origin,
            surface: source.patch.positions[vertex as usize],
        });
        let normal = unit_normal(corners.map(|corner| corner.surface));
        let extent = longest(corners.map(|corner| corner.place));
        if extent.is_nan() {
            continue;
        }
        if extent > WHOLE {
            visit(source, &image, triangle, &mut scratch, |_, polygon| {
                for pair in polygon[1..].windows(2) {
                    piece([polygon[0], pair[0], pair[1]], triangle, normal, &mut emit);
                }
            });
            continue;
        }
        for_each_part(corners, parts_a_side(extent), |part| {
            piece(part, triangle, normal, &mut |point: &SourcePoint| {
                if within(point.place) {
                    emit(point);
                }
            });
        });
    }
}

fn longest([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared())
        .sqrt()
}

fn parts_a_side(extent: f64) -> u32 {
    if extent < 1.5 {
        1
    } else if extent < 2.25 {
        2
    } else {
        3
    }
}

/// The `n`² parts, similar to it, of a triangle.
fn for_each_part([a, b, c]: [Place; 3], n: u32, mut visit: impl FnMut([Place; 3])) {
    if n == 1 {
        return visit([a, b, c]);
    }
    let step = 1.0 / f64::from(n);
    let at = |p: u32, q: u32| {
        blend([a, b, c], {
            let (p, q) = (f64::from(p) * step, f64::from(q) * step);
            [1.0 - p - q, p, q]
        })
    };
    for q in 0..n {
        for p in 0..n - q {
            visit([at(p, q), at(p + 1, q), at(p, q + 1)]);
            if p + q + 1 < n {
                visit([at(p + 1, q), at(p + 1, q + 1), at(p, q + 1)]);
            }
        }
    }
}

fn blend([a, b, c]: [Place; 3], [wa, wb, wc]: [f64; 3]) -> Place {
    Place {
        place: a.place * wa + b.place * wb + c.place * wc,
        surface: a.surface * wa + b.surface * wb + c.surface * wc,
    }
}

fn piece(corners: [Place; 3], triangle: u32, normal: DVec3, emit: &mut impl FnMut(&SourcePoint)) {
    let [a, b, c] = corners.map(|corner| corner.surface);
    let area = (b - a).cross(c - a).length() / 6.0;
    if area.is_nan() || area <= 0.0 {
        return;
    }
    for weights in RULE {
        let Place { place, surface } = blend(corners, weights);
        emit(&SourcePoint {
            place,
            surface,
            triangle,
            normal,
            area,
        });
    }
}
