//! The input of the writer in page order, checked.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "sizes and page numbers are checked against the limits before they are used"
)]

use super::{ChartInput, NodeInput};
use crate::codec::page::Coding;
use crate::lattice::{Bounds, LATTICE_BITS};
use crate::parallel::map_ordered;
use crate::quadtree::{MAX_LEVEL, PAGE_RESOLUTION};
use crate::rules::{Border, Tally, Topology};
use crate::{ChartId, Error, Limits, NodeId, Quadrant};

/// A node in page order.
pub(super) struct FlatNode<'a> {
    pub(super) node: &'a NodeInput,
    pub(super) id: NodeId,
    /// Page of the parent.
    pub(super) parent: Option<(usize, Quadrant)>,
}

/// All nodes in page order.
pub(super) struct Pages<'a> {
    pub(super) flat: Vec<FlatNode<'a>>,
    /// By page: of all samples of the node and of everything below it.
    pub(super) bounds: Vec<Bounds>,
}

fn refuse<T>(rule: &'static str, detail: String) -> Result<T, Error> {
    Err(Error::Input { rule, detail })
}

impl<'a> Pages<'a> {
    /// Puts the nodes of `charts` in page order and checks them.
    pub(super) fn new(charts: &'a [ChartInput], coding: Coding) -> Result<Self, Error> {
        let limits = Limits::default();
        if charts.len() > limits.charts as usize {
            return refuse(
                "a file does not have too many charts",
                format!("{} charts", charts.len()),
            );
        }
        check_glue_targets(charts)?;
        let (flat, first_children) = flatten(charts, limits.pages as usize)?;
        let checks = map_ordered(&(0..flat.len()).collect::<Vec<_>>(), |&page| {
            check_node(&flat, page, coding)
        });
        checks.into_iter().collect::<Result<(), Error>>()?;

        let topology = Topology {
            glue: charts.iter().map(|chart| chart.glue).collect(),
            nodes: flat.iter().map(|page| page.id).collect(),
            resolutions: flat
                .iter()
                .map(|page| page.node.samples.resolution)
                .collect(),
            first_children,
        };
        let first_failure = |rule, tally: Tally| match tally.failures.into_iter().next() {
            Some(detail) => refuse(rule, detail),
            None => Ok(()),
        };
        first_failure("glue goes both ways", topology.check_glue())?;
        first_failure(
            "the trees are balanced across borders",
            topology.check_balance(),
        )?;
        let errors = topology.check_errors(|page| &flat[page as usize].node.errors);
        first_failure("errors never grow on the way down", errors)?;
        let borders = map_ordered(&flat, |page| Some(Border::new(&page.node.samples)));
        first_failure(
            "shared borders are equal on both sides",
            topology.check_borders(&borders),
        )?;

        let bounds = bounds_of(&flat);
        Ok(Self { flat, bounds })
    }
}

fn check_glue_targets(charts: &[ChartInput]) -> Result<(), Error> {
    for (chart, input) in charts.iter().enumerate() {
        for glue in input.glue.iter().flatten() {
            if glue.side.0 > 3 || glue.chart.0 as usize >= charts.len() {
                return refuse(
                    "glue names a side of a chart of the file",
                    format!("chart {chart}: {glue:?}"),
                );
            }
        }
    }
    Ok(())
}

type Flat<'a> = (Vec<FlatNode<'a>>, Vec<Option<u32>>);

fn flatten(charts: &[ChartInput], limit: usize) -> Result<Flat<'_>, Error> {
    let mut flat: Vec<FlatNode<'_>> = (0u32..)
        .zip(charts)
        .map(|(chart, input)| FlatNode {
            node: &input.root,
            id: NodeId::root(ChartId(chart)),
            parent: None,
        })
        .collect();
    let mut first_children = Vec::new();
    let mut page = 0;
    while let Some(&FlatNode { node, id, .. }) = flat.get(page) {
        first_children.push(match &node.children {
            None => None,
            Some(children) => {
                if id.level == MAX_LEVEL || node.samples.resolution != PAGE_RESOLUTION {
                    return refuse(
                        "only nodes at resolution 5 above the deepest level have children",
                        format!("{id:?} at resolution {}", node.samples.resolution),
                    );
                }
                let first = u32::try_from(flat.len()).unwrap_or(u32::MAX);
                for (quadrant, child) in (0u8..).zip(children.iter()) {
                    let quadrant = Quadrant(quadrant);
                    flat.push(FlatNode {
                        node: child,
                        id: id.child(quadrant),
                        parent: Some((page, quadrant)),
                    });
                }
                Some(first)
            }
        });
        if flat.len() > limit {
            return refuse(
                "a file does not have too many pages",
                format!("more than {limit}"),
            );
        }
        page += 1;
    }
    Ok((flat, first_children))
}

