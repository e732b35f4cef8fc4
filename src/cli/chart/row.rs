//! What a frame of many models costs: a row of them along the view axis, each drawn whole, however many are behind others.
//!
//! The row recedes steadily and comes back, as a conveyor does: after [`FRAMES_APART`] frames each model is where the next one was. So every
//! frame of every model of the row is a frame of one model that recedes all the way, and the mean cost of the row is a sum over
//! that one flight. Once a model is at its coarsest, those beyond it cost the same.
//! Limit: costs of pictures add up; the engine draws one file, and what it would save by drawing models together is not in them.

use super::data::{Adapter, Recommendation, RowPoint, TransitionPoint};
use super::pictures::Studio;
use super::transitions::{self, FRAME_SECONDS, NEAREST, TRANSITIONS};
use super::words::{ALIKE, by_transition};
use marquetry_engine::{Camera, Transition};
use marquetry_native::Session;
use std::time::{Duration, Instant};

/// Models in a row.
const INSTANCES: [usize; 6] = [50, 100, 200, 500, 1000, 2000];
/// Bounding-sphere radii from one to the next: they do not touch.
const APART: f64 = 2.5;
/// Frames in which a model gets to where the next one was.
const FRAMES_APART: usize = 24;
/// A frame may cost so many times the cheapest for less popping.
const DEARER: f64 = 1.25;

/// What a frame takes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cost {
    triangles: f64,
    draw_calls: f64,
    cpu_ms: f64,
    gpu_ms: Option<f64>,
}

impl Cost {
    const NONE: Self = Self {
        triangles: 0.0,
        draw_calls: 0.0,
        cpu_ms: 0.0,
        gpu_ms: Some(0.0),
    };

    fn plus(self, other: Self, times: f64) -> Self {
        Self {
            triangles: self.triangles + times * other.triangles,
            draw_calls: self.draw_calls + times * other.draw_calls,
            cpu_ms: self.cpu_ms + times * other.cpu_ms,
            gpu_ms: (self.gpu_ms.zip(other.gpu_ms)).map(|(own, more)| own + times * more),
        }
    }

    fn mean(all: &[Self]) -> Self {
        let part = 1.0 / all.len().max(1) as f64;
        all.iter().fold(Self::NONE, |sum, &one| sum.plus(one, part))
    }
}

/// Rows of all lengths, with every transition.
///
/// # Errors
/// When the file cannot be shown, or the device fails.
pub(super) fn points(studio: &Studio<'_>) -> anyhow::Result<Vec<RowPoint>> {
    let mut points = Vec::new();
    for (number, transition) in TRANSITIONS.into_iter().enumerate() {
        let by_place = Flight::new(studio, transition)?.costs()?;
        let of = |instances| {
            let cost = of_row(&by_place, instances);
            RowPoint {
                transition: transition.name().to_owned(),
                instances,
                triangles: cost.triangles,
                draw_calls: cost.draw_calls,
                cpu_ms: cost.cpu_ms,
                gpu_ms: cost.gpu_ms,
            }
        };
        points.extend(INSTANCES.map(of));
        (studio.tell)((number + 1) as f64 / TRANSITIONS.len() as f64);
    }
    Ok(points)
}

/// Of `instances` models at the first places; those beyond the last place cost what one there does.
fn of_row(by_place: &[Cost], instances: usize) -> Cost {
    let first = by_place.iter().take(instances);
    let near = first.fold(Cost::NONE, |sum, &cost| sum.plus(cost, 1.0));
    let beyond = instances.saturating_sub(by_place.len());
    by_place
        .last()
        .map_or(near, |&last| near.plus(last, beyond as f64))
}

/// One model on its way along the row.
struct Flight<'a> {
    studio: &'a Studio<'a>,
    session: Session,
}

impl<'a> Flight<'a> {
    /// With all pages that the row takes.
    fn new(studio: &'a Studio<'a>, transition: Transition) -> anyhow::Result<Self> {
        let farthest = NEAREST + APART * INSTANCES[INSTANCES.len() - 1] as f64;
        let session = transitions::loaded(studio, transition, 0, farthest, 1)?;
        Ok(Self { studio, session })
    }

    /// By place of the row, the mean over its frames there, on the way away and on the way back.
    fn costs(&mut self) -> anyhow::Result<Vec<Cost>> {
        let most = INSTANCES[INSTANCES.len() - 1];
        let far = Camera::standard(self.studio.metadata, 0, APART * (most + 1) as f64)?;
        self.session.settle(far, self.studio.size)?;
        let coarsest = self.session.viewer().stats().triangles;
        let nearest = Camera::standard(self.studio.metadata, 0, NEAREST)?;
        self.session.settle(nearest, self.studio.size)?;
        let mut away = Vec::new();
        for place in 0..most {
            let frames: Vec<Cost> = (0..FRAMES_APART)
                .map(|frame| self.fly(place * FRAMES_APART + frame))
                .collect::<anyhow::Result<_>>()?;
            away.push(Cost::mean(&frames));
            if frames
                .iter()
                .all(|frame| frame.triangles <= coarsest as f64)
            {
                break;
            }
        }
        let mut costs = vec![Cost::NONE; away.len()];
        for place in (0..away.len()).rev() {
            let frames: Vec<Cost> = (0..FRAMES_APART)
                .rev()
                .map(|frame| self.fly(place * FRAMES_APART + frame))
                .collect::<anyhow::Result<_>>()?;
            costs[place] = Cost::mean(&[away[place], Cost::mean(&frames)]);
        }
        Ok(costs)
    }

