//! What is painted with shaders of our own, as callbacks of egui's renderer.

pub mod shown;
pub mod widgets;
