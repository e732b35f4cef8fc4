//! The tables of a report, for those who read tables, and all of it as CSV.

use super::data::{
    ConversionPoint, GeometryPoint, Method, PicturePoint, Report, RowPoint, TransitionPoint,
};
use super::pictures::same;
use marquetry_evaluation::plot::escaped;
use std::fmt::Write;

/// A table of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Table {
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    /// As an HTML `<table>`; `caption` is told to those who cannot see the plot beside it.
    pub(super) fn to_html(&self, caption: &str) -> String {
        let mut html = format!(
            "<div class=\"table\"><table><caption>{}</caption><thead><tr>",
            escaped(caption)
        );
        for cell in &self.head {
            let _ = write!(html, "<th scope=\"col\">{}</th>", escaped(cell));
        }
        html.push_str("</tr></thead><tbody>");
        for row in &self.rows {
            html.push_str("<tr>");
            for cell in row {
                let _ = write!(html, "<td>{}</td>", escaped(cell));
            }
            html.push_str("</tr>");
        }
        html.push_str("</tbody></table></div>\n");
        html
    }
}

/// An error with three digits.
pub(super) fn error(value: f64) -> String {
    if value > 0.0 {
        format!("{value:.2e}")
    } else {
        "0".to_owned()
    }
}

/// A whole number in groups of three digits.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

fn rounded(value: f64) -> String {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "numbers of triangles"
    )]
    let whole = value.round().max(0.0) as u64;
    count(whole)
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}

fn yes(on_front: bool) -> String {
    if on_front { "●" } else { "" }.to_owned()
}

/// All points of the geometry.
pub(super) fn geometry(report: &Report) -> Table {
    let row = |p: &GeometryPoint| {
        let interval = p.rms_interval_rel.filter(|_| p.method != Method::Original);
        vec![
            p.method.name().to_owned(),
            count(p.triangles),
            or_dash(p.bytes.map(count)),
            error(p.rms_rel),
            or_dash(interval.map(|[low, high]| format!("{} to {}", error(low), error(high)))),
            or_dash(p.hausdorff_rel.map(error)),
            or_dash(p.bound_rel.map(error)),
            or_dash(
                p.normal_deviation_deg
                    .map(|degrees| format!("{degrees:.1}")),
            ),
            or_dash(p.seconds.map(|seconds| format!("{seconds:.2}"))),
            yes(p.on_front.triangles),
            yes(p.on_front.bytes),
        ]
    };
    Table {
        head: vec![
            "surface",
            "triangles",
            "bytes",
            "RMS",
            "95% interval",
            "largest",
            "guaranteed",
            "normals, °",
            "made in, s",
            "front (triangles)",
            "front (bytes)",
        ],
        rows: report.geometry.iter().map(row).collect(),
    }
}

/// Pictures from one distance.
pub(super) fn pictures(report: &Report, distance: f64) -> Table {
    let row = |p: &PicturePoint| {
        let interval = |e: super::data::Estimate| {
            let half = e.interval.map(|[low, high]| 0.5 * (high - low));
            or_dash(half.map(|half| format!("±{half:.4}")))
        };
        vec![
            p.method.name().to_owned(),
            p.setting.clone(),
            rounded(p.triangles),
            format!("{:.4}", p.ssim.mean),
            interval(p.ssim),
            format!("{:.4}", p.flip.mean),
            interval(p.flip),
            p.psnr_db
                .map_or_else(|| "∞".to_owned(), |db| format!("{db:.1}")),
            or_dash(p.outline.map(|o| format!("{:.2}", o.mean_px))),
            or_dash(p.outline.map(|o| format!("{:.1}", o.max_px))),
            format!("{:.2}", p.time.cpu_ms),
            format!("{:.1}", p.time.frame_ms),
            or_dash(p.time.gpu_ms.map(|ms| format!("{ms:.2}"))),
            yes(p.on_front),
        ]
    };
    let own = report
        .pictures
        .iter()
        .filter(|p| same(p.distance, distance));
    Table {
        head: vec![
            "drawn",
            "setting",
            "triangles",
            "SSIM",
            "95%",
            "FLIP",
            "95%",
            "PSNR, dB",
            "outline, mean px",
            "outline, largest px",
            "CPU, ms",
            "frame, ms",
            "GPU, ms",
            "front",
        ],
        rows: own.map(row).collect(),
    }
}

