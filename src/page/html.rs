//! Writes the HTML of a page: canvas, table of methods with their errors, still pictures, script and data.

use crate::error::Result;
use crate::files::picture::picture_png;
use crate::measure::comparison::Compared;
use crate::report::html::document;
use crate::report::number::significant;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use maud::{Markup, PreEscaped, html};

const STYLE: &str = include_str!("page.css");
/// Scripts in the order in which they need each other.
const SCRIPTS: [&str; 3] = [include_str!("transfer.js"), include_str!("editor.js"), include_str!("page.js")];

/// Texts of a page.
#[derive(Debug, Clone, Default)]
pub struct PageTexts {
    /// Heading of the page.
    pub title: String,
    /// Names and values of what the page shows, such as volume, transfer function and lights.
    pub facts: Vec<(String, String)>,
}

/// Returns the page as the text of one document. `rows` are the methods in the order of the data, with their errors and
/// pictures.
///
/// # Errors
/// A picture cannot be encoded.
pub fn html(texts: &PageTexts, rows: &[Compared], data: &[u8]) -> Result<String> {
    let main = html! {
        h1 { (texts.title) }
        p id="status" role="status" { "Starting…" }
        div class="view" {
            canvas id="canvas" tabindex="0" aria-label="Picture of the scene" {}
            (controls())
        }
        (editor())
        (table(rows))
        (stills(rows)?)
        section {
            h2 { "Scene" }
            dl { @for (name, value) in &texts.facts { dt { (name) } dd { (value) } } }
        }
    };
    let scripts = html! {
        script id="data" type="application/gzip;base64" { (PreEscaped(BASE64_STANDARD.encode(data))) }
        @for script in SCRIPTS { script { (PreEscaped(script)) } }
    };
    Ok(document(&texts.title, STYLE, [main, scripts]))
}

fn controls() -> Markup {
    let keys = [
        ("drag or arrows", "turn the camera"),
        ("wheel", "distance"),
        ("Shift + drag", "move the first directional light"),
        ("+ -", "extinction of the transfer function"),
        ("1 to 9", "method"),
        ("D", "difference from the reference"),
        ("R", "initial view, light and transfer function"),
    ];
    html! {
        ul class="keys" { @for (key, action) in keys { li { kbd { (key) } " " (action) } } }
    }
}

/// Returns the editor of the transfer function. It stays hidden if the page cannot edit the function.
fn editor() -> Markup {
    html! {
        section id="function" hidden {
            h2 { "Transfer function" }
            svg id="curve" role="group" aria-label="Points of the transfer function" {}
            p {
                span id="axes" {} ". "
                "Drag a point to move it, double-click to add one, right-click or press " kbd { "Delete" } " to remove one. "
                button id="save" type="button" { "Save as file" }
            }
        }
    }
}

/// Returns the table of methods: a button for each, and its errors.
fn table(rows: &[Compared]) -> Markup {
    let number = |value: Option<f64>| value.map_or_else(|| "–".into(), |value| significant(value, 3));
    let kib = |bytes: Option<u64>| {
        bytes.map_or_else(|| "–".into(), |bytes| format!("{:.0}", bytes as f64 / 1024.0))
    };
    html! {
        table {
            caption {
                "Errors of transmittance at visible points against the exact answer in float64, and errors of the shadows in \
                 the picture against a picture by shadow rays, for the initial view and light"
            }
            thead {
                tr {
                    th { "Key" } th { "Method" } th { "rms error" } th { "largest error" } th { "shadow rmse" }
                    th { "FLIP" } th { "Map, KiB" } th { "Frame here, ms" }
                }
            }
            tbody id="methods" {
                @for (i, Compared { row, method, .. }) in rows.iter().enumerate() {
                    tr {
                        td { @if i < 9 { kbd { (i + 1) } } }
                        th { button type="button" { (method) } }
                        td { (number(row.point_err_rms)) }
                        td { (number(row.point_err_max)) }
                        td { (number(row.shadow_rmse)) }
                        td { (number(row.flip)) }
                        td { (kib(row.bytes)) }
                        td class="ms" {}
                    }
                }
            }
        }
    }
}

/// Returns the pictures of all methods, which the page shows where it cannot draw.
fn stills(rows: &[Compared]) -> Result<Markup> {
    let mut pictures = Vec::new();
    for Compared { method, picture, .. } in rows {
        if let Some(picture) = picture {
            pictures.push((method, BASE64_STANDARD.encode(picture_png(picture)?)));
        }
    }
    Ok(html! {
        section id="stills" {
            h2 { "Pictures" }
            @for (method, png) in pictures {
                figure { img src=(format!("data:image/png;base64,{png}")) alt=(method); figcaption { (method) } }
            }
        }
    })
}
