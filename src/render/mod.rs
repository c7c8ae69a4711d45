//! Volume rendering by eye rays: the plan of a picture, ray casting, display on the screen, queries for
//! transmittance, and the renderer that keeps data between pictures.

mod brick_projection;
mod caster;
mod device_tiles;
mod display;
mod eye_tiles;
mod frame_uniform;
mod framing;
mod lights;
mod mesh;
mod output;
mod pace;
mod pass;
mod picture;
mod plan;
mod portable;
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
pub use portable::{PortablePass, PortablePicture, PortableProjection};
pub use renderer::Renderer;
pub use session::Session;

pub use crate::field::{DeviceTransfer, DisabledOptimizations, LoadedVolume, Optimization, View};

use crate::gpu::ShaderVariant;
use crate::shadow::{Lookup, occlusion_lookup};

/// Returns all shaders of the render module for one kind of shadow query (or none), for tests. They are the ray
/// casters of all plans. With a query, the shader for single points is added; without one, the shaders for background
/// and screen.
pub fn shaders(lookup: Option<&Lookup>) -> Vec<ShaderVariant> {
    let mut list = plan::raycast_shaders(lookup);
    list.extend(lookup.map(query::shader));
    if lookup.is_none() {
        list.extend(plan::occlusion_shaders());
        list.extend([
            display::shader(),
            shader::background_shader(false),
            shader::background_shader(true),
            device_tiles::project_shader(),
            query::shader(&occlusion_lookup()),
        ]);
    }
    list
}