/// The file against levels of detail at equal cost.
pub(super) fn equal_cost(report: &Report) -> Table {
    let pairs = report.equal_cost.iter().flat_map(|equal| &equal.pairs);
    let rows = pairs.map(|pair| {
        let three = pair.three_views;
        let difference = |v: super::data::Versus| format!("{:+.4}", v.marquetry - v.discrete_lods);
        vec![
            pair.distance.to_string(),
            pair.setting.clone(),
            rounded(pair.triangles),
            format!("{:.4}", pair.all_views.marquetry),
            format!("{:.4}", pair.all_views.discrete_lods),
            difference(pair.all_views),
            or_dash(three.map(|v| format!("{:.4}", v.marquetry))),
            or_dash(three.map(|v| format!("{:.4}", v.discrete_lods))),
            or_dash(three.map(difference)),
        ]
    });
    Table {
        head: vec![
            "distance, radii",
            "setting",
            "triangles",
            "Marquetry",
            "discrete LODs",
            "difference",
            "Marquetry, 3 views",
            "discrete LODs, 3 views",
            "difference, 3 views",
        ],
        rows: rows.collect(),
    }
}

/// Ways of changing levels, path by path.
pub(super) fn transitions(points: &[TransitionPoint]) -> Table {
    let row = |p: &TransitionPoint| {
        let part = |value: f64| format!("{:.3}", 100.0 * value);
        vec![
            p.transition.clone(),
            p.view.to_string(),
            p.changes.to_string(),
            part(p.temporal.mean),
            part(p.temporal.p99),
            part(p.temporal.max),
            part(p.fidelity.mean),
            part(p.fidelity.max),
            rounded(p.triangles),
        ]
    };
    Table {
        head: vec![
            "transition",
            "view",
            "changes",
            "popping, mean %",
            "popping, 99th percentile %",
            "popping, largest %",
            "off the reference, mean %",
            "off the reference, largest %",
            "triangles",
        ],
        rows: points.iter().map(row).collect(),
    }
}

/// Frames of many models, and what is advised for how many.
pub(super) fn rows(report: &Report) -> Table {
    let row = |p: &RowPoint| {
        let advised = (report.recommendations.iter())
            .any(|advice| advice.instances == p.instances && advice.transition == p.transition);
        vec![
            p.instances.to_string(),
            p.transition.clone(),
            rounded(p.triangles),
            rounded(p.draw_calls),
            format!("{:.3}", p.cpu_ms),
            or_dash(p.gpu_ms.map(|ms| format!("{ms:.3}"))),
            yes(advised),
        ]
    };
    let mut points: Vec<&RowPoint> = report.rows.iter().collect();
    points.sort_by_key(|p| p.instances);
    Table {
        head: vec![
            "models",
            "transition",
            "triangles",
            "draw calls",
            "processor, ms",
            "GPU, ms",
            "advised",
        ],
        rows: points.into_iter().map(row).collect(),
    }
}

/// Conversions.
pub(super) fn conversions(points: &[ConversionPoint]) -> Table {
    let row = |p: &ConversionPoint| {
        vec![
            error(p.error_rel),
            format!("{:.1}", p.seconds),
            format!("{:.1}", p.cpu_seconds),
            count(p.bytes),
            error(p.rms_rel),
            error(p.max_rel),
            yes(p.on_front),
        ]
    };
    Table {
        head: vec![
            "RMS asked for",
            "seconds",
            "processor seconds",
            "bytes",
            "RMS reached",
            "guaranteed",
            "front",
        ],
        rows: points.iter().map(row).collect(),
    }
}

/// Columns of the CSV; a row has those of its kind and nothing in the others.
const COLUMNS: [&str; 36] = [
    "kind",
    "method",
    "distance",
    "setting",
    "views",
    "triangles",
    "bytes",
    "error_rel",
    "rms_rel",
    "rms_low_rel",
    "rms_high_rel",
    "hausdorff_rel",
    "bound_rel",
    "normal_deviation_deg",
    "ssim",
    "ssim_low",
    "ssim_high",
    "flip",
    "psnr_db",
    "outline_mean_px",
    "outline_max_px",
    "cpu_ms",
    "frame_ms",
    "gpu_ms",
    "seconds",
    "cpu_seconds",
    "on_front_triangles",
    "on_front_bytes",
    "view",
    "instances",
    "draw_calls",
    "popping_mean",
    "popping_p99",
    "popping_max",
    "fidelity_mean",
    "fidelity_max",
];

