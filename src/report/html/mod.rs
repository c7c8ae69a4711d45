//! Writes the HTML report `report.html` of a comparison as one file that needs neither network nor other files.
//!
//! Plots are inline SVG, pictures are PNG data URIs, and a short script sorts the table; a content security policy
//! forbids anything else. The report shows all columns of [`Row`], new ones included.

mod rows;

use super::canvas::INK;
use super::nodes::{histogram, summary, tile_png};
use super::plot::{error_bytes, error_time};
use crate::error::Result;
use crate::files::output::write_whole;
use crate::measure::defaults::style;
use crate::measure::table::Row;
use crate::shadow::NodeMap;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use itertools::Itertools as _;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use rows::{name, table};
use std::path::Path;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");
/// Content security policy of pages that need no network: inline scripts, styles and pictures only.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// Row of the comparison table with its picture and difference image as PNG files, for the HTML report.
#[derive(Debug, Clone, Default)]
pub struct Pictured {
    /// Row of the comparison table: measurements of one shadow method with one choice of settings.
    pub row: Row,
    /// PNG file of the picture drawn with the shadow method of a comparison-table row.
    pub picture_png: Option<Vec<u8>>,
    /// PNG file of the difference between a shadow method's picture and the reference picture, in false colour with a
    /// colour bar.
    pub error_png: Option<Vec<u8>>,
    /// Number of curve nodes in each texel of the deep shadow map; `None` for other shadow methods.
    pub nodes: Option<NodeMap>,
}

/// Texts of the HTML report of a comparison: title, measurement conditions, caption of the error images, and notes.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Heading of the HTML report on a comparison of shadow methods.
    pub title: String,
    /// Names and values of the measurement conditions, such as adapter, light and number of repeats.
    pub facts: Vec<(String, String)>,
    /// Caption below the false-colour error images of the HTML report.
    pub error_caption: String,
    /// Notes on the measurement that the HTML report lists, with messages of failed measurements.
    pub notes: Vec<String>,
}

/// Returns the HTML report of a comparison as the text of one document.
///
/// # Errors
/// A picture cannot be encoded.
pub fn html(conditions: &Conditions, pictured: &[Pictured]) -> Result<String> {
    let Conditions { title, facts, error_caption, notes } = conditions;
    let rows: Vec<Row> = pictured.iter().map(|p| p.row.clone()).collect();
    let main = html! {
        h1 { (title) }
        p class="hint" { (about(&rows)) }
        (table(&rows))
        (plots(&rows))
        @if !facts.is_empty() {
            section {
                h2 { "Conditions" }
                dl { @for (name, value) in facts { dt { (name) } dd { (value) } } }
            }
        }
        section {
            h2 { "Pictures" }
            @for (i, pictured) in pictured.iter().enumerate() {
                (pictures(i + 1, pictured, error_caption)?)
            }
        }
        @if !notes.is_empty() {
            section { h2 { "Notes" } ul { @for note in notes { li { (note) } } } }
        }
    };
    let scripts = html! { script { (PreEscaped(SCRIPT)) } };
    Ok(document(title, STYLE, [main, scripts]) + "\n")
}

/// Returns an HTML document that needs nothing from a network: its title, style sheet, main part, and scripts.
pub fn document(title: &str, style: &str, [main, scripts]: [Markup; 2]) -> String {
    let document = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(style)) }
            }
            body { main { (main) } (scripts) }
        }
    };
    document.into_string()
}

