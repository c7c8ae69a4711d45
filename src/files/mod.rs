//! What every room reads and writes files with: text with a one-line error, readings that can be watched and ended,
//! files that appear whole or not at all, pictures alone and in a row, sums of what was read, sRGB, and what VTK's XML files share.

pub mod animation;
pub mod color;
pub mod hash;
pub mod input;
pub mod loading;
pub mod output;
pub mod picture;
pub mod room;
pub mod vtk_xml;
pub mod xml;
