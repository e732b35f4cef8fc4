//! The writer's half: samples to payloads. The writer has checked their sizes.

#![allow(
    clippy::arithmetic_side_effects,
    reason = "resolutions are at most 5 and only go down here"
)]

use super::{Coding, Grids};
use crate::codec::grid::{Grid, Odd};
use crate::codec::payload::{self, Alternatives, PartBytes};
use crate::codec::sample::{Colour, Normal, Position, Sample};
use crate::codec::shading::Prediction;
use crate::{Error, PageSamples, Quadrant};

/// Visits the odd samples of `grid`, each with its value and its prediction, and leaves them as they are.
fn visit_odd<T: Sample>(grid: &Grid<T>, mut visit: impl FnMut(Odd, T, T::Code)) {
    let mut grid = grid.clone();
    let Ok(()) = grid.visit_odd(|odd, own, predicted| {
        visit(odd, own, predicted);
        Ok::<_, std::convert::Infallible>(own)
    });
}

fn store_odd<T: Sample>(grid: &Grid<T>, out: &mut Vec<[i32; 3]>) {
    visit_odd(grid, |_, own, predicted| out.push(own.residual(predicted)));
}

fn store_odd_normals(grids: &Grids, out: &mut [Vec<[i32; 3]>; 3]) {
    visit_odd(&grids.normals, |odd, own, interpolated| {
        for (prediction, out) in Prediction::ALL.into_iter().zip(&mut *out) {
            let predicted = prediction.predict(interpolated, &grids.positions, odd);
            out.push(own.residual(predicted));
        }
    });
}

fn store_even<T: Sample>(grid: &Grid<T>, parent: &Grid<T>, out: &mut Vec<[i32; 3]>) {
    let even = grid.coarser(1);
    out.extend(
        even.samples()
            .iter()
            .zip(parent.samples())
            .map(|(own, parent)| own.residual(parent.code())),
    );
}

/// Stores resolutions `from + 1..=to` of grids that hold resolution `to`.
fn store(grids: &Grids, from: u8, to: u8, out: &mut Alternatives) {
    for resolution in from..to {
        let grids = grids.coarser(u32::from(to - resolution - 1));
        store_odd(&grids.positions, &mut out.positions);
        store_odd_normals(&grids, &mut out.normals);
        if let Some(colours) = &grids.colours {
            store_odd(colours, &mut out.colours);
        }
    }
}

fn grids_of(samples: &PageSamples, coding: Coding) -> Result<Grids, Error> {
    Grids::new(samples, coding).ok_or_else(|| misfit(samples))
}

fn misfit(samples: &PageSamples) -> Error {
    Error::Input {
        rule: "a node has (2^resolution + 1)^2 samples",
        detail: format!(
            "{} positions at resolution {}",
            samples.positions.len(),
            samples.resolution
        ),
    }
}

/// Encodes the base of charts whose roots are `roots`.
pub(crate) fn encode_base<'a>(
    coding: Coding,
    roots: impl Iterator<Item = &'a PageSamples>,
    base_resolution: u8,
) -> Result<(Vec<u8>, PartBytes), Error> {
    let mut out = Alternatives::default();
    let mut before = (Position::default(), Normal::default(), Colour::default());
    for root in roots {
        let grids = grids_of(root, coding)?;
        let resolution = root.resolution.min(base_resolution);
        let grids = grids.coarser(u32::from(root.resolution - resolution));
        let corners = grids.coarser(u32::from(resolution));
        for &corner in corners.positions.samples() {
            out.positions.push(corner.residual(before.0));
            before.0 = corner;
        }
        for &corner in corners.normals.samples() {
            out.normals
                .iter_mut()
                .for_each(|normals| normals.push(corner.residual(before.1.code())));
            before.1 = corner;
        }
        for &corner in corners.colours.iter().flat_map(Grid::samples) {
            out.colours.push(corner.residual(before.2));
            before.2 = corner;
        }
        store(&grids, 0, resolution, &mut out);
    }
    payload::encode(&out, coding.has_colours)
}

/// Encodes a root page; empty when the base holds all of it.
pub(crate) fn encode_root(
    coding: Coding,
    root: &PageSamples,
    base_resolution: u8,
) -> Result<(Vec<u8>, PartBytes), Error> {
    if root.resolution <= base_resolution {
        return Ok(Default::default());
    }
    let mut out = Alternatives::default();
    store(
        &grids_of(root, coding)?,
        base_resolution,
        root.resolution,
        &mut out,
    );
    payload::encode(&out, coding.has_colours)
}

/// Encodes a page below the root.
pub(crate) fn encode_child(
    coding: Coding,
    samples: &PageSamples,
    parent: &PageSamples,
    quadrant: Quadrant,
) -> Result<(Vec<u8>, PartBytes), Error> {
    let grids = grids_of(samples, coding)?;
    let parent = Grids::quarter(parent, coding, quadrant).ok_or_else(|| misfit(parent))?;
    let mut out = Alternatives::default();
    store_odd(&grids.positions, &mut out.positions);
    for normals in &mut out.normals {
        store_even(&grids.normals, &parent.normals, normals);
    }
    store_odd_normals(&grids, &mut out.normals);
    if let (Some(colours), Some(parent)) = (&grids.colours, &parent.colours) {
        store_even(colours, parent, &mut out.colours);
        store_odd(colours, &mut out.colours);
    }
    payload::encode(&out, coding.has_colours)
}
