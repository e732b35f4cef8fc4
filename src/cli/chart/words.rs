//! What a report says in words. Every number in them is computed from its points.

use super::data::{
    Adapter, ConversionPoint, GeometryPoint, Method, Report, TransitionPoint, Versus,
};
use super::page::base_name;
use super::tables::{count, error};
use marquetry_evaluation::plot::short;

/// For readers who know nothing of the project.
pub(super) const MEANINGS: [(&str, &str); 9] = [
    (
        "triangle",
        "What surfaces are drawn of. More of them show more and take longer.",
    ),
    (
        "diagonal",
        "Of the box around the model. Errors are given as parts of it, so that models of any size compare: 1e-4 of a statue of 2 m is 0.2 mm.",
    ),
    (
        "RMS error",
        "The typical distance between two surfaces: the root of the mean square over many points, measured both ways; the larger counts.",
    ),
    (
        "largest error",
        "The largest distance found (Hausdorff distance). It is found by looking at many points, so the true one may be larger; the guaranteed one is a bound that it cannot exceed.",
    ),
    (
        "SSIM",
        "Structural similarity of two pictures: 1 where they look the same, less the more their patterns differ.",
    ),
    (
        "FLIP",
        "How much of a difference a person sees who flips between two pictures: 0 none, 1 as much as there can be.",
    ),
    (
        "outline",
        "Where the object ends and the background begins. Eyes see faults there first.",
    ),
    (
        "discrete LODs",
        "Levels of detail, what most programs do today: several copies of the model, each with fewer triangles, one of which is shown.",
    ),
    (
        "front",
        "Points that no other point beats in both cost and error at once (Pareto front). They are filled; the hollow ones are beaten by some other.",
    ),
];

pub(super) const HOW_GEOMETRY: &str = "Marquetry: the uniform cuts of the file, as marquetry measure --triangles takes them. Discrete LODs: the input, simplified by meshoptimizer to as many triangles. Both are measured in the same way at the same number of random points and all vertices, from one surface to the other and back; bars are 95% intervals.";
pub(super) const HOW_BYTES: &str = "Marquetry: bytes of the file that are read to draw that cut, coarser levels, texture and index included. Discrete LODs: one level by itself with 16-bit positions and 16-bit normals, compressed by meshoptimizer's codec and zstd, and the input's images where it has any; who shows several levels reads them all. The line is the input as stored.";
pub(super) const HOW_LARGEST: &str = "Solid: the largest distance found at the same points. Dashed: the bound that the file states of itself, which holds for every point of both surfaces. Other tools guarantee nothing.";
pub(super) const HOW_EQUAL_COST: &str = "Every row is a setting of Marquetry; discrete LODs are read off their curve at as many triangles, from the same distance. The first columns are means over all views, the last over three at right angles (front, right, top). Cost is counted in triangles, since they are the same on every machine.";

pub(super) const HOW_TRANSITIONS: &str = "A camera flies slowly away from the model and back, at 60 frames a second, from 1.5 to 40 radii, through all levels; pages are loaded \
before. Frames are those around some of the changes of levels, evenly spread over the flight; there it is ten times slower. Popping is the change from one frame to the next that pictures of the whole \
input do not have: root mean square over the object's pixels, in percent of full brightness. The distance from the reference, which has been published as popping, is large \
for whatever is coarse, whether it changes or not.";

/// What is compared with what.
pub(super) fn introduction(report: &Report) -> Vec<String> {
    let (file, input) = (&report.file, &report.input);
    let colours = if input.textured { " and textures" } else { "" };
    vec![
        format!(
            "{} ({} bytes) was made of {} ({} triangles{colours}, {} bytes). This page shows what accuracy costs with it, beside \
             what one would use instead: the input as it is, and simplified copies of it.",
            base_name(&file.path),
            count(file.bytes),
            base_name(&input.path),
            count(input.triangles),
            count(input.bytes)
        ),
        "In every plot cost grows to the right. Points are filled where nothing else is better for less.".to_owned(),
    ]
}

