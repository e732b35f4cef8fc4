//! Entry points for the fuzz targets: the decoders behind the checksums, and the round trip.
#![allow(
    clippy::arithmetic_side_effects,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::missing_panics_doc,
    reason = "a panic is what a fuzz target looks for"
)]

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
