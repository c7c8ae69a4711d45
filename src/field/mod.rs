//! Scalar field on the graphics device: the volume, its transfer function, the projection of shadow maps, and the
//! march along light rays. This module provides bind group 0 of every pipeline, and the projection (binding 0 of bind
//! group 1).

mod active_bricks;
mod blocks;
mod brick_distances;
mod brick_runs;
mod build_recorder;
mod constants;
mod context;
mod deferred;
mod device_directions;
mod device_transfer;
mod device_volume;
mod field_bindings;
mod gradient_uniform;
mod light_space;
mod loaded;
mod march;
mod merged_function;
mod node_pools;
mod optimizations;
mod page_pool;
mod page_stream;
mod pages;
mod shader;
mod shared_buffers;
mod strand_lines;
mod texel_packing;
mod tile_march;
mod tile_pace;
mod transfer_textures;
mod view;
mod work_share;

pub use active_bricks::{ActiveBricks, extinction_intervals};
pub use brick_runs::{BrickHull, BrickRun};
pub use build_recorder::{BuildLimit, BuildPass, BuildRecorder, RecordedBuild};
pub use constants::{FAR, LINE_THREADS, NO_TILE, TILE, TILE_TEXELS};
pub use context::{BuildContext, BuildPasses, TileList};
pub use deferred::{DeferredPasses, DeferredResult};
pub use device_directions::DeviceDirections;
pub use device_transfer::{DeviceTransfer, MarchTable};
pub use device_volume::{DeviceVolume, PageUsage};
pub use light_space::{LightSpace, MapShape, Prism, Projection, Rounding, TileSet};
pub use loaded::{LoadedVolume, grid_from_world};
pub use march::{GAUSS, MOST_ROUNDINGS, March, SHORT_PIECE, UNEVEN_DEPTH};
pub use node_pools::{NodePool, NodePoolSizes, NodePools};
pub use optimizations::{DisabledOptimizations, Optimization};
pub use page_stream::{PageReach, PageStream, PassRays, RESIDENT_VOXELS, StreamUsage};
pub use pages::holds_volume;
pub use shader::{
    DEPTH_SINK, RAY_STATE_BINDING, RAY_STATES, field_shader, line_of_workgroups, marches_cells,
    marches_samples, shape_of,
};
pub use shared_buffers::SharedBuffers;
pub use tile_march::{TileMarch, ray_states};
pub use tile_pace::TilePace;
pub use view::View;
pub use work_share::WorkShare;
