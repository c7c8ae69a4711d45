//! Volumetric shadows for CT volumes, each method with its error against an exact answer.
//!
//! ```text
//!  file ──> Volume ──> Bricks (min,max) ─┐                        ┌─> picture
//!  preset ─> TransferFunction ─> tables ─┼─> Plan ─> ShadowMap ─> RayCast ─┤
//!  strands ─> voxelise ─> Volume         │    (what this scene    └─> error + time ─> tables, plots
//!  camera, light ────────────────────────┘     needs)       ^
//!                                      exact (f64, CPU) ────┘ only where errors are asked for
//! ```
//!
//! Lengths are world millimetres, extinction is 1/mm, optical depth its line integral, transmittance
//! `exp(-optical depth)`.

#[cfg(feature = "gui")]
pub mod app;
pub mod cli;
pub mod error;
pub mod exact;
pub mod files;
pub mod gpu;
pub mod measure;
pub mod open;
pub mod render;
pub mod report;
pub mod scene;
pub mod shadow;
pub mod strands;
pub mod transfer;
pub mod volume;

pub use error::{Error, Result};
