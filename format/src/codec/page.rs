//! Samples of the base, of root pages and of child pages, to and from payloads.
//!
//! The base holds each chart's corners and then resolution after resolution; a root page goes on where the
//! base stops; a child page adds the odd samples of its parent's quadrant. Positions of even samples are the
//! parent's by construction, normals and colours of even samples are stored against the parent's, since
//! finer pages may shade differently.

#[cfg(not(target_arch = "wasm32"))]
mod encoding;

#[cfg(not(target_arch = "wasm32"))]
pub(crate) use encoding::{encode_base, encode_child, encode_root};

use super::grid::{Grid, count_of};
use super::payload::{self, Counts, Residuals};
use super::sample::{Colour, Normal, Position, Sample};
use super::shading::Prediction;
use super::targets::{self, Target};
use crate::lattice::LATTICE_BITS;
use crate::quadtree::{PAGE_RESOLUTION, Quadrant};
use crate::{Error, PageSamples};

/// What of the file every page depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Coding {
    /// Positions are multiples of `2^shift`.
    pub(crate) shift: u8,
    pub(crate) has_colours: bool,
}

/// The samples of one node as grids; positions in units of 2^shift.
struct Grids {
    positions: Grid<Position>,
    normals: Grid<Normal>,
    /// `None` in files without colours.
    colours: Option<Grid<Colour>>,
}

impl Grids {
    /// `None` when `samples` has arrays of other sizes than its resolution asks for.
    fn new(samples: &PageSamples, coding: Coding) -> Option<Self> {
        let resolution = samples.resolution;
        let positions = samples.positions.iter();
        let positions = positions.map(|&position| Position::of(position, coding.shift));
        let normals = samples.normals.iter().copied().map(Normal::new);
        Some(Self {
            positions: Grid::new(resolution, positions.collect())?,
            normals: Grid::new(resolution, normals.collect())?,
            colours: if coding.has_colours {
                let colours = samples.colours.iter().copied().map(Colour);
                Some(Grid::new(resolution, colours.collect())?)
            } else {
                None
            },
        })
    }

    /// The quarter of `samples` that `quadrant` covers, at the same density; `None` as above.
    fn quarter(samples: &PageSamples, coding: Coding, quadrant: Quadrant) -> Option<Self> {
        let resolution = samples.resolution;
        let quadrant = (quadrant.0 & 1 == 1, quadrant.0 & 2 == 2);
        Some(Self {
            positions: Grid::quarter(resolution, &samples.positions, quadrant, |position| {
                Position::of(position, coding.shift)
            })?,
            normals: Grid::quarter(resolution, &samples.normals, quadrant, Normal::new)?,
            colours: if coding.has_colours {
                Some(Grid::quarter(
                    resolution,
                    &samples.colours,
                    quadrant,
                    Colour,
                )?)
            } else {
                None
            },
        })
    }

    fn map(
        &self,
        positions: impl Fn(&Grid<Position>) -> Grid<Position>,
        normals: impl Fn(&Grid<Normal>) -> Grid<Normal>,
        colours: impl Fn(&Grid<Colour>) -> Grid<Colour>,
    ) -> Self {
        Self {
            positions: positions(&self.positions),
            normals: normals(&self.normals),
            colours: self.colours.as_ref().map(colours),
        }
    }

    fn finer(&self) -> Self {
        self.map(Grid::finer, Grid::finer, Grid::finer)
    }

    fn coarser(&self, steps: u32) -> Self {
        self.map(
            |g| g.coarser(steps),
            |g| g.coarser(steps),
            |g| g.coarser(steps),
        )
    }