/// Ratios of the file's RMS error to the levels' at equal cost: geometric mean, least, largest, and of how many points.
pub(super) fn ratios(
    points: &[GeometryPoint],
    cost: fn(&GeometryPoint) -> Option<f64>,
) -> Option<(f64, f64, f64, usize)> {
    let curve = |method: Method| {
        let own = points.iter().filter(move |p| p.method == method);
        let mut curve: Vec<(f64, f64)> = own
            .filter(|p| p.rms_rel > 0.0)
            .filter_map(|p| Some((cost(p)?.ln(), p.rms_rel.ln())))
            .collect();
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        curve
    };
    let levels = curve(Method::DiscreteLods);
    let logs: Vec<f64> = curve(Method::Marquetry)
        .into_iter()
        .filter_map(|(at, rms)| {
            let above = levels.iter().position(|level| level.0 >= at)?;
            let (x1, y1) = levels[above];
            let (x0, y0) = if x1 <= at {
                (x1, y1)
            } else {
                *levels.get(above.checked_sub(1)?)?
            };
            let part = if x1 > x0 { (at - x0) / (x1 - x0) } else { 0.0 };
            Some(rms - (y0 + part * (y1 - y0)))
        })
        .collect();
    let count = logs.len();
    (count > 0).then(|| {
        let mean = logs.iter().sum::<f64>() / count as f64;
        let least = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (mean.exp(), least.exp(), largest.exp(), count)
    })
}

fn compared(ratios: Option<(f64, f64, f64, usize)>, cost: &str) -> String {
    match ratios {
        Some((mean, least, largest, count)) => format!(
            "With as many {cost} as discrete LODs, Marquetry's typical error is {mean:.2} times theirs ({least:.2} to {largest:.2} \
             over {count} points; below 1 is better)."
        ),
        None => format!(
            "No point of Marquetry and of discrete LODs has as many {cost}, so they are not compared."
        ),
    }
}

pub(super) fn equal_triangles(report: &Report) -> String {
    compared(
        ratios(&report.geometry, |p| Some(p.triangles as f64)),
        "triangles",
    )
}

pub(super) fn equal_bytes(report: &Report) -> String {
    compared(ratios(&report.geometry, |p| Some(p.bytes? as f64)), "bytes")
}

/// What the guaranteed bound is worth.
pub(super) fn bound(report: &Report) -> String {
    let finest = report
        .geometry
        .iter()
        .find(|p| p.method == Method::Marquetry);
    let numbers = finest.and_then(|p| Some((p.hausdorff_rel?, p.bound_rel?)));
    match numbers {
        Some((found, bound)) if found > 0.0 => format!(
            "At its finest the file guarantees an error of at most {} of the diagonal; the largest that was found is {}, {:.1} times less.",
            error(bound),
            error(found),
            bound / found
        ),
        _ => {
            "At its finest the file is as far from the input as can be told: no distance was found."
                .to_owned()
        }
    }
}

/// What one pixel of error looks like.
pub(super) fn likeness(report: &Report) -> String {
    let near = report
        .pictures
        .iter()
        .filter(|p| p.method == Method::Marquetry);
    let best = near
        .clone()
        .max_by(|a, b| a.ssim.mean.total_cmp(&b.ssim.mean));
    let worst = near.min_by(|a, b| a.ssim.mean.total_cmp(&b.ssim.mean));
    match (worst, best) {
        (Some(worst), Some(best)) => format!(
            "Against pictures of the whole input, Marquetry's SSIM is {:.3} at worst ({} from {} radii, {} triangles) and {:.3} at best \
             ({} from {} radii, {} triangles).",
            worst.ssim.mean,
            worst.setting,
            worst.distance,
            short(worst.triangles),
            best.ssim.mean,
            best.setting,
            best.distance,
            short(best.triangles)
        ),
        _ => "No picture shows anything.".to_owned(),
    }
}

pub(super) fn how_pictures(report: &Report) -> String {
    let settings = &report.settings;
    let [width, height] = settings.size;
    format!(
        "Pictures of {width} × {height} pixels from {} directions at each of {} distances, in multiples of the radius of the sphere around \
         the model; the reference is the whole input, drawn with the same light, each pixel the mean of 16. Marquetry draws what it would for a largest error of so many \
         pixels on the screen; discrete LODs are drawn one by one. Only pixels that show the object count. Bars are 95% intervals of the mean over directions.",
        settings.views.len(),
        settings.distances.len()
    )
}

