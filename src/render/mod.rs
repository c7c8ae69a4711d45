//! Eye rays: what a scene needs, casting them, showing pictures, asking for light at points, and what stays between
//! pictures.

mod display;
mod eye_tiles;
mod framing;
mod lights;
mod mesh;
mod pace;
mod picture;
mod plan;
mod query;
mod renderer;
mod session;
mod shader;

pub use display::{DisplayTexture, Drawn, Screen};
pub use framing::VisibleBounds;
pub use lights::LightMaps;
pub use pace::Pace;
pub use picture::Picture;
pub use plan::{Omission, Plan, needs_shadows};
pub use renderer::Renderer;
pub use session::Session;

pub use crate::field::{DeviceTransfer, DisabledOptimizations, LoadedVolume, Optimization, View};

use crate::gpu::ShaderVariant;
use crate::shadow::Lookup;

/// Every pipeline of this room with a lookup, or with none, for tests of shaders: the ray caster by what its plan
/// decides, queries, what fills their background, and what encodes pictures for the screen.
pub fn shaders(lookup: Option<&Lookup>) -> Vec<ShaderVariant> {
    let mut list = plan::raycast_shaders(lookup);
    list.extend(lookup.map(query::shader));
    if lookup.is_none() {
        list.extend([display::shader(), picture::background_shader()]);
    }
    list
}
