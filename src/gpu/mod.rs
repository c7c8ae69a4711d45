//! Graphics device (wgpu): limits, buffers, textures, bind groups, compute pipelines, timestamps.

mod bindings;
mod buffers;
mod clock_rate;
mod contents;
mod counters;
mod device;
mod filler;
mod kernels;
mod layouts;
mod pipeline_cache;
mod shaders;
mod sharing;
mod textures;
mod timing;
pub mod tuning;

pub use bindings::{Group, Resource, Slot};
pub use buffers::{StorageBuffer, read_back, uniform_buffer};
pub use clock_rate::ClockRate;
pub use counters::{DeviceCounters, MAX_BLOCKS, WORK_KINDS, WORK_WORDS, Work};
pub use device::{DeviceLoss, Gpu, Traffic, texture_side};
pub use filler::Filler;
pub use kernels::{DevicePass, Kernels};
pub use layouts::StructLayout;
#[cfg(test)]
pub(crate) use layouts::{assert_layout, wgsl_layout};
pub use pipeline_cache::PipelineStore;
pub use shaders::{Constant, ShaderVariant, compose, shader_paths, write_wgsl};
pub use sharing::{Sharing, Uncaptured};
pub use textures::{
    VolumeTexture, clamp_sampler, copy_rows, solid_texture, store_texture, table_texture, texture,
    write_texels,
};
pub use timing::{Clock, PassTimer, Read, RecordedPass, Span, Words};
pub use tuning::{Tuning, WorkOrder};