/// Writes the HTML report of a comparison to a file; the file appears only when it is complete.
///
/// # Errors
/// The file cannot be written, or a picture cannot be encoded.
pub fn write_report(conditions: &Conditions, pictured: &[Pictured], path: &Path) -> Result<()> {
    let text = html(conditions, pictured)?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

/// Returns one line of text with the graphics adapters and picture sizes of the comparison table.
fn about(rows: &[Row]) -> String {
    let words = |row: &Row| [row.adapter.clone(), format!("{} x {} pixels", row.width, row.height)];
    rows.iter().flat_map(words).unique().join(" · ")
}

/// Draws the plots of the HTML report: error against time and error against memory, for each scene and graphics
/// adapter.
fn plots(rows: &[Row]) -> Markup {
    let of = |wanted| rows.iter().filter(|r| r.group() == wanted).cloned().collect::<Vec<_>>();
    let (time, memory) = ("each row of the table", "each row that stores a shadow structure");
    html! {
        section class="plots" {
            h2 { "Error against time and memory" }
            @for group in rows.iter().map(Row::group).unique() {
                @let (own, scene) = (of(group), group.0);
                (figure(error_time(&own).svg(Some(&format!("Error against time, {scene}: {time} as a point"))), ""))
                (figure(error_bytes(&own).svg(Some(&format!("Error against memory, {scene}: {memory} as a point"))), ""))
            }
            p class="hint" {
                "Errors are of transmittance, 0 to 1. Dashed: the Pareto front; nothing shown lies below and left of it."
            }
        }
    }
}

/// Returns the HTML section of one comparison-table row: picture, error image and, for deep shadow maps, figures of
/// the curve nodes.
fn pictures(number: usize, pictured: &Pictured, error_caption: &str) -> Result<Markup> {
    let Pictured { row, picture_png, error_png, nodes } = pictured;
    let name = name(row);
    Ok(html! {
        article class="row" id={ "row-" (number) } {
            h3 { (name) @if !row.scene.is_empty() { " · " (row.scene) } }
            div {
                @if let Some(png) = picture_png { (figure(image(png, &format!("Picture by {name}")), "picture")) }
                @if let Some(png) = error_png { (figure(image(png, &format!("Error of {name}")), error_caption)) }
                @if let Some(nodes) = nodes {
                    (figure(
                        image(&tile_png(nodes)?, &format!("Nodes per tile of {name}")),
                        "nodes per tile, as Hadwiger et al. 2006, Figure 5; grey: skipped tiles",
                    ))
                    (figure(
                        histogram(nodes, style(&row.method).map_or(INK, |s| s.color)).svg(Some(&format!("Histogram of nodes per texel of {name}"))),
                        &summary(nodes),
                    ))
                }
                @if picture_png.is_none() && error_png.is_none() && nodes.is_none() { p class="hint" { "no picture" } }
            }
            @for (what, text) in [("Note", &row.note), ("Left out", &row.left_out)] {
                @if !text.is_empty() { p class="hint" { (what) ": " (text) } }
            }
        }
    })
}

fn figure(content: Markup, caption: &str) -> Markup {
    html! { figure { (content) @if !caption.is_empty() { figcaption { (caption) } } } }
}

/// Returns the HTML `img` element that shows a PNG file in its own size; `about` is the alternative text.
fn image(png: &[u8], about: &str) -> Markup {
    // Width and height avoid layout shifts; the PNG header has them at bytes 16 and 20.
    let side = |at: usize| png.get(at..at + 4).map(|b| b.iter().fold(0_u32, |n, &b| n << 8 | u32::from(b)));
    html! {
        img src={ "data:image/png;base64," (BASE64_STANDARD.encode(png)) } alt=(about) width=[side(16)] height=[side(20)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;
    use ndarray::{Array2, arr2};

    const EVIL: &str = "<script>alert(\"x\")</script> & 'y'";

    fn pictured() -> Vec<Pictured> {
        let png = |side: u32| crate::report::canvas::encode_png(&image::RgbImage::new(side, side)).unwrap();
        let mut pictured: Vec<Pictured> =
            sample_rows().into_iter().map(|row| Pictured { row, ..Pictured::default() }).collect();
        pictured[0].picture_png = Some(png(3));
        pictured[2].picture_png = Some(png(5));
        pictured[2].error_png = Some(png(7));
        pictured[2].nodes = Some(NodeMap { nodes: Array2::from_elem((16, 16), 3), stored: arr2(&[[true]]) });
        pictured[4].row.scene = EVIL.into();
        pictured[4].row.params = EVIL.into();
        pictured
    }

    fn document() -> String {
        let conditions = Conditions {
            title: EVIL.into(),
            facts: vec![("light".into(), EVIL.into())],
            error_caption: EVIL.into(),
            notes: vec![EVIL.into()],
        };
        html(&conditions, &pictured()).unwrap()
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
        // The only address is the XML namespace of SVG.
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
    fn adapters_have_plots_of_their_own() {
        let mut pictured = pictured();
        pictured[4].row.scene = pictured[0].row.scene.clone();
        let plots = |pictured: &[Pictured]| {
            html(&Conditions::default(), pictured).unwrap().matches("Error against time, ").count()
        };
        assert_eq!(plots(&pictured), 1);
        pictured[3].row.adapter = "another".into();
        assert_eq!(plots(&pictured), 2);
    }

    #[test]
    fn no_rows_still_make_a_document() {
        let text = html(&Conditions::default(), &[]).unwrap();
        assert!(text.starts_with("<!DOCTYPE html>") && text.ends_with("</html>\n"));
    }
}