fn check_node(flat: &[FlatNode<'_>], page: usize, coding: Coding) -> Result<(), Error> {
    let FlatNode { node, id, parent } = &flat[page];
    let samples = &node.samples;
    let resolution = samples.resolution;
    if resolution > PAGE_RESOLUTION || (parent.is_some() && resolution != PAGE_RESOLUTION) {
        return refuse(
            "a root has resolution 0 to 5, every other node 5",
            format!("{id:?} has {resolution}"),
        );
    }
    let count = samples.side() * samples.side();
    let colours = if coding.has_colours { count } else { 0 };
    let found = [
        samples.positions.len(),
        samples.normals.len(),
        samples.colours.len(),
    ];
    if found != [count, count, colours] {
        return refuse(
            "a node has (2^resolution + 1)^2 samples",
            format!(
                "{id:?}: {found:?} positions, normals and colours in place of {:?}",
                [count, count, colours]
            ),
        );
    }
    let mask = (1u32 << coding.shift) - 1;
    if let Some(point) = samples
        .positions
        .iter()
        .find(|p| p.iter().any(|&c| c >> LATTICE_BITS != 0 || c & mask != 0))
    {
        return refuse(
            "positions are multiples of 2^shift below 2^21",
            format!("{id:?}: {point:?} at shift {}", coding.shift),
        );
    }
    let errors = if parent.is_none() {
        usize::from(resolution) + 1
    } else {
        1
    };
    if node.errors.len() != errors {
        let detail = format!("{id:?}: {} in place of {errors}", node.errors.len());
        return refuse(
            "a root has an error a resolution, every other node one",
            detail,
        );
    }
    if !node
        .errors
        .iter()
        .all(|&error| error.is_finite() && error >= 0.0)
    {
        return refuse(
            "an error is a finite length, not below zero",
            format!("{id:?}: {:?}", node.errors),
        );
    }
    if let &Some((parent, quadrant)) = parent {
        let coarse = &flat[parent].node.samples.positions;
        for j in 0..=16 {
            for i in 0..=16 {
                let own = samples.positions[2 * j * 33 + 2 * i];
                let theirs = coarse[parent_index(quadrant, i, j)];
                if own != theirs {
                    return refuse(
                        "a child repeats its parent's positions",
                        format!(
                            "{id:?}: sample ({}, {}) is {own:?}, the parent's {theirs:?}",
                            2 * i,
                            2 * j
                        ),
                    );
                }
            }
        }
    }
    Ok(())
}

fn bounds_of(flat: &[FlatNode<'_>]) -> Vec<Bounds> {
    let mut bounds = map_ordered(flat, |page| {
        let mut bounds = Bounds {
            min: [u32::MAX; 3],
            max: [0; 3],
        };
        for &[x, y, z] in &page.node.samples.positions {
            let ([a, b, c], [d, e, f]) = (bounds.min, bounds.max);
            bounds.min = [a.min(x), b.min(y), c.min(z)];
            bounds.max = [d.max(x), e.max(y), f.max(z)];
        }
        bounds
    });
    // Parents come before their children.
    for page in (0..flat.len()).rev() {
        if let Some((parent, _)) = flat[page].parent {
            let Bounds { min, max } = bounds[page];
            for axis in 0..3 {
                bounds[parent].min[axis] = bounds[parent].min[axis].min(min[axis]);
                bounds[parent].max[axis] = bounds[parent].max[axis].max(max[axis]);
            }
        }
    }
    bounds
}

/// Index of sample (i, j) of quadrant `quadrant` of a full page, in steps of the parent.
fn parent_index(quadrant: Quadrant, i: usize, j: usize) -> usize {
    let (right, upper) = (
        usize::from(quadrant.0 & 1),
        usize::from(quadrant.0 >> 1 & 1),
    );
    (16 * upper + j) * 33 + 16 * right + i
}