    /// The frame at a place on the way. It is drawn only where there is a graphics card to time.
    fn fly(&mut self, frame: usize) -> anyhow::Result<Cost> {
        let (studio, session) = (self.studio, &mut self.session);
        let distance = NEAREST + APART * frame as f64 / FRAMES_APART as f64;
        session
            .viewer()
            .set_camera(Camera::standard(studio.metadata, 0, distance)?);
        let start = Instant::now();
        session.step(FRAME_SECONDS, studio.size, Duration::ZERO);
        let mut cpu = start.elapsed();
        let mut gpu_ms = None;
        if !studio.headless.is_software() {
            cpu += session.draw(studio.size)?;
            gpu_ms = session.gpu_ms();
        }
        let stats = session.viewer().stats();
        Ok(Cost {
            triangles: stats.triangles as f64,
            draw_calls: stats.draw_calls as f64,
            cpu_ms: 1e3 * cpu.as_secs_f64(),
            gpu_ms,
        })
    }
}

/// Which transition to take for how many models: of those whose frames cost at most [`DEARER`] times the cheapest, the one that pops
/// least, and of those that pop about as little the cheapest. Cost is time where a graphics card was timed, else triangles.
pub(super) fn recommend(
    rows: &[RowPoint],
    flown: &[TransitionPoint],
    adapter: &Adapter,
) -> Vec<Recommendation> {
    let flown = by_transition(flown);
    let cost = |row: &RowPoint| match row.gpu_ms {
        Some(gpu_ms) if !adapter.software => gpu_ms + row.cpu_ms,
        _ => row.triangles,
    };
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let of = |instances: usize| {
        let rows = || rows.iter().filter(move |row| row.instances == instances);
        let cheapest = least(&mut rows().map(cost));
        let known = rows().filter(|row| cost(row) <= DEARER * cheapest);
        let known: Vec<(&RowPoint, f64)> = known
            .filter_map(|row| {
                let popping = flown.iter().find(|of| of.0 == row.transition)?.1;
                Some((row, popping))
            })
            .collect();
        let calmest = least(&mut known.iter().map(|known| known.1));
        let alike = known.iter().filter(|known| known.1 <= ALIKE * calmest);
        let best = alike.min_by(|a, b| cost(a.0).total_cmp(&cost(b.0)))?;
        Some(Recommendation {
            instances,
            transition: best.0.transition.clone(),
            popping_p99: best.1,
            over_cheapest: cost(best.0) / cheapest,
        })
    };
    INSTANCES.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(triangles: f64, gpu_ms: Option<f64>) -> Cost {
        Cost {
            triangles,
            draw_calls: 1.0,
            cpu_ms: 0.5,
            gpu_ms,
        }
    }

    #[test]
    fn rows_are_sums_and_go_on_as_their_last_place() {
        let places = [cost(100.0, Some(2.0)), cost(10.0, Some(1.0))];
        let one = of_row(&places, 1);
        assert_eq!((one.triangles, one.gpu_ms), (100.0, Some(2.0)));
        let many = of_row(&places, 50);
        assert_eq!((many.triangles, many.gpu_ms), (590.0, Some(51.0)));
        assert_eq!((many.draw_calls, many.cpu_ms), (50.0, 25.0));
        // What was not timed once is not known of the sum.
        assert_eq!(of_row(&[places[0], cost(1.0, None)], 2).gpu_ms, None);
        assert_eq!(of_row(&[], 50), Cost::NONE);
    }

    #[test]
    fn the_calmest_is_advised_while_it_is_not_much_dearer() {
        let flown = [("none", 0.05), ("alpha", 0.01), ("geomorph", 0.0101)]
            .map(|(name, p99)| TransitionPoint::bare(name, p99, 1.0));
        let row = |name: &str, instances, triangles, gpu_ms| RowPoint {
            transition: name.to_owned(),
            instances,
            triangles,
            draw_calls: 1.0,
            cpu_ms: 0.0,
            gpu_ms,
        };
        let rows = [
            row("none", 50, 100.0, Some(1.0)),
            row("alpha", 50, 120.0, Some(3.0)),
            row("geomorph", 50, 110.0, Some(2.0)),
            row("none", 100, 200.0, Some(2.0)),
            row("alpha", 100, 400.0, Some(2.1)),
            row("geomorph", 100, 400.0, Some(3.1)),
        ];
        let adapter = |software| Adapter {
            name: String::new(),
            software,
        };
        let advice = |software| {
            let all = recommend(&rows, &flown, &adapter(software));
            all.iter()
                .map(|advice| (advice.instances, advice.transition.clone()))
                .collect::<Vec<_>>()
        };
        // By triangles, geomorph is about as calm as alpha and cheaper; with more models both are too dear.
        assert_eq!(
            advice(true),
            [(50, "geomorph".to_owned()), (100, "none".to_owned())]
        );
        assert_eq!(
            advice(false),
            [(50, "none".to_owned()), (100, "alpha".to_owned())]
        );
    }
}
