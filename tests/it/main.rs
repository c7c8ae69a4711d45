//! Tests without a graphics device: file formats, float64 reference, strands, shader texts, commands, the repository.

mod book;
mod bricks;
#[path = "../common/browser.rs"]
mod browser;
mod cli;
mod commands;
#[path = "../common/mod.rs"]
mod common;
mod datasets;
mod exact;
mod formats;
mod layering;
mod light_space;
mod loading;
mod methods;
mod nifti;
mod packaging;
mod phantom;
#[path = "../common/program.rs"]
mod program;
mod raw;
mod readme;
mod registers;
mod report_browser;
mod results;
mod shaders;
mod strands;
mod style;
mod tint;
mod transfer_tables;
