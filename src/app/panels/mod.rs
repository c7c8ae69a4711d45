//! Panels: each shows its part of the window from the model and edits it.

mod browse;
mod clip;
pub mod comparison;
mod cube;
pub mod difference;
pub mod editor;
pub mod escape;
pub mod flicker;
mod hands;
pub mod help;
pub mod keys;
mod labels;
mod light;
mod light_list;
mod overlays;
mod parts;
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
pub mod windows;
