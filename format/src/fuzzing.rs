//! Entry points for the fuzz targets: the decoders behind the checksums, and the round trip.
#![allow(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::missing_panics_doc,
    reason = "a panic is what a fuzz target looks for"
)]

use crate::cluster::mesh::{self as cluster_mesh, Counts, in_order};
use crate::codec::page::{
    Coding, decode_base, decode_child, decode_root, encode_base, encode_child, encode_root,
};
use crate::{PageSamples, Quadrant};

/// Decodes `data` as base, root page and child page, and codes again what was decoded.
///
/// The first two bytes choose the coding, the next four divide the rest among the three.
pub fn pages(data: &[u8]) {
    let Some((&[a, b, c, d, e, f], rest)) = data.split_first_chunk::<6>() else {
        return;
    };
    let coding = Coding {
        shift: a & 15,
        has_colours: a & 16 != 0,
    };
    let (base_resolution, resolution) = (b % 6, (b >> 4) % 6);
    let (base_bytes, rest) = split(rest, [c, d]);
    let (root_bytes, child_bytes) = split(rest, [e, f]);
    let Ok(base) = decode_base(coding, &[resolution], base_resolution, base_bytes) else {
        return;
    };
    let again =
        encode_base(coding, base.iter(), base_resolution).expect("what was decoded can be coded");
    assert_eq!(
        decode_base(coding, &[resolution], base_resolution, &again.0)
            .expect("what was coded decodes"),
        base
    );
    let Some(Ok(root)) = base
        .first()
        .map(|base| decode_root(coding, base, resolution, root_bytes))
    else {
        return;
    };
    check_size(&root, coding);
    let again = encode_root(coding, &root, base_resolution).expect("what was decoded can be coded");
    assert_eq!(
        decode_root(coding, &base[0], resolution, &again.0).expect("what was coded decodes"),
        root
    );
    let quadrant = Quadrant(a >> 6);
    let Some(Ok(child)) = decode_child(coding, quadrant, &root, child_bytes) else {
        return;
    };
    check_size(&child, coding);
    let again =
        encode_child(coding, &child, &root, quadrant).expect("what was decoded can be coded");
    let again = decode_child(coding, quadrant, &root, &again.0).expect("the parent is the same");
    assert_eq!(again.expect("what was coded decodes"), child);
}

/// Decodes `data` as the mesh of a cluster, and codes again what was decoded.
///
/// The first three bytes choose the coding and the counts.
pub fn cluster(data: &[u8]) {
    let Some((&[a, vertices, triangles], rest)) = data.split_first_chunk::<3>() else {
        return;
    };
    let coding = Coding {
        shift: a & 15,
        has_colours: a & 16 != 0,
    };
    let counts = Counts {
        vertices: usize::from(vertices) + 1,
        triangles: usize::from(triangles) + 1,
    };
    let Ok(mesh) = cluster_mesh::decode(coding, counts, rest) else {
        return;
    };
    let ordered = in_order(&mesh).expect("what was decoded names its own vertices");
    assert_eq!(in_order(&ordered).as_ref(), Some(&ordered));
    let (again, _) = cluster_mesh::encode(coding, &ordered).expect("what was decoded can be coded");
    assert_eq!(
        cluster_mesh::decode(coding, counts, &again).expect("what was coded decodes"),
        ordered
    );
}

fn split(bytes: &[u8], length: [u8; 2]) -> (&[u8], &[u8]) {
    let length = usize::from(u16::from_le_bytes(length));
    bytes.split_at(length.min(bytes.len()))
}

fn check_size(samples: &PageSamples, coding: Coding) {
    let count = samples.side() * samples.side();
    let colours = if coding.has_colours { count } else { 0 };
    assert_eq!(
        [samples.positions.len(), samples.position_targets.len()],
        [count; 2]
    );
    assert_eq!(
        [samples.normals.len(), samples.normal_targets.len()],
        [count; 2]
    );
    assert_eq!(
        [samples.colours.len(), samples.colour_targets.len()],
        [colours; 2]
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A stretch of a payload: header bytes, then raw or zero streams of roughly the right lengths.
    fn payload() -> impl Strategy<Value = Vec<u8>> {
        let method = || 0..2u8;
        (
            method(),
            method(),
            method(),
            0..3u8,
            0..3u8,
            0..1200usize,
            0..400usize,
            any::<u64>(),
        )
            .prop_map(
                |(positions, normals, colours, planes, prediction, geometry, shading, noise)| {
                    let mut out = vec![
                        positions | normals << 2 | colours << 4,
                        planes | prediction << 2,
                    ];
                    let lengths = [
                        geometry * usize::from(positions),
                        shading * usize::from(normals),
                    ];
                    for length in lengths {
                        crate::bytes::push_leb128(&mut out, length as u32);
                    }
                    let body = lengths[0] + lengths[1];
                    out.extend((0..body).map(|at| (noise.rotate_left(at as u32) as u8) & 7));
                    out
                },
            )
    }

    proptest! {
        #[test]
        fn any_pages_decode_and_survive_or_fail_cleanly(
            a: u8, resolutions: u8, base in payload(), root in payload(), child in payload()
        ) {
            let [c, d] = (base.len() as u16).to_le_bytes();
            let [e, f] = (root.len() as u16).to_le_bytes();
            pages(&[&[a, resolutions, c, d, e, f], &base[..], &root, &child].concat());
        }

        #[test]
        fn any_cluster_decodes_and_survives_or_fails_cleanly(
            a: u8, triangles in 0..40u8, residuals in prop::collection::vec(0..4u8, 9 * 40 + 5 * 40), codes in prop::collection::vec(0..3u8, 3 * 40)
        ) {
            // Corners behind the newest vertex by little, from a first triangle on.
            let count = usize::from(triangles) + 1;
            let mut stream = codes[..3 * count].to_vec();
            for plane in 0..3 {
                stream[plane * count] = 0;
            }
            let vertices = stream.iter().map(|&code| usize::from(code == 0)).sum::<usize>();
            let has_colours = usize::from(a >> 4 & 1);
            let lengths = [3 * count, 3 * vertices, 2 * vertices];
            let mut data = vec![a, (vertices - 1) as u8, triangles, 0b1_0101 | (has_colours as u8) << 6, 0];
            for length in lengths {
                crate::bytes::push_leb128(&mut data, length as u32);
            }
            data.extend(stream);
            data.extend(residuals.iter().cycle().take(lengths[1] + lengths[2] + 3 * vertices * has_colours));
            cluster(&data);
        }

        #[test]
        fn pages_without_detail_survive(shift in 0..16u8, quadrant in 0..4u8, prediction in 0..3u8, k in 0..5u8) {
            // All zero: the smallest payloads there are, up to a child of a full page.
            let zero = [0, prediction << 2, 0, 0];
            pages(&[&[shift | quadrant << 6, k | 5 << 4, 4, 0, 4, 0], &zero[..], &zero, &zero].concat());
        }
    }
}
