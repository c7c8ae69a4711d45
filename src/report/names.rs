//! File names of a comparison: all names that a run may write into its folder.

use crate::measure::job::file_name_part;

/// File name of the run description: how the comparison in a folder was measured.
pub const RUN: &str = "run.json";

/// File name prefix of one scene's results; empty if the comparison has only one scene.
pub fn prefix(scene: &str, several: bool) -> String {
    if several { format!("{}_", file_name_part(scene)) } else { String::new() }
}

/// File name without extension of the picture of one table row; `slug` is the row's part of file names.
pub fn picture(slug: &str) -> String {
    format!("picture_{slug}")
}

/// File name of the difference image between the picture of a table row and the reference picture.
pub fn difference(slug: &str) -> String {
    format!("difference_{slug}.png")
}

/// File name of the array of curve nodes per texel, for a table row with a deep shadow map.
pub fn nodes(slug: &str) -> String {
    format!("nodes_{slug}.npy")
}

/// File name without extension of the reference picture by `rays`, for scenes whose table has no such row.
pub fn reference(prefix: &str) -> String {
    picture(&format!("{prefix}reference"))
}

/// File names of the figure with all pictures of a scene side by side: PNG for the screen, PDF for a paper.
pub fn grids(prefix: &str) -> [String; 2] {
    ["png", "pdf"].map(|ending| format!("{prefix}grid.{ending}"))
}

/// File names without extension of the two plots of a scene: error against time, and error against memory.
pub fn plots(part: &str) -> [String; 2] {
    let stem = if part.is_empty() { "compare".to_owned() } else { format!("compare_{part}") };
    [stem.clone(), format!("{stem}_bytes")]
}

/// File name extensions of a plot, which is written in each of these formats.
pub const PLOT_ENDINGS: [&str; 3] = ["png", "svg", "pdf"];

/// File name prefix of one scene on one graphics adapter, for comparisons with several adapters.
pub fn adapter_prefix(prefix: &str, adapter: &str) -> String {
    format!("{prefix}{}_", file_name_part(adapter))
}
