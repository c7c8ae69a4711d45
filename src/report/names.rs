//! File names of all results that a comparison may write into its folder.

use crate::measure::job::file_name_part;

/// File name of the run description: how the comparison in a folder was measured.
pub const RUN: &str = "run.json";

/// Prefix of the names of all result files of one scene; empty if the comparison has only one scene.
pub fn prefix(scene: &str, several: bool) -> String {
    if several { format!("{}_", file_name_part(scene)) } else { String::new() }
}

/// File name without extension of a shadow method's picture; `slug` identifies the row of the comparison table.
pub fn picture(slug: &str) -> String {
    format!("picture_{slug}")
}

/// File name of the difference image between a shadow method's picture and the reference picture.
pub fn difference(slug: &str) -> String {
    format!("difference_{slug}.png")
}

/// File name of the NumPy array with the number of curve nodes in each texel of a deep shadow map.
pub fn nodes(slug: &str) -> String {
    format!("nodes_{slug}.npy")
}

/// File name without extension of the reference picture (one shadow ray per sample), if no table row has this method.
pub fn reference(prefix: &str) -> String {
    picture(&format!("{prefix}reference"))
}

/// File names of the figure with all pictures of a scene side by side: PNG for the screen, PDF for a paper.
pub fn grids(prefix: &str) -> [String; 2] {
    ["png", "pdf"].map(|ending| format!("{prefix}grid.{ending}"))
}

/// File name of the page that draws a scene in a browser.
pub fn page(prefix: &str) -> String {
    format!("{prefix}page.html")
}

/// File names without extension of the two plots of a scene: error against time, and error against memory.
pub fn plots(part: &str) -> [String; 2] {
    let stem = if part.is_empty() { "compare".to_owned() } else { format!("compare_{part}") };
    [stem.clone(), format!("{stem}_bytes")]
}

/// File name extensions of the formats in which every plot is written.
pub const PLOT_ENDINGS: [&str; 3] = ["png", "svg", "pdf"];

/// Prefix of the names of all result files of one scene on one graphics adapter, for comparisons with several
/// adapters.
pub fn adapter_prefix(prefix: &str, adapter: &str) -> String {
    format!("{prefix}{}_", file_name_part(adapter))
}
