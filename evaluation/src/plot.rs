//! Plots as SVG: points with error bars, lines, a legend, and the Pareto front marked.
//!
//! A plot is one `<svg>` that needs nothing beside it. Colours come from [`STYLE`], which follows the reader's choice of
//! light or dark and is tellable apart by the colour-blind (Okabe and Ito's palette); series differ by the shape of their marks,
//! too. Points on a Pareto front are filled, others are hollow. Points that an axis cannot show (not finite, or not above 0
//! on a logarithmic one) are left out.

mod axis;
mod marks;

pub use axis::{Axis, Scale, short};

use std::fmt::Write;

/// Size of a plot, in its own units; it is as wide as what it is in.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 340.0;
/// Room for labels.
const LEFT: f64 = 68.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 24.0;
const BOTTOM: f64 = 52.0;
/// A row of the legend.
const ROW: f64 = 21.0;
/// About the width of a letter.
const LETTER: f64 = 7.7;

/// Style sheet of all plots; once a page, or in each plot that is a file of its own.
pub const STYLE: &str = "\
.plot{font:14px system-ui,sans-serif;--ink:#222;--grid:#e2e2e2;--paper:#fff;\
--s0:#0072b2;--s1:#d55e00;--s2:#009e73;--s3:#b0558a;--s4:#7a6a00;--s5:#555}\
@media(prefers-color-scheme:dark){.plot{--ink:#ddd;--grid:#3a3d42;--paper:#17191c;\
--s0:#5ab4ee;--s1:#ff9a56;--s2:#3fd6a5;--s3:#eb9ccb;--s4:#e5cf4e;--s5:#aaa}}\
.plot text{fill:var(--ink)}.plot .grid{stroke:var(--grid);stroke-width:1}\
.plot .frame{fill:none;stroke:var(--ink);stroke-width:1}\
.plot .line{fill:none;stroke-width:1.8}.plot .dashed{stroke-dasharray:5 4}\
.plot .bar{stroke-width:1;opacity:.7}.plot .mark{stroke-width:1.8;fill:var(--paper)}\
.plot .guide{stroke:var(--ink);stroke-width:1;stroke-dasharray:2 3;opacity:.8}\
.plot .s0{stroke:var(--s0)}.plot .s1{stroke:var(--s1)}.plot .s2{stroke:var(--s2)}\
.plot .s3{stroke:var(--s3)}.plot .s4{stroke:var(--s4)}.plot .s5{stroke:var(--s5)}\
.plot .front.s0{fill:var(--s0)}.plot .front.s1{fill:var(--s1)}.plot .front.s2{fill:var(--s2)}\
.plot .front.s3{fill:var(--s3)}.plot .front.s4{fill:var(--s4)}.plot .front.s5{fill:var(--s5)}";

/// Styles that [`STYLE`] tells apart.
pub const STYLES: usize = 6;

/// One point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Place along the axes.
    pub x: f64,
    /// Place along the axes.
    pub y: f64,
    /// Ends of an error bar along y.
    pub interval: Option<[f64; 2]>,
    /// Whether it is on the Pareto front of all that is shown.
    pub on_front: bool,
    /// What a pointer that rests on it is told.
    pub label: String,
}

/// How points of a series are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// With a line and marks.
    Solid,
    /// With a dashed line, without marks.
    Dashed,
    /// Not at all.
    None,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// As the legend calls it.
    pub name: String,
    /// Colour and mark, 0..[`STYLES`]; larger ones start again.
    pub style: usize,
    /// How its points are joined, in the order of x.
    pub line: Line,
    /// Its points.
    pub points: Vec<Point>,
}

/// A plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// What it shows, for those who cannot see it.
    pub title: String,
    /// From left to right.
    pub x: Axis,
    /// From bottom to top.
    pub y: Axis,
    /// What is drawn.
    pub series: Vec<Series>,
    /// Places along x with a line and a word.
    pub guides: Vec<(f64, String)>,
}

impl Plot {
    /// The plot as an `<svg>` element for a page that has [`STYLE`]. `None` where no point can be shown.
    pub fn to_svg(&self) -> Option<String> {
        self.drawn("")
    }

    /// The plot as a file of its own. `None` where no point can be shown.
    pub fn to_svg_file(&self) -> Option<String> {
        let style = format!("<style>{STYLE}.plot{{background:var(--paper)}}</style>");
        self.drawn(&style)
    }

