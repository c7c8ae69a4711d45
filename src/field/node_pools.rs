//! Memory pools for the curve nodes of deep shadow maps: the sizes that earlier builds needed, and textures that no map
//! uses any more.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Texture with curve nodes of a deep shadow map, four in each texel (a quad). A shadow map holds a reference as long
/// as it exists, and its build holds one to another pool.
#[derive(Debug)]
pub struct NodePool {
    /// Texture of curve nodes.
    pub view: wgpu::TextureView,
    /// Number of quads for which the texture has space.
    pub quads: u32,
    /// Binary logarithm of the width of the texture, in texels.
    pub width_shift: u32,
}

/// Sizes of the memory pools for curve nodes, relative to the number of texels of the shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodePoolSizes {
    /// Number of rows during the build, beyond the first row of each texel.
    pub overflow_rows: f64,
    /// Number of quads of the finished map.
    pub quads: f64,
}

impl NodePoolSizes {
    /// Returns the sizes multiplied by a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { overflow_rows: factor * self.overflow_rows, quads: factor * self.quads }
    }
}

/// Sizes of the memory pools for curve nodes in the last builds of deep shadow maps, for each text of the method's
/// settings, and textures of maps that no longer exist. Sizes are relative to the size of the shadow map, so that they
/// can be used for other map sizes.
///
/// A pool as large as in the previous build does not overflow while a light moves a little, and the build runs once.
/// A size that is too large after an edit of the transfer function shrinks over the next builds.
#[derive(Debug, Default)]
pub struct NodePools {
    sizes: Mutex<HashMap<String, NodePoolSizes>>,
    pools: Mutex<Vec<Arc<NodePool>>>,
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a map uses a pool; the list of pools holds one more reference.
fn is_used(pool: &Arc<NodePool>) -> bool {
    Arc::strong_count(pool) > 1
}

impl NodePools {
    /// Returns the sizes of the curve-node pools in the last builds of a deep shadow map with these settings. `None`
    /// before the first build.
    pub fn last_sizes(&self, settings: &str) -> Option<NodePoolSizes> {
        lock(&self.sizes).get(settings).copied()
    }

    /// Records the sizes of the curve-node pools that a deep shadow map needed. A larger earlier size shrinks slowly, so
    /// that a light that moves back and forth overflows a pool only once.
    pub fn learn_sizes(&self, settings: String, used: NodePoolSizes) {
        let mut sizes = lock(&self.sizes);
        let last = sizes.entry(settings).or_default();
        last.overflow_rows = used.overflow_rows.max(0.875 * last.overflow_rows);
        last.quads = used.quads.max(0.875 * last.quads);
    }

    /// Returns a pool that no map uses any more, with `least` to `most` quads in a texture of the given width. If there
    /// is none, frees all pools that no map uses, so that there is memory for a new one.
    pub fn reuse(&self, [least, most]: [u32; 2], width_shift: u32) -> Option<Arc<NodePool>> {
        let mut pools = lock(&self.pools);
        let fits = |pool: &&Arc<NodePool>| {
            !is_used(pool) && pool.width_shift == width_shift && (least..=most).contains(&pool.quads)
        };
        let found = pools.iter().find(fits).cloned();
        if found.is_none() {
            pools.retain(is_used);
        }
        found
    }

    /// Returns the number of pools that no map uses.
    pub fn unused(&self) -> usize {
        lock(&self.pools).iter().filter(|pool| !is_used(pool)).count()
    }

    /// Adds a pool to those that later builds may reuse.
    pub fn keep(&self, pool: &Arc<NodePool>) {
        lock(&self.pools).push(Arc::clone(pool));
    }
}
