//! The window: a client of the library that holds no rendering logic.
//!
//! ```text
//!  hands ──> Model (document: volume, transfer function, method, scene) ──> Wanted ──> RenderThread ──> Engine
//!              ^                                                                           │
//!              └── panels: what is seen  <── App <── Event (frame, probe, export) <────────┘
//! ```
//! The window's thread draws widgets and the last finished picture, and never waits: volumes are read, tables and maps
//! made and pictures drawn elsewhere. The device is shared, so a picture is shown from the memory it was drawn into.
//!
//! Imports go one way: `window` and `script` know `contents`, that knows `panels` and `model`; panels know the model, the
//! model knows `render_thread`, and both ends of that thread know its messages.

pub mod camera;
mod clip;
mod contents;
mod cube;
pub mod curve;
mod document;
mod model;
mod paint;
mod panels;
mod resume;
mod script;
mod settings;
mod split;
mod surface;
pub mod theme;
mod window;

pub use crate::engine::reading::With;
pub use contents::App;
pub use document::Document;
pub use model::{Message, Model};
pub use panels::prompt::Purpose;
pub use resume::Resume;
pub use script::Script;
pub use settings::Settings;
pub use window::{Start, run};
