//! The plots of a report.

use super::data::{ConversionPoint, GeometryPoint, Method, PicturePoint, Report, RowPoint};
use super::pictures::same;
use marquetry_evaluation::pareto;
use marquetry_evaluation::plot::{Axis, Line, Plot, Point, Series, short};

/// Colours and marks: 0 is the file's everywhere, 1 that of levels of detail, 5 the original's; others share the rest.
fn style(method: &Method, externals: &[&Method]) -> usize {
    match method {
        Method::Marquetry => 0,
        Method::DiscreteLods => 1,
        Method::Original => 5,
        Method::External(_) => {
            2 + externals
                .iter()
                .position(|m| *m == method)
                .unwrap_or_default()
                % 3
        }
    }
}

/// Methods of points, each once, in the order in which they come.
fn methods<'a>(all: impl Iterator<Item = &'a Method>) -> Vec<&'a Method> {
    let mut methods: Vec<&Method> = Vec::new();
    for method in all {
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    methods
}

fn externals(report: &Report) -> Vec<&Method> {
    let all = methods(report.geometry.iter().map(|p| &p.method));
    let mut externals = all;
    externals.retain(|method| matches!(method, Method::External(_)));
    externals
}

/// What of a point of the geometry is plotted against what.
struct Pair {
    x: fn(&GeometryPoint) -> Option<f64>,
    y: fn(&GeometryPoint) -> Option<f64>,
    interval: fn(&GeometryPoint) -> Option<[f64; 2]>,
    on_front: fn(&GeometryPoint) -> bool,
}

fn geometry_series(report: &Report, pair: &Pair) -> Vec<Series> {
    let externals = externals(report);
    let kinds = methods(report.geometry.iter().map(|p| &p.method));
    let of = |method: &&Method| {
        let own = report.geometry.iter().filter(|p| p.method == **method);
        let points = own.filter_map(|p| {
            let (x, y) = ((pair.x)(p)?, (pair.y)(p)?);
            Some(Point {
                x,
                y,
                interval: (pair.interval)(p),
                on_front: (pair.on_front)(p),
                label: format!("{}: {}, {}", p.method.name(), short(x), short(y)),
            })
        });
        Series {
            name: method.name().to_owned(),
            style: style(method, &externals),
            line: Line::Solid,
            points: points.collect(),
        }
    };
    kinds
        .iter()
        .filter(|method| ***method != Method::Original)
        .map(of)
        .collect()
}

/// RMS error against triangles.
pub(super) fn rms_by_triangles(report: &Report) -> Plot {
    let pair = Pair {
        x: |p| Some(p.triangles as f64),
        y: |p| Some(p.rms_rel),
        interval: |p| p.rms_interval_rel,
        on_front: |p| p.on_front.triangles,
    };
    Plot {
        title: "RMS error against triangles drawn".to_owned(),
        x: Axis::log("triangles drawn"),
        y: Axis::log("RMS error / diagonal"),
        series: geometry_series(report, &pair),
        guides: original(report, |p| Some(p.triangles as f64)),
    }
}

/// RMS error against bytes.
pub(super) fn rms_by_bytes(report: &Report) -> Plot {
    let pair = Pair {
        x: |p| Some(p.bytes? as f64),
        y: |p| Some(p.rms_rel),
        interval: |p| p.rms_interval_rel,
        on_front: |p| p.on_front.bytes,
    };
    Plot {
        title: "RMS error against bytes read".to_owned(),
        x: Axis::log("bytes read"),
        y: Axis::log("RMS error / diagonal"),
        series: geometry_series(report, &pair),
        guides: original(report, |p| Some(p.bytes? as f64)),
    }
}

/// Hausdorff distance against triangles, with the guaranteed bound.
pub(super) fn largest_by_triangles(report: &Report) -> Plot {
    let pair = Pair {
        x: |p| Some(p.triangles as f64),
        y: |p| p.hausdorff_rel,
        interval: |_| None,
        on_front: |p| p.on_front.hausdorff,
    };
    let mut series = geometry_series(report, &pair);
    let bound = Pair {
        y: |p| p.bound_rel,
        ..pair
    };
    let bounds = geometry_series(report, &bound);
    series.extend(bounds.into_iter().filter(|s| s.style == 0).map(|s| Series {
        name: "Marquetry, guaranteed".to_owned(),
        line: Line::Dashed,
        ..s
    }));
    Plot {
        title: "Largest error against triangles drawn".to_owned(),
        x: Axis::log("triangles drawn"),
        y: Axis::log("largest error / diagonal"),
        series,
        guides: original(report, |p| Some(p.triangles as f64)),
    }
}

fn original(report: &Report, of: fn(&GeometryPoint) -> Option<f64>) -> Vec<(f64, String)> {
    let all = report
        .geometry
        .iter()
        .filter(|p| p.method == Method::Original);
    all.filter_map(|p| Some((of(p)?, "original".to_owned())))
        .collect()
}

/// Which end of an axis is the better one.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Best {
    Low,
    High,
    /// Points are not ranked.
    Neither,
}

/// Marks the points of all series that are on the front of what is plotted.
fn mark_front(series: &mut [Series], best: Best) {
    let sign = match best {
        Best::Low => 1.0,
        Best::High => -1.0,
        Best::Neither => return,
    };
    let points = series.iter().flat_map(|series| &series.points);
    let pairs: Vec<(f64, f64)> = points.map(|p| (p.x, sign * p.y)).collect();
    let points = series.iter_mut().flat_map(|series| &mut series.points);
    for (point, on_front) in points.zip(pareto::front(&pairs)) {
        point.on_front = on_front;
    }
}

