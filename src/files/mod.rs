//! File input and output that all modules share: text, images and animations, checksums, sRGB, memory budgets, binary
//! headers, VTK XML, progress of long readings, and files that appear only when they are complete.

pub mod animation;
pub mod binary;
pub mod color;
pub mod hash;
pub mod input;
pub mod loading;
pub mod memory_budget;
pub mod output;
pub mod picture;
pub mod vtk_xml;
pub mod xml;
