//! The report as one HTML page that needs nothing beside it.

use super::data::{Method, Report};
use super::figures;
use super::tables::{self, Table, count, error};
use super::words;
use marquetry_evaluation::plot::{Plot, STYLE, escaped};
use std::fmt::Write;

/// Style of the page; plots have their own.
const PAGE_STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1c1d1f;--soft:#5b5f66;--paper:#fff;--rule:#d8dade;--tint:#f4f5f7}\
@media(prefers-color-scheme:dark){:root{--ink:#e4e5e7;--soft:#a3a7ae;--paper:#17191c;--rule:#3a3d42;--tint:#202327}}\
*{box-sizing:border-box}body{margin:0 auto;padding:1.5rem 1rem 4rem;max-width:80rem;\
font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper)}\
h1{font-size:1.6rem;line-height:1.2;overflow-wrap:anywhere}\
h2{font-size:1.2rem;margin:2.5rem 0 .5rem;border-top:1px solid var(--rule);padding-top:1rem}\
h3{font-size:1rem;margin:.5rem 0 .25rem}p,li,dd{max-width:46rem}.how{color:var(--soft);font-size:.9rem}\
.says{font-weight:600}.pair{display:grid;gap:1rem;align-items:start}.panels{display:grid;gap:1rem;\
grid-template-columns:repeat(auto-fit,minmax(min(20rem,100%),1fr))}.plot{width:100%;max-width:40rem;height:auto;display:block}\
figure{margin:0;min-width:0}.table{overflow:auto;max-height:26rem;min-width:0;border:1px solid var(--rule);border-radius:4px}\
table{border-collapse:collapse;font-size:.8rem;font-variant-numeric:tabular-nums;white-space:nowrap;width:100%}\
caption{text-align:left;padding:.3rem .6rem;color:var(--soft)}\
th,td{padding:.2rem .6rem;text-align:right;border-top:1px solid var(--rule)}\
th:first-child,td:first-child{text-align:left}thead th{position:sticky;top:0;background:var(--tint)}\
.tag{background:var(--tint);border:1px solid var(--rule);border-radius:4px;padding:.05rem .4rem;font-size:.85rem}\
dt{font-weight:600}dd{margin:0 0 .5rem 0}details{margin:.5rem 0}code{overflow-wrap:anywhere}\
@media(min-width:64rem){.pair{grid-template-columns:minmax(0,1fr) minmax(0,1fr)}}";

/// A plot that is a file of its own as well.
pub(super) struct Drawn {
    /// Its name, without extension.
    pub(super) name: String,
    pub(super) svg: String,
}

/// The page, and the plots in it.
pub(super) fn page(report: &Report) -> (String, Vec<Drawn>) {
    let mut page = Page {
        html: String::new(),
        drawn: Vec::new(),
    };
    page.begin(report);
    page.geometry(report);
    page.pictures(report);
    page.equal_cost(report);
    page.frame_times(report);
    page.transitions(report);
    page.conversions(report);
    page.end(report);
    (page.html, page.drawn)
}

struct Page {
    html: String,
    drawn: Vec<Drawn>,
}

impl Page {
    fn begin(&mut self, report: &Report) {
        let title = format!("What accuracy costs: {}", base_name(&report.file.path));
        let _ = write!(
            self.html,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{0}</title><style>{PAGE_STYLE}{STYLE}</style></head><body>\n<h1>{0}</h1>\n",
            escaped(&title)
        );
        for sentence in words::introduction(report) {
            let _ = writeln!(self.html, "<p>{}</p>", escaped(&sentence));
        }
        self.html
            .push_str("<details><summary>Words on this page</summary><dl>");
        for (word, meaning) in words::MEANINGS {
            let _ = write!(self.html, "<dt>{word}</dt><dd>{meaning}</dd>");
        }
        self.html.push_str("</dl></details>\n");
        if !report.notes.is_empty() {
            self.html
                .push_str("<h2>Before you read the numbers</h2><ul>");
            for note in &report.notes {
                let _ = write!(self.html, "<li>{}</li>", escaped(note));
            }
            self.html.push_str("</ul>\n");
        }
    }

    fn geometry(&mut self, report: &Report) {
        self.heading(
            "Shape: error against triangles",
            &words::equal_triangles(report),
            words::HOW_GEOMETRY,
        );
        let table = tables::geometry(report);
        let plot = figures::rms_by_triangles(report);
        self.pair("rms-triangles", &plot, Some(&table));
        self.heading(
            "Shape: error against bytes",
            &words::equal_bytes(report),
            words::HOW_BYTES,
        );
        let columns = ["surface", "bytes", "RMS", "front (bytes)"];
        self.pair(
            "rms-bytes",
            &figures::rms_by_bytes(report),
            Some(&part(&table, &columns)),
        );
        self.heading(
            "Shape: the largest error, and what is guaranteed",
            &words::bound(report),
            words::HOW_LARGEST,
        );
        let columns = ["surface", "triangles", "largest", "guaranteed"];
        self.pair(
            "largest-triangles",
            &figures::largest_by_triangles(report),
            Some(&part(&table, &columns)),
        );
    }

    fn pictures(&mut self, report: &Report) {
        if report.pictures.is_empty() {
            return;
        }
        self.heading(
            "Pictures: likeness against triangles drawn",
            &words::likeness(report),
            &words::how_pictures(report),
        );
        for (name, what, pair) in [
            (
                "ssim",
                "Structural similarity (SSIM): higher is better",
                &figures::SSIM,
            ),
            (
                "flip",
                "Visible difference (FLIP): lower is better",
                &figures::FLIP,
            ),
            (
                "outline",
                "Distance between outlines: lower is better",
                &figures::OUTLINE,
            ),
        ] {
            let _ = write!(self.html, "<h3>{what}</h3><div class=\"panels\">");
            for &distance in &report.settings.distances {
                let plot = figures::pictures(report, distance, pair);
                self.panel(&format!("{name}-{distance}"), &plot);
            }
            self.html.push_str("</div>\n");
        }
        self.html.push_str("<h3>The same in numbers</h3>");
        for &distance in &report.settings.distances {
            let table = tables::pictures(report, distance);
            let html = table.to_html(&format!("From {distance} bounding-sphere radii"));
            self.html.push_str(&html);
        }
    }

    fn equal_cost(&mut self, report: &Report) {
        if report.equal_cost.is_none() {
            return;
        }
        self.heading(
            "Pictures: at equal cost",
            &words::equal_cost(report),
            words::HOW_EQUAL_COST,
        );
        let html = tables::equal_cost(report).to_html("SSIM at as many triangles");
        self.html.push_str(&html);
    }

    fn frame_times(&mut self, report: &Report) {
        let Some(adapter) = &report.adapter else {
            return;
        };
        let (says, how) = words::frame_times(adapter);
        self.heading("Pictures: time of a frame", &says, how);
        let tag = if adapter.software {
            "software"
        } else {
            "hardware"
        };
        let _ = write!(
            self.html,
            "<p><span class=\"tag\">{tag}</span> {}</p><div class=\"panels\">",
            escaped(&adapter.name)
        );
        for &distance in &report.settings.distances {
            let plot = figures::pictures(report, distance, &figures::SSIM_BY_CPU);
            self.panel(&format!("ssim-cpu-{distance}"), &plot);
        }
        if !adapter.software {
            for &distance in &report.settings.distances {
                let plot = figures::pictures(report, distance, &figures::SSIM_BY_GPU);
                self.panel(&format!("ssim-gpu-{distance}"), &plot);
            }
        }
        self.html.push_str("</div>\n");
        let columns = [
            "drawn",
            "setting",
            "triangles",
            "SSIM",
            "CPU, ms",
            "frame, ms",
            "GPU, ms",
        ];
        for &distance in &report.settings.distances {
            let table = part(&tables::pictures(report, distance), &columns);
            let caption = format!("From {distance} bounding-sphere radii ({tag})");
            self.html.push_str(&table.to_html(&caption));
        }
    }

    fn transitions(&mut self, report: &Report) {
        let points = &report.transitions;
        if points.is_empty() {
            return;
        }
        self.heading(
            "Pictures: while levels change",
            &words::transitions(points),
            words::HOW_TRANSITIONS,
        );
        let html = tables::transitions(points).to_html("Popping along the path, by view");
        self.html.push_str(&html);
        if report.rows.is_empty() {
            return;
        }
        self.heading(
            "Pictures: many models in a row",
            &words::rows(report),
            words::HOW_ROWS,
        );
        self.pair(
            "row-triangles",
            &figures::rows(report),
            Some(&tables::rows(report)),
        );
    }

    fn conversions(&mut self, report: &Report) {
        let points = &report.conversions;
        if points.is_empty() {
            return;
        }
        self.heading(
            "Conversion: time against error",
            &words::conversions(points),
            &words::how_conversions(report),
        );
        let plot = figures::conversions(points);
        self.pair("convert-seconds", &plot, Some(&tables::conversions(points)));
        let plot = figures::conversion_bytes(points);
        self.html.push_str("<h3>Bytes of the same files</h3>");
        self.pair("convert-bytes", &plot, None);
    }

    fn end(&mut self, report: &Report) {
        let settings = &report.settings;
        let _ = writeln!(
            self.html,
            "<h2>How this page was made</h2><p class=\"how\">marquetry {} chart, {} threads, {:.0} seconds. \
             The same numbers are in chart.json and chart.csv beside this page, the plots as SVG files.</p>\
             </body></html>",
            env!("CARGO_PKG_VERSION"),
            settings.threads,
            report.seconds
        );
    }

    fn heading(&mut self, title: &str, says: &str, how: &str) {
        let _ = writeln!(
            self.html,
            "<h2>{}</h2><p class=\"says\">{}</p><p class=\"how\">{}</p>",
            escaped(title),
            escaped(says),
            escaped(how)
        );
    }

    fn pair(&mut self, name: &str, plot: &Plot, table: Option<&Table>) {
        self.html.push_str("<div class=\"pair\">");
        self.figure(name, plot);
        if let Some(table) = table {
            let html = table.to_html(&plot.title);
            self.html.push_str(&html);
        }
        self.html.push_str("</div>\n");
    }

    fn panel(&mut self, name: &str, plot: &Plot) {
        let _ = write!(self.html, "<div><h3>{}</h3>", escaped(&plot.title));
        self.figure(name, plot);
        self.html.push_str("</div>");
    }

    fn figure(&mut self, name: &str, plot: &Plot) {
        match plot.to_svg() {
            Some(svg) => {
                let _ = write!(self.html, "<figure>{svg}</figure>");
            }
            None => self.html.push_str("<p>Nothing to plot.</p>"),
        }
        if let Some(svg) = plot.to_svg_file() {
            self.drawn.push(Drawn {
                name: name.to_owned(),
                svg,
            });
        }
    }
}

/// Some columns of a table.
fn part(table: &Table, columns: &[&'static str]) -> Table {
    let places: Vec<usize> = columns
        .iter()
        .filter_map(|column| table.head.iter().position(|head| head == column))
        .collect();
    let row = |row: &Vec<String>| places.iter().filter_map(|&k| row.get(k).cloned()).collect();
    Table {
        head: columns.to_vec(),
        rows: table.rows.iter().map(row).collect(),
    }
}

/// The last part of a path or URL.
pub(super) fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// What the command says when it is done.
pub(super) fn summary(report: &Report, folder: &str) -> String {
    let mut text = format!("{folder}/chart.html: {}", words::equal_triangles(report));
    if report.equal_cost.is_some() {
        text.push('\n');
        text.push_str(&words::equal_cost(report));
    }
    let finest = report
        .geometry
        .iter()
        .find(|p| p.method == Method::Marquetry);
    if let Some(finest) = finest {
        let _ = write!(
            text,
            "\nfinest: {} triangles, rms {}, {:.0} s in all",
            count(finest.triangles),
            error(finest.rms_rel),
            report.seconds
        );
    }
    for note in &report.notes {
        text.push_str("\nnote: ");
        text.push_str(note);
    }
    text
}