/// What of a point of pictures is plotted against what.
pub(super) struct PicturePair {
    x: fn(&PicturePoint) -> Option<f64>,
    x_label: &'static str,
    y: fn(&PicturePoint) -> Option<f64>,
    y_axis: fn() -> Axis,
    interval: fn(&PicturePoint) -> Option<[f64; 2]>,
    best: Best,
}

pub(super) const SSIM: PicturePair = PicturePair {
    x: |p| Some(p.triangles),
    x_label: "triangles drawn (mean of the views)",
    y: |p| Some(p.ssim.mean),
    y_axis: || Axis::linear("SSIM (1 = no difference)"),
    interval: |p| p.ssim.interval,
    best: Best::High,
};
pub(super) const FLIP: PicturePair = PicturePair {
    y: |p| Some(p.flip.mean),
    y_axis: || Axis::linear("FLIP (0 = no difference)"),
    interval: |p| p.flip.interval,
    best: Best::Low,
    ..SSIM
};
pub(super) const OUTLINE: PicturePair = PicturePair {
    y: |p| Some(p.outline?.mean_px),
    y_axis: || Axis::linear("outline is off by, pixels"),
    interval: |_| None,
    ..FLIP
};
pub(super) const SSIM_BY_CPU: PicturePair = PicturePair {
    x: |p| Some(p.time.cpu_ms).filter(|_| p.time.frames > 0),
    x_label: "processor time of a frame, ms",
    best: Best::Neither,
    ..SSIM
};
pub(super) const SSIM_BY_GPU: PicturePair = PicturePair {
    x: |p| p.time.gpu_ms,
    x_label: "GPU time of a frame, ms",
    ..SSIM
};

/// Pictures from one distance.
pub(super) fn pictures(report: &Report, distance: f64, pair: &PicturePair) -> Plot {
    let own = || {
        let all = report.pictures.iter();
        all.filter(move |p| same(p.distance, distance))
    };
    let series = methods(own().map(|p| &p.method)).into_iter().map(|method| {
        let points = own().filter(|p| p.method == *method).filter_map(|p| {
            let (x, y) = ((pair.x)(p)?, (pair.y)(p)?);
            Some(Point {
                x,
                y,
                interval: (pair.interval)(p),
                on_front: false,
                label: format!("{}, {}: {}, {y:.4}", method.name(), p.setting, short(x)),
            })
        });
        Series {
            name: method.name().to_owned(),
            style: style(method, &[]),
            line: Line::Solid,
            points: points.collect(),
        }
    });
    let mut series: Vec<Series> = series.collect();
    // Times of a program that stands in for a graphics card are not ranked.
    mark_front(&mut series, pair.best);
    Plot {
        title: format!("From {distance} radii"),
        x: Axis::log(pair.x_label),
        y: (pair.y_axis)(),
        series,
        guides: Vec::new(),
    }
}

/// Triangles of a frame against models in a row.
pub(super) fn rows(report: &Report) -> Plot {
    let same = report.rows.chunk_by(|a, b| a.transition == b.transition);
    let of = |(style, points): (usize, &[RowPoint])| {
        let point = |p: &RowPoint| Point {
            x: p.instances as f64,
            y: p.triangles,
            interval: None,
            on_front: false,
            label: format!(
                "{}, {} models: {} triangles",
                p.transition,
                p.instances,
                short(p.triangles)
            ),
        };
        Series {
            name: points.first().map_or("", |p| &p.transition).to_owned(),
            style,
            line: Line::Solid,
            points: points.iter().map(point).collect(),
        }
    };
    Plot {
        title: "Triangles of a frame against models in a row".to_owned(),
        x: Axis::log("models in a row"),
        y: Axis::log("triangles of a frame"),
        series: same.enumerate().map(of).collect(),
        guides: Vec::new(),
    }
}

/// Seconds of conversion against the error reached.
pub(super) fn conversions(points: &[ConversionPoint]) -> Plot {
    conversion_plot(points, "seconds to convert", |p| p.seconds, |p| p.on_front)
}

/// Bytes of the file against the error reached.
pub(super) fn conversion_bytes(points: &[ConversionPoint]) -> Plot {
    conversion_plot(points, "bytes of the file", |p| p.bytes as f64, |_| false)
}

fn conversion_plot(
    points: &[ConversionPoint],
    label: &str,
    x: fn(&ConversionPoint) -> f64,
    on_front: fn(&ConversionPoint) -> bool,
) -> Plot {
    let points = points.iter().map(|p| Point {
        x: x(p),
        y: p.rms_rel,
        interval: None,
        on_front: on_front(p),
        label: format!(
            "asked for {}: {}, {}",
            short(p.error_rel),
            short(x(p)),
            short(p.rms_rel)
        ),
    });
    Plot {
        title: format!("RMS error against {label}"),
        x: Axis::log(label),
        y: Axis::log("RMS error / diagonal"),
        series: vec![Series {
            name: "marquetry convert".to_owned(),
            style: 0,
            line: Line::Solid,
            points: points.collect(),
        }],
        guides: Vec::new(),
    }
}
