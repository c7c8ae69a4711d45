//! Memory pools for the curve nodes of deep shadow maps: the sizes that earlier builds needed, and textures that no map
//! uses any more.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Texture with the rows of curve nodes of a deep shadow map. A shadow map holds a reference as long as it exists.
#[derive(Debug)]
pub struct NodePool {
    /// Texture of curve nodes.
    pub view: wgpu::TextureView,
    /// Number of rows of curve nodes for which the texture has space.
    pub rows: u32,
}

/// Sizes of the memory pool for curve nodes in the last builds of deep shadow maps, for each text of the method's
/// settings, and textures of maps that no longer exist. A size is relative to the size of the shadow map, so that it
/// can be used for other map sizes.
///
/// A pool as large as in the previous build does not overflow while a light moves a little, and the build runs once.
/// A size that is too large after an edit of the transfer function shrinks over the next builds.
#[derive(Debug, Default)]
pub struct NodePools {
    sizes: Mutex<HashMap<String, f64>>,
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
    /// Returns the size of the curve-node pool in the last builds of a deep shadow map with these settings, relative
    /// to the map's size. `None` before the first build.
    pub fn last_size(&self, settings: &str) -> Option<f64> {
        lock(&self.sizes).get(settings).copied()
    }

    /// Records the size of the curve-node pool that a deep shadow map needed, relative to the map's size. A larger
    /// earlier size shrinks slowly, so that a light that moves back and forth overflows the pool only once.
    pub fn learn_size(&self, settings: String, used: f64) {
        let mut sizes = lock(&self.sizes);
        let share = sizes.entry(settings).or_default();
        *share = used.max(0.875 * *share);
    }

    /// Returns a pool that no map uses any more, with `least` to `most` rows. If there is none, frees all pools that no
    /// map uses, so that there is memory for a new one.
    pub fn reuse(&self, least: u32, most: u32) -> Option<Arc<NodePool>> {
        let mut pools = lock(&self.pools);
        let fits = |pool: &&Arc<NodePool>| !is_used(pool) && (least..=most).contains(&pool.rows);
        let found = pools.iter().find(fits).cloned();
        if found.is_none() {
            pools.retain(is_used);
        }
        found
    }

    /// Adds a pool to those that later builds may reuse.
    pub fn keep(&self, pool: &Arc<NodePool>) {
        lock(&self.pools).push(Arc::clone(pool));
    }
}
