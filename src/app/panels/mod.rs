//! Panels of the viewer window. Each panel shows one part of the viewer's shared state and edits it.

mod browse;
mod clip;
pub mod comparison;
mod cube;
pub mod difference;
pub mod editor;
pub mod gradient;
pub mod help;
pub mod keys;
mod labels;
mod light;
mod overlays;
mod pointer;
pub mod presets;
pub mod probe;
pub mod prompt;
mod shadows;
pub mod side;
pub mod slices;
pub mod strands;
pub mod times;
pub mod top_bar;
pub mod view;
mod widgets;
pub mod windows;
