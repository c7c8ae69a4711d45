//! `report.html`: a comparison as one file that needs nothing else, neither network nor other files.
//!
//! Plots are inline SVG, pictures are PNG data URIs, and the few lines of script that sort the table are written here;
//! a content security policy forbids the rest. It is generic over the columns of [`Row`]: what the table gains, the
//! report shows.

mod escape;
mod rows;

use super::nodes::{histogram_svg, summary, tile_png};
use super::plot::{error_bytes_svg, error_time_svg};
use crate::error::Result;
use crate::files::output::write_whole;
use crate::measure::table::Row;
use crate::shadow::NodeMap;
use escape::{base64, escape};
use rows::{name, table};
use std::path::Path;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// A row with its pictures, as PNG files.
#[derive(Debug, Clone, Default)]
pub struct Entry {
    pub row: Row,
    /// What the method draws.
    pub picture_png: Option<Vec<u8>>,
    /// Where that is wrong, in false colour with its legend.
    pub error_png: Option<Vec<u8>>,
    /// Nodes by texel, of a deep shadow map.
    pub nodes: Option<NodeMap>,
}

/// What a reader has to know to judge the table.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    pub title: String,
    /// Names and values: adapter, light, repeats.
    pub facts: Vec<(String, String)>,
    /// What the error pictures show.
    pub error_caption: String,
    /// How the table was made, and what failed.
    pub notes: Vec<String>,
}

/// The report as an HTML document.
///
/// # Errors
/// The drawing backend's own.
pub fn html(conditions: &Conditions, entries: &[Entry]) -> Result<String> {
    let title = escape(&conditions.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
        <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
        style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
        <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
        <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n"
    );
    if !conditions.facts.is_empty() {
        out += "<section aria-label=\"Conditions\">\n<dl>\n";
        for (name, value) in &conditions.facts {
            out += &format!("<dt>{}</dt><dd>{}</dd>\n", escape(name), escape(value));
        }
        out += "</dl>\n</section>\n";
    }
    let rows: Vec<Row> = entries.iter().map(|e| e.row.clone()).collect();
    out += &table(&rows);
    out += &plots(&rows)?;
    out += &pictures(conditions, entries)?;
    if !conditions.notes.is_empty() {
        let items: String = conditions.notes.iter().map(|n| format!("<li>{}</li>\n", escape(n))).collect();
        out += &format!("<section>\n<h2>Notes</h2>\n<ul>\n{items}</ul>\n</section>\n");
    }
    out += &format!("</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n");
    Ok(out)
}

/// Writes the report, whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_report(conditions: &Conditions, entries: &[Entry], path: &Path) -> Result<()> {
    let text = html(conditions, entries)?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

/// Error against time and against memory, of each scene.
fn plots(rows: &[Row]) -> Result<String> {
    let mut out = String::from("<section class=\"plots\">\n<h2>Error against time and memory</h2>\n");
    let mut scenes: Vec<&str> = Vec::new();
    for row in rows {
        if !scenes.contains(&row.scene.as_str()) {
            scenes.push(&row.scene);
        }
    }
    for scene in scenes {
        let own: Vec<Row> = rows.iter().filter(|r| r.scene == scene).cloned().collect();
        let time = format!("Error against time, {scene}: each row of the table as a point");
        out += &figure(&inline(&error_time_svg(&own)?, &time), "");
        let memory =
            format!("Error against memory, {scene}: each row that stores a shadow structure as a point");
        out += &figure(&inline(&error_bytes_svg(&own)?, &memory), "");
    }
    out += "<p class=\"hint\">Errors are of transmittance, 0 to 1. Dashed: the Pareto front; nothing shown lies below \
        and left of it.</p>\n</section>\n";
    Ok(out)
}

/// For each row: its picture, its error, and its nodes.
fn pictures(conditions: &Conditions, entries: &[Entry]) -> Result<String> {
    let mut out = String::from("<section>\n<h2>Pictures</h2>\n");
    for (i, e) in entries.iter().enumerate() {
        let name = name(&e.row);
        let mut figures = String::new();
        if let Some(png) = &e.picture_png {
            figures += &figure(&image(png, &format!("Picture by {name}")), "picture");
        }
        if let Some(png) = &e.error_png {
            let caption = &conditions.error_caption;
            figures += &figure(&image(png, &format!("Error of {name}")), caption);
        }
        if let Some(nodes) = &e.nodes {
            let map = image(&tile_png(nodes)?, &format!("Nodes per tile of {name}"));
            figures +=
                &figure(&map, "nodes per tile, as Hadwiger et al. 2006, Figure 5; grey: tiles left out");
            let histogram =
                inline(&histogram_svg(nodes)?, &format!("Histogram of nodes per texel of {name}"));
            figures += &figure(&histogram, &summary(nodes));
        }
        if figures.is_empty() {
            figures = "<p class=\"hint\">no picture</p>\n".into();
        }
        let heading = match e.row.scene.as_str() {
            "" => name,
            scene => format!("{name} · {scene}"),
        };
        out += &format!(
            "<article class=\"row\" id=\"row-{}\">\n<h3>{}</h3>\n<div>\n{figures}</div>\n</article>\n",
            i + 1,
            escape(&heading)
        );
    }
    Ok(out + "</section>\n")
}

