//! Interactive viewer window for volumes with shadows. It uses the library for all rendering and contains no
//! rendering code.
//!
//! ```text
//!  input ──> Model (Document: volume, transfer function, method, scene) ──> FrameRequest ──> RenderThread
//!              ^                                                                                   │
//!              └── panels  <── App <── Event (frame, probe, export) <──────────────────────────────┘
//! ```
//! The window's thread draws widgets and the last finished picture, and never waits: other threads read volumes,
//! compute lookup tables and shadow maps, and render pictures. All share one graphics device, so a picture is shown
//! without a copy.
//!
//! Imports go one way: `window` imports `contents`, that imports `panels` and `model`, and panels import the model.

pub mod camera;
mod clip;
mod contents;
mod cube;
pub mod curve;
mod document;
mod gradient;
mod model;
mod panels;
mod picture_shape;
mod resume;
mod settings;
mod split;
mod surface;
pub mod theme;
mod window;

pub use crate::engine::reading::OpenMode;
pub use contents::App;
pub use document::Document;
pub use model::{Message, Model};
pub use panels::prompt::Purpose;
pub use resume::Resume;
pub use settings::Settings;
pub use window::{FrameHook, Start, run};
