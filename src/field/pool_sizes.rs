//! What builds of maps had to guess the first time and know from then on.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// How much of a pool each method's last build on a volume has used, by the method's settings.
///
/// A pool that is made as large as what the build before needed is not outgrown while a light moves a little, and the
/// build is not made twice. What an edit of the transfer function has made needless is forgotten with the next build.
#[derive(Debug, Default)]
pub struct PoolSizes(Mutex<HashMap<String, u32>>);

impl PoolSizes {
    /// What the last build with these settings used; `None` before the first.
    pub fn last(&self, settings: &str) -> Option<u32> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(settings).copied()
    }

    /// Keeps what a build has used.
    pub fn learn(&self, settings: String, used: u32) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(settings, used);
    }
}
