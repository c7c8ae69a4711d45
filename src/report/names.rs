//! The names of a table's files: all that a run may write into its folder, known before it is written.

use crate::measure::job::file_name_part;

/// Description of the run.
pub const RUN: &str = "run.json";

/// File name prefix of a scene; empty unless there are several scenes.
pub fn prefix(scene: &str, several: bool) -> String {
    if several { format!("{}_", file_name_part(scene)) } else { String::new() }
}

/// A picture by a row, or by `rays` as the reference, without its ending.
pub fn picture(slug: &str) -> String {
    format!("picture_{slug}")
}

/// Picture of the differences between a row's picture and the reference.
pub fn difference(slug: &str) -> String {
    format!("difference_{slug}.png")
}

/// The nodes of a row's texels.
pub fn nodes(slug: &str) -> String {
    format!("nodes_{slug}.npy")
}

/// The picture by `rays` that differences are from where no row is one, without its ending.
pub fn reference(prefix: &str) -> String {
    picture(&format!("{prefix}reference"))
}

/// Figures of all pictures of a scene side by side: for the screen and for a paper.
pub fn grids(prefix: &str) -> [String; 2] {
    ["png", "pdf"].map(|ending| format!("{prefix}grid.{ending}"))
}

/// The plots of a scene, without their endings: error against time, and against bytes.
pub fn plots(part: &str) -> [String; 2] {
    let stem = if part.is_empty() { "compare".to_owned() } else { format!("compare_{part}") };
    [stem.clone(), format!("{stem}_bytes")]
}

/// Endings of a plot's files.
pub const PLOT_ENDINGS: [&str; 3] = ["png", "svg", "pdf"];

/// File name prefix of a scene and adapter, where there are several adapters.
pub fn adapter_prefix(prefix: &str, adapter: &str) -> String {
    format!("{prefix}{}_", file_name_part(adapter))
}
