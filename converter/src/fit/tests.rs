use super::*;
use crate::atlas::depth::Depth;
use crate::atlas::leaves::leaves_of;
use crate::atlas::patch::{Border, Patch};
use crate::atlas::survey::window_of;
use crate::parameterize::Parametrization;
use crate::parameterize::test_patches::{bumpy, with_borders};
use marquetry_format::{ChartId, Glue, Side};

const CELLS: usize = 48;

/// Two charts side by side over [0, 2] × [0, 1], parametrized by x and y.
struct Pair {
    patches: Vec<Patch>,
    maps: Vec<Parametrization>,
    borders: Vec<Border>,
    glue: [[Option<Glue>; 4]; 2],
}

impl Pair {
    fn new(height: impl Fn(f64, f64) -> f64 + Copy) -> Self {
        let (mut patches, mut borders, mut maps) = (Vec::new(), Vec::new(), Vec::new());
        for shift in [0.0, 1.0] {
            let mut patch = bumpy(CELLS, 0.0, 1, |x, y| height(x + shift, y));
            let uv = patch.positions.iter().map(|p| p.truncate()).collect();
            for position in &mut patch.positions {
                position.x += shift;
            }
            let (mut patch, mut own) = with_borders(patch, [true; 4]);
            for border in &mut own {
                let last = border.points.len() - 1;
                border.params = (0..=last).map(|k| k as f64 / last as f64).collect();
            }
            for (border, _) in &mut patch.borders {
                *border += u32::try_from(borders.len()).unwrap();
            }
            borders.extend(own);
            patches.push(patch);
            maps.push(Parametrization {
                uv,
                flipped: 0,
                stretch: 1.0,
            });
        }
        patches[1].borders[3] = (1, false);
        let to = |chart, side| {
            Some(Glue {
                chart: ChartId(chart),
                side: Side(side),
                reversed: true,
            })
        };
        Self {
            patches,
            maps,
            borders,
            glue: [[None, to(1, 3), None, None], [None, None, None, to(0, 1)]],
        }
    }

    fn samplers(&self) -> Vec<Sampler<'_>> {
        let maps = self.patches.iter().zip(&self.maps);
        maps.map(|(patch, map)| Sampler::new(patch, map)).collect()
    }

    /// Calls `check` with the problem of the charts at two resolutions.
    fn with_problem(&self, roots: [u8; 2], check: impl FnOnce(&Problem<'_>)) {
        let samplers = self.samplers();
        let leaves = leaves_of(&Depth {
            roots: roots.to_vec(),
            ..Depth::default()
        });
        let points = Points::new(&self.glue, &leaves);
        let mut sampled = vec![DVec3::ZERO; points.len()];
        for leaf in &leaves {
            let sampler = &samplers[leaf.node.chart.0 as usize];
            let positions = sampler.positions(&self.borders, window_of(*leaf));
            for (between, position) in points.of_sample[leaf.range()].iter().zip(positions) {
                if between.0 == between.1 {
                    sampled[between.0 as usize] = position;
                }
            }
        }
        check(&Problem {
            samplers: &samplers,
            leaves: &leaves,
            points: &points,
            sampled: &sampled,
            target: 1e-3,
            stored: &|position| position,
        });
    }
}

fn waves(x: f64, y: f64) -> f64 {
    0.05 * (5.0 * x).sin() * (4.0 * y + x).cos()
}

fn squares(problem: &Problem<'_>, positions: &[DVec3]) -> f64 {
    let of = |leaf: &Leaf| {
        let image = problem.image(*leaf, positions);
        let sampler = &problem.samplers[leaf.node.chart.0 as usize];
        sampler.estimates(window_of(*leaf), &image, 1)[0].squares
    };
    problem.leaves.iter().map(of).sum()
}

#[test]
fn a_curved_surface_is_met_at_far_less_squared_error() {
    let pair = Pair::new(waves);
    for roots in [[3, 3], [4, 3], [3, 4]] {
        pair.with_problem(roots, |problem| {
            let fitted = fit(problem);
            let (before, after) = (
                squares(problem, problem.sampled),
                squares(problem, &fitted.positions),
            );
            // Of the grids' points every third stays, on the open border.
            assert!(after < 0.4 * before, "{roots:?}: {after} of {before}");
            assert!((fitted.squares / after - 1.0).abs() < 1e-9);
            assert_eq!(fitted.kept, 0);
        });
    }
}

#[test]
fn a_flat_surface_stays_flat_and_open_borders_stay() {
    for height in [|_, _| 0.25, waves] {
        Pair::new(height).with_problem([3, 3], |problem| {
            let fitted = fit(problem);
            for (point, position) in fitted.positions.iter().enumerate() {
                if problem.points.open[point] {
                    assert_eq!(*position, problem.sampled[point]);
                }
            }
        });
    }
    Pair::new(|_, _| 0.25).with_problem([3, 2], |problem| {
        for position in fit(problem).positions {
            assert!((position.z - 0.25).abs() < 1e-6, "{position}");
        }
    });
}

#[test]
fn points_on_the_shared_border_move_as_well() {
    Pair::new(waves).with_problem([3, 3], |problem| {
        let fitted = fit(problem);
        let moved = (0..problem.points.len())
            .filter(|&point| (problem.sampled[point].x - 1.0).abs() < 1e-12)
            .filter(|&point| fitted.positions[point].distance(problem.sampled[point]) > 1e-6)
            .count();
        assert!(moved >= 5, "{moved}");
    });
}

#[test]
fn the_solution_satisfies_the_system() {
    Pair::new(waves).with_problem([4, 3], |problem| {
        let system = system::System::new(problem);
        let (moves, iterations) = conjugate::solve(&system);
        assert!((2..30).contains(&iterations), "{iterations}");
        let size = |v: &[DVec3]| v.iter().map(|v| v.length_squared()).sum::<f64>().sqrt();
        let left: Vec<DVec3> = system
            .apply(&moves)
            .iter()
            .zip(system.right_hand())
            .map(|(a, b)| *b - *a)
            .collect();
        assert!(size(&left) < 0.02 * size(system.right_hand()));
    });
}

#[test]
fn turned_triangles_and_long_moves_are_undone() {
    Pair::new(waves).with_problem([3, 3], |problem| {
        let mut positions = problem.sampled.to_vec();
        let inner = (0..positions.len())
            .filter(|&point| !problem.points.open[point])
            .collect::<Vec<_>>();
        // One point thrown over its neighbours, one away from the surface, one nowhere.
        positions[inner[3]] += DVec3::new(0.4, 0.3, 0.0);
        positions[inner[40]] += DVec3::Z;
        positions[inner[20]] = DVec3::NAN;
        let system = system::System::new(problem);
        let Fitted {
            positions, kept, ..
        } = guard::undo_harm(problem, system.before(), positions);
        assert!(kept > 0);
        for (position, sampled) in positions.iter().zip(problem.sampled) {
            assert!(position.distance(*sampled) < 0.5 * 0.2);
        }
        assert_eq!(
            squares(problem, &positions).to_bits(),
            squares(problem, problem.sampled).to_bits()
        );
    });
}
