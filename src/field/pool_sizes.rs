//! What builds of maps had to guess the first time and know from then on.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// How much of a pool each method's last builds on a volume have used, by the method's settings: as a share of what grows
/// with the map, since maps that choose their own size make pools of all sizes.
///
/// A pool that is made as large as what the build before needed is not outgrown while a light moves a little, and the
/// build is not made twice. What an edit of the transfer function has made needless is forgotten within some builds.
#[derive(Debug, Default)]
pub struct PoolSizes(Mutex<HashMap<String, f64>>);

impl PoolSizes {
    /// What the last builds with these settings used; `None` before the first.
    pub fn last(&self, settings: &str) -> Option<f64> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(settings).copied()
    }

    /// Keeps what a build has used. A larger one before it is forgotten little by little, so that a light that goes back and
    /// forth outgrows its pool once.
    pub fn learn(&self, settings: String, used: f64) {
        let mut sizes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = sizes.entry(settings).or_default();
        *kept = used.max(0.875 * *kept);
    }
}