fn figure(content: &str, caption: &str) -> String {
    match caption {
        "" => format!("<figure>\n{content}\n</figure>\n"),
        _ => format!("<figure>\n{content}\n<figcaption>{}</figcaption>\n</figure>\n", escape(caption)),
    }
}

/// A PNG file as an image of its own size.
fn image(png: &[u8], about: &str) -> String {
    // Width and height keep the page from jumping; they are where every PNG file has them.
    let side = |at: usize| png.get(at..at + 4).map(|b| b.iter().fold(0_u32, |n, &b| n << 8 | u32::from(b)));
    let size = match (side(16), side(20)) {
        (Some(width), Some(height)) => format!(" width=\"{width}\" height=\"{height}\""),
        _ => String::new(),
    };
    format!("<img src=\"data:image/png;base64,{}\" alt=\"{}\"{size}>", base64(png), escape(about))
}

/// An SVG document as an element of the page.
fn inline(svg: &str, about: &str) -> String {
    let element = svg.find("<svg").map_or(svg, |at| &svg[at..]);
    element.trim_end().replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{}\"", escape(about)), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;
    use ndarray::{Array2, arr2};

    const EVIL: &str = "<script>alert(\"x\")</script> & 'y'";

    fn entries() -> Vec<Entry> {
        let png = |side: u32| crate::report::canvas::encode_png(&image::RgbImage::new(side, side)).unwrap();
        let mut entries: Vec<Entry> =
            sample_rows().into_iter().map(|row| Entry { row, ..Entry::default() }).collect();
        entries[0].picture_png = Some(png(3));
        entries[2].picture_png = Some(png(5));
        entries[2].error_png = Some(png(7));
        entries[2].nodes = Some(NodeMap { nodes: Array2::from_elem((16, 16), 3), stored: arr2(&[[true]]) });
        entries[4].row.scene = EVIL.into();
        entries[4].row.params = EVIL.into();
        entries
    }

    fn document() -> String {
        let conditions = Conditions {
            title: EVIL.into(),
            facts: vec![("light".into(), EVIL.into())],
            error_caption: EVIL.into(),
            notes: vec![EVIL.into()],
        };
        html(&conditions, &entries()).unwrap()
    }

    #[test]
    fn nothing_is_fetched_and_nothing_breaks_out() {
        let text = document();
        assert!(!text.contains("<script>alert"), "text is escaped everywhere");
        assert_eq!(text.matches("<script").count(), 1);
        for attribute in ["src=\"", "href=\""] {
            for (at, _) in text.match_indices(attribute) {
                let target = &text[at + attribute.len()..];
                assert!(
                    target.starts_with("data:image/png;base64,") || target.starts_with('#'),
                    "{attribute}"
                );
            }
        }
        assert!(!text.contains("@import") && !text.contains("url("));
        // The one address is the name of SVG's vocabulary.
        assert_eq!(text.matches("://").count(), text.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    }

    #[test]
    fn every_row_has_its_figures_and_every_scene_its_plots() {
        let text = document();
        for i in 1..=5 {
            assert_eq!(text.matches(&format!("id=\"row-{i}\"")).count(), 1);
            assert_eq!(text.matches(&format!("href=\"#row-{i}\"")).count(), 1);
        }
        // Two scenes with two plots each and one histogram; two pictures, an error and a map of tiles.
        assert_eq!(text.matches("<svg ").count(), 2 * 2 + 1);
        assert_eq!(text.matches("<img ").count(), 2 + 1 + 1);
        assert!(text.contains("alt=\"Picture by none\" width=\"3\" height=\"3\">"));
        assert!(text.contains("768 nodes in 256 of 256 texels: 3.00 a texel that meets anything, at most 3"));
    }

    #[test]
    fn no_rows_still_make_a_document() {
        let text = html(&Conditions::default(), &[]).unwrap();
        assert!(text.starts_with("<!DOCTYPE html>") && text.ends_with("</html>\n"));
    }
}
