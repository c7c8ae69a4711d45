//! Tiles of a map apart into submissions.

use crate::render::Renderer;

/// Some neighbours in a list of tiles, built by one submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TilePart {
    first: u32,
    count: u32,
}

/// Bytes of an entry in a list of tiles.
const ENTRY_BYTES: u64 = 4;

impl TilePart {
    /// These tiles of the list: shaders see them as the whole of it.
    pub fn binding<'a>(&self, list: &'a wgpu::Buffer) -> wgpu::BindingResource<'a> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: list,
            offset: u64::from(self.first) * ENTRY_BYTES,
            size: std::num::NonZeroU64::new(u64::from(self.count) * ENTRY_BYTES),
        })
    }

    /// A workgroup a tile, in two dimensions, since one holds no more than 65,535.
    pub fn workgroups(&self) -> [u32; 2] {
        let across = self.count.clamp(1, 256);
        [across, self.count.div_ceil(across)]
    }
}

/// `tiles` apart as the renderer wants it: at least one part, which is empty where there are no tiles.
pub(super) fn tile_parts(renderer: &Renderer, tiles: u32) -> impl Iterator<Item = TilePart> {
    // Offsets are multiples of 64 tiles, 256 bytes: the coarsest alignment that adapters ask for.
    let most = renderer.tiles_at_once();
    (0..tiles.max(1))
        .step_by(most as usize)
        .map(move |first| TilePart { first, count: most.min(tiles - first) })
}