    fn into_samples(
        self,
        what: &'static str,
        resolution: u8,
        coding: Coding,
        parent: Option<&Self>,
    ) -> Result<PageSamples, Error> {
        // Units are below 2^21 and shift is at most 15: nothing is lost before this check.
        let limit = 1i32 << LATTICE_BITS.saturating_sub(u32::from(coding.shift));
        let positions = self.positions.samples().iter();
        let largest = positions.fold(0, |largest, &Position([x, y, z])| {
            largest.max(x).max(y).max(z)
        });
        if largest >= limit {
            return Err(Error::Value {
                what,
                found: u64::from(largest.unsigned_abs()),
            });
        }
        let Coding { shift, .. } = coding;
        let (positions, position_targets) = stored(
            &self.positions,
            parent.map(|parent| &parent.positions),
            resolution,
            shift,
        );
        let (normals, normal_targets) = stored(
            &self.normals,
            parent.map(|parent| &parent.normals),
            resolution,
            shift,
        );
        let (colours, colour_targets) = match &self.colours {
            Some(grid) => {
                let parent = parent.and_then(|parent| parent.colours.as_ref());
                stored(grid, parent, resolution, shift)
            }
            None => Default::default(),
        };
        Ok(PageSamples {
            resolution,
            positions,
            position_targets,
            normals,
            normal_targets,
            colours,
            colour_targets,
        })
    }
}

/// The values of a grid, and their targets.
fn stored<T: Target>(
    own: &Grid<T>,
    parent: Option<&Grid<T>>,
    resolution: u8,
    shift: u8,
) -> (Vec<T::Stored>, Vec<T::Stored>) {
    let values = own.samples().iter().map(|value| value.stored(shift));
    let targets = match parent {
        Some(parent) => targets::of_child(own, parent, shift),
        None => targets::of_root(own, resolution, shift),
    };
    (values.collect(), targets)
}

/// Reads residuals one after the other.
struct Source {
    prediction: Prediction,
    positions: std::vec::IntoIter<[i32; 3]>,
    normals: std::vec::IntoIter<[i32; 3]>,
    colours: std::vec::IntoIter<[i32; 3]>,
}

impl Source {
    fn new(residuals: Residuals) -> Self {
        Self {
            prediction: residuals.prediction,
            positions: residuals.positions.into_iter(),
            normals: residuals.normals.into_iter(),
            colours: residuals.colours.into_iter(),
        }
    }
}

/// Restores the odd samples of `grid`.
fn restore_odd<T: Sample>(
    what: &'static str,
    grid: &mut Grid<T>,
    residuals: &mut impl Iterator<Item = [i32; 3]>,
) -> Result<(), Error> {
    grid.visit_odd(|_, _, predicted| restore(what, predicted, residuals))
}

/// Restores the odd normals; positions are complete.
fn restore_odd_normals(
    what: &'static str,
    grids: &mut Grids,
    source: &mut Source,
) -> Result<(), Error> {
    let Grids {
        normals, positions, ..
    } = grids;
    normals.visit_odd(|odd, _, interpolated| {
        let predicted = source.prediction.predict(interpolated, positions, odd);
        restore(what, predicted, &mut source.normals)
    })
}

/// Restores the even samples of `grid` against the values there.
fn restore_even<T: Sample>(
    what: &'static str,
    grid: &mut Grid<T>,
    residuals: &mut impl Iterator<Item = [i32; 3]>,
) -> Result<(), Error> {
    for j in (0..grid.side()).step_by(2) {
        for i in (0..grid.side()).step_by(2) {
            let value = restore(what, grid.get(i, j).code(), residuals)?;
            grid.set(i, j, value);
        }
    }
    Ok(())
}

fn restore<T: Sample>(
    what: &'static str,
    prediction: T::Code,
    residuals: &mut impl Iterator<Item = [i32; 3]>,
) -> Result<T, Error> {
    // An error made for nothing has to be dropped, for every sample.
    let Some(residual) = residuals.next() else {
        return Err(Error::Truncated {
            what,
            expected: 1,
            found: 0,
        });
    };
    match T::restore(prediction, residual) {
        Some(value) => Ok(value),
        None => Err(Error::Value {
            what,
            found: u64::from(residual[0].unsigned_abs()),
        }),
    }
}

fn refine(
    what: &'static str,
    grids: &mut Grids,
    from: u8,
    to: u8,
    source: &mut Source,
) -> Result<(), Error> {
    for _ in from..to {
        *grids = grids.finer();
        restore_odd(what, &mut grids.positions, &mut source.positions)?;
        restore_odd_normals(what, grids, source)?;
        if let Some(colours) = &mut grids.colours {
            restore_odd(what, colours, &mut source.colours)?;
        }
    }
    Ok(())
}

/// Samples that the base holds of charts with these finest resolutions; saturates.
pub(crate) fn base_count(resolutions: &[u8], base_resolution: u8) -> usize {
    resolutions.iter().fold(0, |sum, &r| {
        sum.saturating_add(count_of(r.min(base_resolution)))
    })
}

