//! What builds of maps had to guess the first time and know from then on.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// How much of a pool each method's last builds on a volume have used, by the method's settings.
///
/// A pool that is made as large as what the build before needed is not outgrown while a light moves a little, and the
/// build is not made twice. What an edit of the transfer function has made needless is forgotten within some builds.
#[derive(Debug, Default)]
pub struct PoolSizes(Mutex<HashMap<String, u32>>);

impl PoolSizes {
    /// What the last builds with these settings used; `None` before the first.
    pub fn last(&self, settings: &str) -> Option<u32> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(settings).copied()
    }

    /// Keeps what a build has used. A larger one before it is forgotten little by little, so that a light that goes back and
    /// forth outgrows its pool once.
    pub fn learn(&self, settings: String, used: u32) {
        let mut sizes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = sizes.entry(settings).or_default();
        *kept = used.max(*kept - *kept / 8);
    }
}