    fn drawn(&self, style: &str) -> Option<String> {
        let shown = self.shown();
        let points = || shown.iter().flat_map(|series| &series.points);
        let xs = points().map(|p| p.x).chain(self.guides.iter().map(|g| g.0));
        let x = self.x.span(xs)?;
        let ends = points().flat_map(|p| {
            let ends = p.interval.unwrap_or([p.y; 2]);
            [p.y, ends[0], ends[1]]
        });
        let y = self.y.span(ends)?;
        let legend = legend_places(&shown);
        let rows = legend.last().map_or(0.0, |&(_, row)| row + 1.0);
        let height = HEIGHT + rows * ROW;
        let frame = Frame {
            x: &x,
            y: &y,
            left: LEFT,
            right: WIDTH - RIGHT,
            top: TOP,
            bottom: HEIGHT - BOTTOM,
        };
        let mut svg = format!(
            "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" \
             role=\"img\" aria-label=\"{}\">{style}<title>{0}</title>",
            escaped(&self.title)
        );
        self.draw_axes(&mut svg, &frame);
        for guide in &self.guides {
            draw_guide(&mut svg, &frame, guide);
        }
        for series in &shown {
            draw_series(&mut svg, &frame, series);
        }
        for (series, (left, row)) in shown.iter().zip(legend) {
            let middle = HEIGHT + (row + 0.35) * ROW;
            draw_key(&mut svg, series, left, middle);
        }
        svg.push_str("</svg>\n");
        Some(svg)
    }

    /// The series with the points that both axes can show, in the order of x; those without any are left out.
    fn shown(&self) -> Vec<Series> {
        let shown = self.series.iter().map(|series| {
            let mut series = series.clone();
            series
                .points
                .retain(|p| self.x.can_show(p.x) && self.y.can_show(p.y));
            series.points.sort_by(|a, b| a.x.total_cmp(&b.x));
            for point in &mut series.points {
                // An end that a logarithmic axis cannot show is where the axis begins.
                point.interval = point
                    .interval
                    .filter(|ends| self.y.can_show(ends[0]) && self.y.can_show(ends[1]));
            }
            series
        });
        shown.filter(|series| !series.points.is_empty()).collect()
    }

    fn draw_axes(&self, svg: &mut String, frame: &Frame<'_>) {
        let Frame {
            left,
            right,
            top,
            bottom,
            ..
        } = *frame;
        for (value, label) in frame.x.ticks() {
            let at = frame.across(value);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\"/>\
                 <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 18.0
            );
        }
        for (value, label) in frame.y.ticks() {
            let at = frame.up(value);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                left - 6.0,
                at + 5.0
            );
        }
        let _ = write!(
            svg,
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{:.1}\" height=\"{:.1}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            right - left,
            bottom - top,
            0.5 * (left + right),
            bottom + 41.0,
            escaped(&self.x.label),
            0.5 * (top + bottom),
            escaped(&self.y.label)
        );
    }
}

/// Where values are in a plot.
struct Frame<'a> {
    x: &'a axis::Span,
    y: &'a axis::Span,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Frame<'_> {
    fn across(&self, x: f64) -> f64 {
        self.left + self.x.part(x) * (self.right - self.left)
    }

    fn up(&self, y: f64) -> f64 {
        self.bottom - self.y.part(y) * (self.bottom - self.top)
    }
}

fn draw_guide(svg: &mut String, frame: &Frame<'_>, (x, label): &(f64, String)) {
    if !x.is_finite() {
        return;
    }
    let at = frame.across(*x);
    // Above the frame, so that it hides no point, and within the picture.
    let half = 0.5 * LETTER * label.chars().count() as f64;
    let middle = at.min(WIDTH - half).max(half);
    let _ = write!(
        svg,
        "<line class=\"guide\" x1=\"{at:.1}\" y1=\"{:.1}\" x2=\"{at:.1}\" y2=\"{:.1}\"/>\
         <text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
        frame.top,
        frame.bottom,
        frame.top - 7.0,
        escaped(label)
    );
}

fn draw_series(svg: &mut String, frame: &Frame<'_>, series: &Series) {
    let style = series.style % STYLES;
    let place = |point: &Point| (frame.across(point.x), frame.up(point.y));
    if series.line != Line::None && series.points.len() > 1 {
        let dashed = if series.line == Line::Dashed {
            " dashed"
        } else {
            ""
        };
        let _ = write!(svg, "<polyline class=\"line s{style}{dashed}\" points=\"");
        for point in &series.points {
            let (x, y) = place(point);
            let _ = write!(svg, "{x:.1},{y:.1} ");
        }
        svg.push_str("\"/>");
    }
    if series.line == Line::Dashed && series.points.len() > 1 {
        return;
    }
    for point in &series.points {
        let (x, y) = place(point);
        if let Some([low, high]) = point.interval {
            let _ = write!(
                svg,
                "<line class=\"bar s{style}\" x1=\"{x:.1}\" y1=\"{:.1}\" x2=\"{x:.1}\" y2=\"{:.1}\"/>",
                frame.up(low),
                frame.up(high)
            );
        }
        let front = if point.on_front { " front" } else { "" };
        let _ = write!(
            svg,
            "<path class=\"mark s{style}{front}\" d=\"{}\"><title>{}</title></path>",
            marks::path(style, x, y),
            escaped(&point.label)
        );
    }
}

