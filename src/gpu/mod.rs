//! The device and what every stage needs of it: limits, buffers, bind groups, pipelines, timestamps.

mod bindings;
mod buffers;
mod device;
mod kernels;
#[cfg(test)]
mod layout;
mod pipeline_cache;
pub mod quirks;
mod shaders;
mod sharing;
mod timing;
mod volume_texture;
mod watch;

pub use bindings::{Group, Slot};
pub use buffers::{
    StorageBuffer, clamp_sampler, copy_rows, read_back, store_texture, table_texture, uniform_buffer,
};
pub use device::{DeviceLoss, Gpu, texture_side};
pub use kernels::Kernels;
#[cfg(test)]
pub(crate) use layout::{assert_layout, wgsl_layout};
pub use pipeline_cache::PipelineStore;
pub use shaders::{Constant, ShaderVariant, compose, shader_paths};
pub use sharing::{Sharing, Uncaptured};
pub use timing::{Clock, PassTimer, Span};
pub use volume_texture::{VolumeTexture, solid_texture};
pub use watch::{WORK_KINDS, WORK_WORDS, Watch, Work};
