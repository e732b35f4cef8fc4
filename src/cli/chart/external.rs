//! Results of other tools, from CSV.
//!
//! The first line names the columns, in any order: `tool`, `triangles` and `rms_rel` have to be there, `bytes`,
//! `hausdorff_rel` and `seconds` may be, and others are not read. A field has no comma in it and may stand in double quotes.
//! Empty lines and lines that begin with `#` do not count. Errors are relative to the diagonal of the input's bounds, and
//! measured as this command measures: that is up to whoever writes the file.

use super::data::{Fronts, GeometryPoint, Method};
use anyhow::{Context, bail};
use std::path::Path;

/// Most points of one file: more is no chart.
const MOST: usize = 10_000;
const NEEDED: [&str; 3] = ["tool", "triangles", "rms_rel"];

/// Reads the points in the file at `path`.
///
/// # Errors
/// When the file cannot be read, a column is missing, or a row is wrong: file, line and fault are named.
pub(super) fn read(path: &Path) -> anyhow::Result<Vec<GeometryPoint>> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{name}: cannot be read"))?;
    parse(&text).map_err(|(line, fault)| anyhow::anyhow!("{name}: line {line}: {fault}"))
}

type Fault = (usize, String);

fn parse(text: &str) -> Result<Vec<GeometryPoint>, Fault> {
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    let mut next = move || {
        lines.find(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
    };
    let Some((line, header)) = next() else {
        return Err((1, format!("no columns; expected {}", NEEDED.join(","))));
    };
    let columns = fields(header);
    for needed in NEEDED {
        if columns.iter().filter(|&&column| column == needed).count() != 1 {
            return Err((line, format!("expected one column `{needed}`")));
        }
    }
    let mut points = Vec::new();
    while let Some((line, row)) = next() {
        if points.len() == MOST {
            return Err((line, format!("more than {MOST} rows")));
        }
        points.push(point(&columns, &fields(row)).map_err(|fault| (line, format!("{fault:#}")))?);
    }
    if points.is_empty() {
        return Err((line, "no row follows".to_owned()));
    }
    Ok(points)
}

fn fields(line: &str) -> Vec<&str> {
    line.split(',')
        .map(|field| {
            let field = field.trim();
            let quoted = field.strip_prefix('"').and_then(|f| f.strip_suffix('"'));
            quoted.unwrap_or(field)
        })
        .collect()
}

fn point(columns: &[&str], row: &[&str]) -> anyhow::Result<GeometryPoint> {
    if row.len() != columns.len() {
        bail!("{} fields, but {} columns", row.len(), columns.len());
    }
    let field = |name: &str| {
        let place = columns.iter().position(|column| *column == name)?;
        row.get(place).copied().filter(|field| !field.is_empty())
    };
    let number = |name: &str| -> anyhow::Result<Option<f64>> {
        let Some(text) = field(name) else {
            return Ok(None);
        };
        let value = text
            .parse()
            .ok()
            .filter(|v: &f64| v.is_finite() && *v >= 0.0);
        value
            .map(Some)
            .with_context(|| format!("{name} is `{text}`; expected a number of at least 0"))
    };
    let count = |name: &str| -> anyhow::Result<Option<u64>> {
        let Some(text) = field(name) else {
            return Ok(None);
        };
        let value = text.parse().ok().filter(|value: &u64| *value > 0);
        value
            .map(Some)
            .with_context(|| format!("{name} is `{text}`; expected a whole number above 0"))
    };
    let tool = field("tool").context("tool is empty")?;
    let rms_rel = number("rms_rel")?.context("rms_rel is empty")?;
    let hausdorff_rel = number("hausdorff_rel")?;
    if let Some(hausdorff) = hausdorff_rel.filter(|&hausdorff| hausdorff < rms_rel) {
        bail!("hausdorff_rel is {hausdorff}, below rms_rel, which is {rms_rel}");
    }
    Ok(GeometryPoint {
        method: Method::External(tool.to_owned()),
        asked_triangles: None,
        triangles: count("triangles")?.context("triangles is empty")?,
        bytes: count("bytes")?,
        rms_rel,
        rms_interval_rel: None,
        hausdorff_rel,
        bound_rel: None,
        normal_deviation_deg: None,
        seconds: number("seconds")?,
        on_front: Fronts::default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_and_may_be_missing() {
        let text =
            "# by hand\nrms_rel,tool,triangles,note\n\n1e-4, \"a tool\" ,5000,x\n2e-4,b,70,\n";
        let points = parse(text).unwrap();
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].method, Method::External("a tool".to_owned()));
        assert_eq!((points[0].triangles, points[0].bytes), (5000, None));
        let text =
            "tool,triangles,rms_rel,bytes,hausdorff_rel,seconds\nt,1,0,10,0.5,2.5\nt,2,0,,,\n";
        let points = parse(text).unwrap();
        assert_eq!((points[0].bytes, points[0].seconds), (Some(10), Some(2.5)));
        assert_eq!((points[1].bytes, points[1].hausdorff_rel), (None, None));
    }

    #[test]
    fn faults_are_named_with_their_line() {
        let columns = "tool,triangles,rms_rel,hausdorff_rel\n";
        for (rows, line, part) in [
            ("", 1, "no row"),
            ("a,b\n", 2, "2 fields, but 4"),
            ("a,5,1e-3,\n\n,5,1e-3,\n", 4, "tool is empty"),
            ("a,-5,1e-3,\n", 2, "triangles is `-5`"),
            ("a,0,1e-3,\n", 2, "triangles is `0`"),
            ("a,5,nan,\n", 2, "rms_rel is `nan`"),
            ("a,5,,\n", 2, "rms_rel is empty"),
            ("a,5,1e-3,1e-4\n", 2, "below rms_rel"),
        ] {
            let (found, fault) = parse(&format!("{columns}{rows}")).unwrap_err();
            assert_eq!(found, line, "{fault}");
            assert!(fault.contains(part), "{fault}");
        }
        assert!(parse("").unwrap_err().1.contains("no columns"));
        let (line, fault) = parse("#\ntool,triangles\n").unwrap_err();
        assert_eq!((line, fault.contains("`rms_rel`")), (2, true));
        assert!(parse("tool,tool,triangles,rms_rel\n").is_err());
    }
}
