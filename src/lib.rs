//! Volumetric shadows for CT volumes: renders volumes with several shadow methods and measures each method's error
//! against an exact answer.
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
//!
//! Example: renders a picture with shadows and prints the approximate and the exact transmittance at one point.
//! ```no_run
//! use std::{path::Path, sync::Arc};
//! use umbravox::exact::ExactField;
//! use umbravox::files::picture::write_picture;
//! use umbravox::open::{self, VolumeSpec, presets};
//! use umbravox::render::{DisabledOptimizations, Session};
//! use umbravox::scene::Scene;
//! use umbravox::shadow;
//!
//! # fn main() -> umbravox::Result<()> {
//! let volume = Arc::new(open::load(&VolumeSpec::new("phantom:thorax:96"))?);
//! let tf = presets::resolve("ct", &volume)?.tf;
//! let scene = Scene::framing(&volume);
//! let session = Session::open(None, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)?;
//!
//! let method = shadow::parse("dsm:epsilon=0.01,map=256")?;
//! let map = session.shadow(method.as_ref(), scene.light())?;
//! write_picture(Path::new("thorax.png"), &session.render(&map, &scene)?.pixels)?;
//!
//! let point = scene.camera.target;
//! let exact = ExactField::new(&volume, &tf).transmittance_to_light(point, &scene.light());
//! println!("{} found, {exact} exact", session.query(&map, &[point])?[0]);
//! # Ok(())
//! # }
//! ```
//! `examples/shadow_error.rs` is a complete program. The repository's `docs/` describe the computations, and how each
//! method deviates from its paper.

#![warn(missing_docs)]

#[cfg(feature = "gui")]
pub mod app;
pub mod benchmark;
#[expect(missing_docs, reason = "its comments are the help of the flags")]
#[allow(rustdoc::broken_intra_doc_links, reason = "square brackets of that help")]
pub mod cli;
pub mod engine;
pub mod error;
pub mod exact;
pub mod field;
pub mod files;
pub mod formats;
pub mod gpu;
pub mod measure;
pub mod mesh;
pub mod open;
pub mod page;
pub mod phantom;
mod random;
pub mod render;
pub mod replication;
pub mod report;
pub mod scene;
pub mod shadow;
pub mod strands;
pub mod transfer;
pub mod volume;

#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
// tests/common refers to this crate as `umbravox`, as integration tests do.
#[cfg(test)]
extern crate self as umbravox;

pub use error::{Error, Result};
