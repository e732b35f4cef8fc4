//! `GET /catalogue`: what is served, as a page for people; works without scripts.

use super::about::{Entry, text};
use super::{Shared, catalogue, viewer};
use crate::error::ApiError;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use std::fmt::{self, Write as _};

const HEAD: &str = "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
<meta name=\"viewport\" content=\"width=device-width\">\n<title>Catalogue</title>\n<style>\n\
:root { color-scheme: light dark; font: 16px/1.4 system-ui, sans-serif; }\n\
body { margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }\n\
ul { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); list-style: none; padding: 0; }\n\
li { border: 1px solid #8886; border-radius: 8px; overflow: hidden; }\n\
li a { color: inherit; display: block; text-decoration: none; }\n\
img, .none { aspect-ratio: 4 / 3; display: block; height: auto; object-fit: contain; width: 100%; background: #8882; }\n\
.none { align-items: center; display: flex; justify-content: center; opacity: .6; }\n\
h2 { font-size: 1rem; margin: .6rem .8rem .2rem; overflow-wrap: anywhere; }\n\
p { font-size: .875rem; margin: .2rem .8rem .6rem; opacity: .8; overflow-wrap: anywhere; }\n\
</style>\n<h1>Catalogue</h1>\n";

/// The page.
pub(crate) async fn page(
    State(shared): State<Shared>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let entries = catalogue::entries(&shared).await;
    let mut html = String::from(HEAD);
    if entries.is_empty() {
        html.push_str("<p>Nothing is served yet.</p>\n");
    }
    html.push_str("<ul>\n");
    for entry in &entries {
        // Writing to a string does not fail.
        let _ = card(&mut html, entry);
    }
    html.push_str("</ul>\n</html>\n");
    let page = text(&headers, "text/html; charset=utf-8", html)?;
    Ok((viewer::PAGE_HEADERS, page).into_response())
}

fn card(html: &mut String, entry: &Entry) -> fmt::Result {
    let sidecar = &entry.sidecar;
    let title = sidecar.title.as_ref().unwrap_or(&entry.name);
    write!(html, "<li><a href=\"{}\">", Escaped(&entry.viewer_url))?;
    match &entry.thumbnail_url {
        Some(url) => write!(
            html,
            // The title follows, so it is not said twice.
            "<img loading=\"lazy\" alt=\"\" width=\"256\" height=\"192\" src=\"{}\">",
            Escaped(url)
        )?,
        None => html.push_str("<span class=\"none\">no picture</span>"),
    }
    write!(html, "<h2>{}</h2>", Escaped(title))?;
    write!(
        html,
        "<p>{}, {} triangles, {}",
        entry.kind_in_words(),
        Grouped(entry.triangles),
        Size(entry.bytes)
    )?;
    let texts = [
        ("", &sidecar.description),
        ("", &sidecar.attribution),
        ("Licence: ", &sidecar.licence),
    ];
    for (before, text) in texts {
        if let Some(text) = text {
            write!(html, "<br>{before}{}", Escaped(text))?;
        }
    }
    html.push_str("</p></a></li>\n");
    Ok(())
}

/// Text with the characters replaced that mean something in HTML.
struct Escaped<'t>(&'t str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

/// A number with its thousands apart.
struct Grouped(u64);

impl fmt::Display for Grouped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.0.to_string();
        for (place, digit) in digits.chars().enumerate() {
            if place > 0 && (digits.len() - place).is_multiple_of(3) {
                f.write_char('\u{202f}')?;
            }
            f.write_char(digit)?;
        }
        Ok(())
    }
}

/// Bytes with a unit.
struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        match self.0 {
            0..1_000_000 => write!(f, "{:.0} kB", (bytes / 1e3).ceil()),
            1_000_000..1_000_000_000 => write!(f, "{:.1} MB", bytes / 1e6),
            _ => write!(f, "{:.1} GB", bytes / 1e9),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_sidecar_says_is_text_and_not_html() {
        let text = Escaped("<script>\"x\" & 'y'</script>").to_string();
        assert_eq!(
            text,
            "&lt;script&gt;&quot;x&quot; &amp; &#39;y&#39;&lt;/script&gt;"
        );
    }

    #[test]
    fn numbers_are_for_people() {
        assert_eq!(Grouped(1_234_567).to_string(), "1\u{202f}234\u{202f}567");
        assert_eq!(Grouped(12).to_string(), "12");
        assert_eq!(Size(1_500_000).to_string(), "1.5 MB");
        assert_eq!(Size(10).to_string(), "1 kB");
    }
}