/// The result of the experiment, whatever it is.
pub(super) fn equal_cost(report: &Report) -> String {
    let Some(equal) = &report.equal_cost else {
        return String::new();
    };
    let said = |versus: Option<Versus>, views: &str| {
        versus.map(|v| {
            let difference = v.marquetry - v.discrete_lods;
            let word = if difference >= 0.0 { "above" } else { "below" };
            format!(
                "{views}: Marquetry {:.4}, discrete LODs {:.4}, so Marquetry is {:.4} {word}",
                v.marquetry,
                v.discrete_lods,
                difference.abs()
            )
        })
    };
    let pairs = &equal.pairs;
    let ahead = pairs
        .iter()
        .filter(|p| p.all_views.marquetry >= p.all_views.discrete_lods)
        .count();
    let sentences: Vec<String> = [
        said(
            equal.all_views,
            &format!("SSIM over {} views", report.settings.views.len()),
        ),
        said(equal.three_views, "over three views"),
    ]
    .into_iter()
    .flatten()
    .collect();
    if sentences.is_empty() {
        return "Nowhere do both draw as many triangles, so nothing can be said.".to_owned();
    }
    format!(
        "With as many triangles, {}. Marquetry is ahead in {ahead} of {} settings.",
        sentences.join("; "),
        pairs.len()
    )
}

pub(super) fn frame_times(adapter: &Adapter) -> (String, &'static str) {
    const HOW: &str = "Median over views, everything loaded. Processor time is until the graphics adapter has its commands; a frame is until the picture is there.";
    let says = if adapter.software {
        "This machine draws in software, on the processor: these times say nothing of a graphics card's, are not compared, and no point is marked as better. \
         Run the command where there is a graphics card for times that count."
    } else {
        "Times are of this graphics card and this machine."
    };
    (says.to_owned(), HOW)
}

/// By transition, in the order of the points: the mean over paths of the 99th percentile of popping, and of triangles.
pub(super) fn by_transition(points: &[TransitionPoint]) -> Vec<(&str, f64, f64)> {
    let mut sums: Vec<(&str, f64, f64, f64)> = Vec::new();
    for point in points {
        let known = sums.iter().position(|sum| sum.0 == point.transition);
        let place = known.unwrap_or_else(|| {
            sums.push((&point.transition, 0.0, 0.0, 0.0));
            sums.len() - 1
        });
        let sum = &mut sums[place];
        sum.1 += point.temporal.p99;
        sum.2 += point.triangles;
        sum.3 += 1.0;
    }
    let mean = |(name, popping, triangles, count)| (name, popping / count, triangles / count);
    sums.into_iter().map(mean).collect()
}

/// Transitions that pop by less than this times the least are alike.
pub(super) const ALIKE: f64 = 1.02;

/// Which transition to take, computed: of those that pop about as little as any, the one that draws least.
pub(super) fn transitions(points: &[TransitionPoint]) -> String {
    let all = by_transition(points);
    let least = all.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let alike = all.iter().filter(|t| t.1 <= ALIKE * least);
    let Some(best) = alike.min_by(|a, b| a.2.total_cmp(&b.2)) else {
        return String::new();
    };
    let each = all.iter().map(|(name, popping, triangles)| {
        format!(
            "{name} {:.2}% at {} triangles",
            100.0 * popping,
            short(*triangles)
        )
    });
    format!(
        "For this model, by itself: {}. Of those that pop within 2% as little as any it draws the fewest triangles. The 99th percentile of \
         popping is {}.{}",
        best.0,
        each.collect::<Vec<_>>().join(", "),
        unchanged(points)
    )
}

/// What is left where no level changes, in words; nothing where that is not known.
fn unchanged(points: &[TransitionPoint]) -> String {
    let known: Vec<f64> = points
        .iter()
        .filter_map(|point| Some(point.unchanged.as_ref()?.p99))
        .collect();
    if known.is_empty() {
        return String::new();
    }
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    format!(
        " It is {:.2}% where no level changes, from the camera's motion alone.",
        100.0 * mean
    )
}

