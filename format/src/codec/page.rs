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

use super::grid::{Grid, count_of, odd_samples};
use super::payload::{self, Counts, Residuals};
use super::sample::{Colour, Normal, Position, Sample};
use super::shading::Prediction;
use super::targets;
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
        let units = samples
            .positions
            .iter()
            .map(|p| Position(p.map(|c| (c >> coding.shift).cast_signed())));
        Some(Self {
            positions: Grid::new(resolution, units.collect())?,
            normals: Grid::new(
                resolution,
                samples.normals.iter().copied().map(Normal).collect(),
            )?,
            colours: if coding.has_colours {
                Some(Grid::new(
                    resolution,
                    samples.colours.iter().copied().map(Colour).collect(),
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

    fn quarter(&self, quadrant: Quadrant) -> Self {
        let (right, upper) = (quadrant.0 & 1 == 1, quadrant.0 & 2 == 2);
        self.map(
            |g| g.quarter(right, upper),
            |g| g.quarter(right, upper),
            |g| g.quarter(right, upper),
        )
    }

    fn into_samples(
        self,
        what: &'static str,
        resolution: u8,
        coding: Coding,
        parent: Option<&Self>,
    ) -> Result<PageSamples, Error> {
        fn targets_of<T: targets::Target>(
            own: &Grid<T>,
            parent: Option<&Grid<T>>,
            resolution: u8,
        ) -> Vec<T> {
            match parent {
                Some(parent) => targets::of_child(own, parent),
                None => targets::of_root(own, resolution),
            }
        }
        let on_lattice = |grid: &Grid<Position>, resolution: u8| -> Result<Grid<Position>, Error> {
            let points = grid
                .samples()
                .iter()
                .map(|position| Position(position.0.map(|c| c << coding.shift)));
            Grid::new(resolution, points.collect()).ok_or(Error::Value {
                what,
                found: u64::from(resolution),
            })
        };
        // Units are below 2^21 and shift is at most 15: nothing is lost before this check.
        let limit = 1i32 << LATTICE_BITS.saturating_sub(u32::from(coding.shift));
        if let Some(&outside) = self
            .positions
            .samples()
            .iter()
            .flat_map(|p| &p.0)
            .find(|&&c| c >= limit)
        {
            return Err(Error::Value {
                what,
                found: u64::from(outside.unsigned_abs()),
            });
        }
        let positions = on_lattice(&self.positions, resolution)?;
        let parent_positions = match parent {
            Some(parent) => Some(on_lattice(&parent.positions, resolution.saturating_sub(1))?),
            None => None,
        };
        let points = |samples: &[Position]| {
            samples
                .iter()
                .map(|p| p.0.map(i32::cast_unsigned))
                .collect()
        };
        let normals = |samples: &[Normal]| samples.iter().map(|n| n.0).collect();
        let colours = |samples: &[Colour]| samples.iter().map(|c| c.0).collect();
        let (colours, colour_targets) = match &self.colours {
            Some(grid) => {
                let parent = parent.and_then(|parent| parent.colours.as_ref());
                (
                    colours(grid.samples()),
                    colours(&targets_of(grid, parent, resolution)),
                )
            }
            None => Default::default(),
        };
        Ok(PageSamples {
            resolution,
            positions: points(positions.samples()),
            position_targets: points(&targets_of(
                &positions,
                parent_positions.as_ref(),
                resolution,
            )),
            normals: normals(self.normals.samples()),
            normal_targets: normals(&targets_of(
                &self.normals,
                parent.map(|parent| &parent.normals),
                resolution,
            )),
            colours,
            colour_targets,
        })
    }
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
    for odd in odd_samples(grid.side()) {
        let value = restore(what, grid.predict(odd), residuals)?;
        grid.set(odd.i, odd.j, value);
    }
    Ok(())
}

/// Restores the odd normals; positions are complete.
fn restore_odd_normals(
    what: &'static str,
    grids: &mut Grids,
    source: &mut Source,
) -> Result<(), Error> {
    for odd in odd_samples(grids.normals.side()) {
        let prediction = source
            .prediction
            .predict(&grids.normals, &grids.positions, odd);
        grids.normals.set(
            odd.i,
            odd.j,
            restore(what, prediction, &mut source.normals)?,
        );
    }
    Ok(())
}

/// Restores the even samples of `grid` against the values there.
fn restore_even<T: Sample>(
    what: &'static str,
    grid: &mut Grid<T>,
    residuals: &mut impl Iterator<Item = [i32; 3]>,
) -> Result<(), Error> {
    for j in (0..grid.side()).step_by(2) {
        for i in (0..grid.side()).step_by(2) {
            let value = restore(what, grid.get(i, j), residuals)?;
            grid.set(i, j, value);
        }
    }
    Ok(())
}

fn restore<T: Sample>(
    what: &'static str,
    prediction: T,
    residuals: &mut impl Iterator<Item = [i32; 3]>,
) -> Result<T, Error> {
    let residual = residuals.next().ok_or(Error::Truncated {
        what,
        expected: 1,
        found: 0,
    })?;
    T::restore(prediction, residual).ok_or(Error::Value {
        what,
        found: u64::from(residual[0].unsigned_abs()),
    })
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
            before.1 = restore(what, before.1, &mut source.normals)?;
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
    let parent = Grids::new(parent, coding)
        .filter(|_| parent.resolution == PAGE_RESOLUTION)?
        .quarter(quadrant);
    Some(refine_child(coding, &parent, bytes))
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
