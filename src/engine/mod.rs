//! Interactive rendering session without a window toolkit: cache of shadow maps, request queue and render thread.
//!
//! The window, the Python module and the command line are its clients.

mod cached_session;
mod heat_map;
mod jobs;
pub(crate) mod mailbox;
pub(crate) mod messages;
mod probe_bound;
mod progressive;
mod quality;
pub(crate) mod reading;
mod reduced_copy;
mod render_thread;
mod rotation;
mod shadow_cache;
pub mod task;

pub use cached_session::{CachedSession, Prepared, ResidentPages};
pub use reading::{InitialState, OpenMode, OpenedVolume, ReadTask};
pub use render_thread::RenderThread;
pub use rotation::Rotation;
pub use shadow_cache::{Building, MapCoverage, MapSource, ReusePolicy, ShadowCache, Work};
