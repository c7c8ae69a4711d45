//! Interactive session without a window toolkit: shadow cache, requests and the render thread.
//!
//! The window, the Python module and the command line are its clients.

mod device;
#[allow(clippy::module_inception, reason = "renamed with the unification of the caches")]
mod engine;
mod heat_map;
mod jobs;
pub mod mailbox;
pub mod messages;
pub mod method_choice;
mod probe_bound;
mod quality;
pub mod reading;
mod render_thread;
mod sequence;
mod shadow_cache;

pub use render_thread::RenderThread;
pub use sequence::{DrawnPicture, Sequence, Turned, Turning};
pub use shadow_cache::{Change, INVALIDATES, MapCoverage, ReusePolicy, ShadowCache, Stage, Work};