/// Where the legend's entries begin: left end and row.
fn legend_places(series: &[Series]) -> Vec<(f64, f64)> {
    let (mut left, mut row) = (LEFT, 0.0);
    series
        .iter()
        .map(|series| {
            let width = 34.0 + LETTER * series.name.chars().count() as f64 + 12.0;
            if left > LEFT && left + width > WIDTH {
                left = LEFT;
                row += 1.0;
            }
            let place = (left, row);
            left += width;
            place
        })
        .collect()
}

fn draw_key(svg: &mut String, series: &Series, left: f64, middle: f64) {
    let style = series.style % STYLES;
    let dashed = if series.line == Line::Dashed {
        " dashed"
    } else {
        ""
    };
    if series.line != Line::None {
        let _ = write!(
            svg,
            "<line class=\"line s{style}{dashed}\" x1=\"{left}\" y1=\"{middle:.1}\" x2=\"{:.1}\" y2=\"{middle:.1}\"/>",
            left + 26.0
        );
    }
    if series.line != Line::Dashed {
        let _ = write!(
            svg,
            "<path class=\"mark front s{style}\" d=\"{}\"/>",
            marks::path(style, left + 13.0, middle)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
        left + 32.0,
        middle + 5.0,
        escaped(&series.name)
    );
}

/// Text that may stand between tags and in quoted attributes of HTML and SVG.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // Controls that XML has no way to write.
            c if c.is_control() && !c.is_whitespace() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64) -> Point {
        Point {
            x,
            y,
            interval: None,
            on_front: x < 100.0,
            label: format!("{x} <&> {y}"),
        }
    }

    fn plot(points: Vec<Point>) -> Plot {
        Plot {
            title: "errors & \"triangles\"".to_owned(),
            x: Axis::log("triangles"),
            y: Axis::log("error"),
            series: vec![Series {
                name: "a <b>".to_owned(),
                style: 1,
                line: Line::Solid,
                points,
            }],
            guides: vec![(1e4, "original".to_owned())],
        }
    }

    #[test]
    fn points_are_drawn_in_their_order_and_text_is_escaped() {
        let svg = plot(vec![point(1e3, 1e-4), point(10.0, 1e-2)])
            .to_svg()
            .unwrap();
        assert_eq!(svg.matches("class=\"mark s1\"").count(), 1);
        // One on the front, one in the legend.
        assert_eq!(svg.matches(" front").count(), 2);
        assert!(svg.contains("a &lt;b&gt;") && svg.contains("1000 &lt;&amp;&gt; 0.0001"));
        assert_eq!(svg.matches('<').count(), svg.matches('>').count());
        let line = svg
            .split("points=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let places: Vec<(f64, f64)> = line
            .split_whitespace()
            .map(|pair| pair.split_once(',').unwrap())
            .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
            .collect();
        assert!(places[0].0 < places[1].0 && places[0].1 < places[1].1);
        let inside = |&(x, y): &(f64, f64)| {
            (LEFT..=WIDTH - RIGHT).contains(&x) && (TOP..=HEIGHT - BOTTOM).contains(&y)
        };
        assert!(places.iter().all(inside), "{places:?}");
    }

    #[test]
    fn what_cannot_be_shown_is_left_out() {
        let odd = [point(0.0, 1.0), point(f64::NAN, 1.0), point(5.0, -1.0)];
        assert_eq!(plot(odd.to_vec()).to_svg(), None);
        let mut some = odd.to_vec();
        some.push(point(5.0, 1e-3));
        let svg = plot(some).to_svg().unwrap();
        assert_eq!(svg.matches("class=\"mark").count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn a_file_has_its_style_and_many_series_wrap() {
        let mut plot = plot(vec![point(10.0, 1.0), point(20.0, 2.0)]);
        let one = plot.series[0].clone();
        plot.series = (0..8)
            .map(|style| Series {
                name: format!("a rather long name {style}"),
                style,
                ..one.clone()
            })
            .collect();
        let svg = plot.to_svg_file().unwrap();
        assert!(svg.contains("<style>") && svg.contains("s5"));
        let places = legend_places(&plot.series);
        assert!(places.iter().all(|&(left, _)| left < WIDTH - 100.0));
        assert!(places.last().unwrap().1 >= 2.0);
    }
}
