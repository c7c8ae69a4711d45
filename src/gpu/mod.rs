//! The device and what every stage needs of it: limits, buffers, shaders, timestamps.

mod buffers;
mod device;
mod pipeline_cache;
mod shaders;
mod timing;

pub use buffers::{StorageBuffer, read_back, steady_side, table_texture, uniform_buffer};
pub use device::{DeviceLoss, Gpu};
pub use pipeline_cache::PipelineStore;
pub use shaders::{ShaderVariant, compose, sources};
pub use timing::{Clock, PassTimer, Span};
