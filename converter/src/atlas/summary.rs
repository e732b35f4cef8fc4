//! Normal cones of nodes.

use glam::{IVec3, Vec3};
use marquetry_format::writer::NodeInput;
use marquetry_format::{NormalCone, PageSamples};

/// A cone that holds every triangle normal of `samples` and of `children`.
pub fn of(samples: &PageSamples, children: Option<&[NodeInput; 4]>) -> NormalCone {
    let normals = triangle_normals(samples);
    let own = normals.iter().copied();
    let below = children.into_iter().flatten();
    let axis: Vec3 = own.clone().sum::<Vec3>()
        + below
            .clone()
            .map(|c| Vec3::from_array(c.cone.axis))
            .sum::<Vec3>();
    let Some(axis) = axis.try_normalize() else {
        return NormalCone {
            axis: [0.0, 0.0, 1.0],
            cos: -1.0,
        };
    };
    let mut angle = own.map(|n| axis.angle_between(n)).fold(0.0f32, f32::max);
    for child in below {
        let half = child.cone.cos.clamp(-1.0, 1.0).acos();
        angle = angle.max(axis.angle_between(Vec3::from_array(child.cone.axis)) + half);
    }
    // A little wider than computed: rounding must not leave a normal outside.
    let angle = angle + 1e-3;
    let cos = if angle >= std::f32::consts::PI {
        -1.0
    } else {
        angle.cos()
    };
    NormalCone {
        axis: axis.to_array(),
        cos,
    }
}

/// Unit normals of the triangles that have an area.
fn triangle_normals(samples: &PageSamples) -> Vec<Vec3> {
    let side = samples.side();
    #[expect(
        clippy::cast_possible_wrap,
        reason = "lattice coordinates have 21 bits"
    )]
    let at =
        |i: usize, j: usize| IVec3::from_array(samples.positions[j * side + i].map(|c| c as i32));
    let mut normals = Vec::with_capacity(2 * (side - 1) * (side - 1));
    for j in 0..side - 1 {
        for i in 0..side - 1 {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            for (p, q, r) in [(a, b, c), (a, c, d)] {
                let normal = (q - p).as_dvec3().cross((r - p).as_dvec3());
                if let Some(normal) = normal.try_normalize() {
                    normals.push(normal.as_vec3());
                }
            }
        }
    }
    normals
}