pub(super) const HOW_ROWS: &str = "Models stand in a row along the view axis, 2.5 radii apart, and every one of them is drawn, however many are in front of it. The row \
recedes by one place in 24 frames and comes back; numbers are means over those frames, everything loaded before. They are put together from \
the flight of one model through all places, so what could be saved by drawing models together is not in them. Advised is, of the transitions whose \
frames cost at most 1.25 times the cheapest's, the one that pops least by the table above; cost is triangles where the machine draws in \
software, and time on a graphics card.";

/// Which transition to take for how many models.
pub(super) fn rows(report: &Report) -> String {
    let advice = report
        .recommendations
        .chunk_by(|a, b| a.transition == b.transition);
    let each = advice.filter_map(|same| {
        let (first, last) = (same.first()?, same.last()?);
        Some(format!(
            "{} for {} models",
            first.transition,
            if first.instances == last.instances {
                first.instances.to_string()
            } else {
                format!("{} to {}", first.instances, last.instances)
            }
        ))
    });
    let kind = if report.input.textured {
        "with textures"
    } else {
        "without textures"
    };
    format!(
        "For rows of this model ({} triangles, {kind}): {}.",
        count(report.input.triangles),
        each.collect::<Vec<_>>().join(", ")
    )
}

pub(super) fn conversions(points: &[ConversionPoint]) -> String {
    let by = |a: &&ConversionPoint, b: &&ConversionPoint| a.rms_rel.total_cmp(&b.rms_rel);
    match (points.iter().max_by(by), points.iter().min_by(by)) {
        (Some(coarse), Some(fine)) if points.len() > 1 => format!(
            "An error of {} takes {:.1} s and {} bytes, one of {} takes {:.1} s and {} bytes.",
            error(coarse.rms_rel),
            coarse.seconds,
            count(coarse.bytes),
            error(fine.rms_rel),
            fine.seconds,
            count(fine.bytes)
        ),
        (Some(only), _) => format!(
            "An error of {} takes {:.1} s and {} bytes.",
            error(only.rms_rel),
            only.seconds,
            count(only.bytes)
        ),
        _ => String::new(),
    }
}

pub(super) fn how_conversions(report: &Report) -> String {
    format!(
        "The input was converted again for each target, on {} threads, one after another; each time was taken once, so differences of a few \
         percent mean nothing. Errors are as the converter measured them on the file it wrote.",
        report.settings.threads
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transition_to_take_pops_little_and_draws_least() {
        let point = TransitionPoint::bare;
        let points = [
            point("none", 0.05, 900.0),
            point("alpha", 0.0300, 1_500.0),
            point("geomorph", 0.0302, 1_000.0),
        ];
        let text = transitions(&points);
        assert!(
            text.starts_with("For this model, by itself: geomorph."),
            "{text}"
        );
        assert!(text.contains("alpha 3.00% at 1.5k triangles"), "{text}");
        assert!(!text.contains("no level"), "{text}");
        let mut still = point("none", 0.05, 900.0);
        still.unchanged = Some(still.temporal);
        let text = transitions(&[still]);
        assert!(
            text.ends_with("It is 5.00% where no level changes, from the camera's motion alone."),
            "{text}"
        );
        assert_eq!(transitions(&[]), "");
    }

    #[test]
    fn ratios_are_taken_at_equal_cost_and_only_there() {
        let points = [
            GeometryPoint::bare(Method::DiscreteLods, 100, 1e-2),
            GeometryPoint::bare(Method::DiscreteLods, 10_000, 1e-4),
            GeometryPoint::bare(Method::Marquetry, 1_000, 2e-3),
            GeometryPoint::bare(Method::Marquetry, 100, 1e-2),
            GeometryPoint::bare(Method::Marquetry, 50, 1.0),
            GeometryPoint::bare(Method::Marquetry, 20_000, 1.0),
        ];
        let (mean, least, largest, count) = ratios(&points, |p| Some(p.triangles as f64)).unwrap();
        assert_eq!(count, 2);
        assert!((least - 1.0).abs() < 1e-9 && (largest - 2.0).abs() < 1e-9);
        assert!((mean - 2.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(ratios(&points, |p| p.bytes.map(|b| b as f64)), None);
        assert!(compared(None, "bytes").contains("not compared"));
    }
}