/// All points, one a row.
pub(super) fn csv(report: &Report) -> String {
    let mut text = COLUMNS.join(",");
    text.push('\n');
    let mut row = |cells: Vec<(&str, Option<String>)>| {
        let line = COLUMNS.map(|column| {
            let cell = cells.iter().find(|(name, _)| *name == column);
            let value = cell
                .and_then(|(_, value)| value.clone())
                .unwrap_or_default();
            if value.contains([',', '"', '\n', '\r']) {
                format!("\"{}\"", value.replace('"', "\"\""))
            } else {
                value
            }
        });
        text.push_str(&line.join(","));
        text.push('\n');
    };
    let number = |value: f64| Some(value.to_string());
    for p in &report.geometry {
        let interval = p.rms_interval_rel;
        row(vec![
            ("kind", Some("geometry".to_owned())),
            ("method", Some(p.method.name().to_owned())),
            ("triangles", Some(p.triangles.to_string())),
            ("bytes", p.bytes.map(|bytes| bytes.to_string())),
            ("rms_rel", number(p.rms_rel)),
            ("rms_low_rel", interval.and_then(|i| number(i[0]))),
            ("rms_high_rel", interval.and_then(|i| number(i[1]))),
            ("hausdorff_rel", p.hausdorff_rel.and_then(number)),
            ("bound_rel", p.bound_rel.and_then(number)),
            (
                "normal_deviation_deg",
                p.normal_deviation_deg.and_then(number),
            ),
            ("seconds", p.seconds.and_then(number)),
            ("on_front_triangles", Some(p.on_front.triangles.to_string())),
            ("on_front_bytes", Some(p.on_front.bytes.to_string())),
        ]);
    }
    for p in &report.pictures {
        row(vec![
            ("kind", Some("picture".to_owned())),
            ("method", Some(p.method.name().to_owned())),
            ("distance", number(p.distance)),
            ("setting", Some(p.setting.clone())),
            ("views", Some(p.views.to_string())),
            ("triangles", number(p.triangles)),
            ("ssim", number(p.ssim.mean)),
            ("ssim_low", p.ssim.interval.and_then(|i| number(i[0]))),
            ("ssim_high", p.ssim.interval.and_then(|i| number(i[1]))),
            ("flip", number(p.flip.mean)),
            ("psnr_db", p.psnr_db.and_then(number)),
            ("outline_mean_px", p.outline.and_then(|o| number(o.mean_px))),
            ("outline_max_px", p.outline.and_then(|o| number(o.max_px))),
            ("cpu_ms", number(p.time.cpu_ms)),
            ("frame_ms", number(p.time.frame_ms)),
            ("gpu_ms", p.time.gpu_ms.and_then(number)),
            ("on_front_triangles", Some(p.on_front.to_string())),
        ]);
    }
    for p in &report.transitions {
        row(vec![
            ("kind", Some("transition".to_owned())),
            ("method", Some(Method::Marquetry.name().to_owned())),
            ("setting", Some(p.transition.clone())),
            ("view", Some(p.view.to_string())),
            ("triangles", number(p.triangles)),
            ("popping_mean", number(p.temporal.mean)),
            ("popping_p99", number(p.temporal.p99)),
            ("popping_max", number(p.temporal.max)),
            ("fidelity_mean", number(p.fidelity.mean)),
            ("fidelity_max", number(p.fidelity.max)),
        ]);
    }
    for p in &report.rows {
        row(vec![
            ("kind", Some("row".to_owned())),
            ("method", Some(Method::Marquetry.name().to_owned())),
            ("setting", Some(p.transition.clone())),
            ("instances", Some(p.instances.to_string())),
            ("triangles", number(p.triangles)),
            ("draw_calls", number(p.draw_calls)),
            ("cpu_ms", number(p.cpu_ms)),
            ("gpu_ms", p.gpu_ms.and_then(number)),
        ]);
    }
    for p in &report.conversions {
        row(vec![
            ("kind", Some("conversion".to_owned())),
            ("method", Some(Method::Marquetry.name().to_owned())),
            ("bytes", Some(p.bytes.to_string())),
            ("error_rel", number(p.error_rel)),
            ("rms_rel", number(p.rms_rel)),
            ("bound_rel", number(p.max_rel)),
            ("seconds", number(p.seconds)),
            ("cpu_seconds", number(p.cpu_seconds)),
        ]);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!(count(0), "0");
        assert_eq!(count(999), "999");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(error(0.0), "0");
        assert_eq!(error(1.234e-4), "1.23e-4");
    }

    #[test]
    fn tables_escape_what_others_wrote() {
        let table = Table {
            head: vec!["a"],
            rows: vec![vec!["<script>".to_owned()]],
        };
        let html = table.to_html("x & y");
        assert!(html.contains("&lt;script&gt;") && html.contains("x &amp; y"));
    }
}
