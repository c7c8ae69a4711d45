//! The scalar field on a device: volume, transfer function, bricks, light space, the march along light rays and the
//! tiles that it fills. Group 0 of every pipeline is made here, and binding 0 of group 1, the light space.

mod active_bricks;
mod constants;
mod context;
mod device_directions;
mod device_transfer;
mod device_volume;
mod fold;
mod light_space;
mod loaded;
mod omittable;
mod pool_sizes;
mod seen_function;
mod shader;
mod strand_lines;
mod tile_march;
mod tile_pace;
mod view;

pub use active_bricks::{ActiveBricks, extinction_intervals};
pub use constants::{FAR, LINE_THREADS, NO_TILE, TILE, TILE_TEXELS};
pub use context::BuildContext;
pub use device_directions::DeviceDirections;
pub use device_transfer::{DeviceTransfer, MarchTable};
pub use device_volume::{DeviceVolume, TexelFormat};
pub use fold::Fold;
pub use light_space::{LightSpace, MapShape, Projection, Rounding};
pub use loaded::{LoadedVolume, grid_from_world};
pub use omittable::{Forced, Omittable};
pub use pool_sizes::PoolSizes;
pub use shader::{
    DEPTH_SINK, GAUSS, MOST_ROUNDINGS, March, SHORT_PIECE, UNEVEN_DEPTH, field_shader, line_of_workgroups,
    marches_cells, shape_of,
};
pub use tile_march::TileMarch;
pub use tile_pace::TilePace;
pub use view::View;
