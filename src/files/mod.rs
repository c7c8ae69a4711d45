//! Reading and writing of files, shared by all modules: text, progress of long readings, outputs that appear whole or not at
//! all, pictures and animations, checksums, sRGB, memory budgets, binary headers, and the common parts of VTK's XML files.

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