/// Decodes the base: per chart, by `resolutions`, its samples up to `base_resolution`.
///
/// The caller bounds [`base_count`].
pub(crate) fn decode_base(
    coding: Coding,
    resolutions: &[u8],
    base_resolution: u8,
    bytes: &[u8],
) -> Result<Vec<PageSamples>, Error> {
    let what = "base";
    let count = base_count(resolutions, base_resolution);
    let counts = Counts {
        positions: count,
        normals: count,
    };
    let mut source = Source::new(payload::decode(what, counts, coding.has_colours, bytes)?);
    let mut before = (Position::default(), Normal::default(), Colour::default());
    let mut base = Vec::with_capacity(resolutions.len());
    for &resolution in resolutions {
        let resolution = resolution.min(base_resolution);
        let (mut positions, mut normals, mut colours) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..4 {
            before.0 = restore(what, before.0, &mut source.positions)?;
            before.1 = restore(what, before.1.code(), &mut source.normals)?;
            positions.push(before.0);
            normals.push(before.1);
            if coding.has_colours {
                before.2 = restore(what, before.2, &mut source.colours)?;
                colours.push(before.2);
            }
        }
        let missing = Error::Value { what, found: 0 };
        let (Some(positions), Some(normals)) = (Grid::new(0, positions), Grid::new(0, normals))
        else {
            return Err(missing);
        };
        let mut grids = Grids {
            positions,
            normals,
            colours: Grid::new(0, colours),
        };
        refine(what, &mut grids, 0, resolution, &mut source)?;
        base.push(grids.into_samples(what, resolution, coding, None)?);
    }
    Ok(base)
}

/// Decodes a root page onto its chart's part of the base; without bytes it is the base.
pub(crate) fn decode_root(
    coding: Coding,
    base: &PageSamples,
    resolution: u8,
    bytes: &[u8],
) -> Result<PageSamples, Error> {
    let what = "root page";
    if resolution <= base.resolution {
        return if bytes.is_empty() {
            Ok(base.clone())
        } else {
            Err(Error::TrailingBytes {
                what,
                expected: 0,
                found: bytes.len() as u64,
            })
        };
    }
    let count = count_of(resolution).saturating_sub(count_of(base.resolution));
    let counts = Counts {
        positions: count,
        normals: count,
    };
    let mut source = Source::new(payload::decode(what, counts, coding.has_colours, bytes)?);
    let mut grids = Grids::new(base, coding).ok_or(Error::Value {
        what,
        found: base.positions.len() as u64,
    })?;
    refine(what, &mut grids, base.resolution, resolution, &mut source)?;
    grids.into_samples(what, resolution, coding, None)
}

/// Residuals of a child page: positions of odd samples, normals and colours of all.
fn child_counts() -> Counts {
    let all = count_of(PAGE_RESOLUTION);
    Counts {
        positions: all.saturating_sub(count_of(PAGE_RESOLUTION - 1)),
        normals: all,
    }
}

/// Decodes a page below the root; `None` when `parent` is no full page.
pub(crate) fn decode_child(
    coding: Coding,
    quadrant: Quadrant,
    parent: &PageSamples,
    bytes: &[u8],
) -> Option<Result<PageSamples, Error>> {
    let quarter = Grids::quarter(parent, coding, quadrant)
        .filter(|_| parent.resolution == PAGE_RESOLUTION)?;
    Some(refine_child(coding, &quarter, bytes))
}

fn refine_child(coding: Coding, parent: &Grids, bytes: &[u8]) -> Result<PageSamples, Error> {
    let what = "page";
    let mut source = Source::new(payload::decode(
        what,
        child_counts(),
        coding.has_colours,
        bytes,
    )?);
    let mut grids = parent.finer();
    restore_odd(what, &mut grids.positions, &mut source.positions)?;
    restore_even(what, &mut grids.normals, &mut source.normals)?;
    restore_odd_normals(what, &mut grids, &mut source)?;
    if let Some(colours) = &mut grids.colours {
        restore_even(what, colours, &mut source.colours)?;
        restore_odd(what, colours, &mut source.colours)?;
    }
    grids.into_samples(what, PAGE_RESOLUTION, coding, Some(parent))
}
