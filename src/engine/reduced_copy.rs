//! Reduced copy of a volume whose pages exceed the device memory, for pictures while something moves.

use super::cached_session::CachedSession;
use super::mailbox::{EventSender, Mailbox};
use super::messages::Event;
use super::shadow_cache::{ReusePolicy, ShadowCache};
use super::task::{Task, Wake};
use crate::error::{Error, Result};
use crate::field::holds_volume;
use crate::files::loading::Loading;
use crate::files::memory_budget::MemoryBudget;
use crate::render::DisabledOptimizations;
use crate::volume::Volume;
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

/// Number of parts of a limit on device memory, of which the reduced copy of a volume may take one.
const PARTS_OF_LIMIT: u64 = 8;
/// Largest size of a reduced copy without a limit on device memory, bytes.
const MOST_BYTES: u64 = 256 << 20;
/// Size of a texel of the copy, bytes: volumes with many values have floats.
const TEXEL_BYTES: u64 = 4;
/// Time after which it is asked again whether the copy is finished.
const WAIT: Duration = Duration::from_millis(50);

/// Reduced copy of a volume, once it is needed.
#[derive(Default)]
pub enum ReducedCopy {
    /// No picture has needed it.
    #[default]
    Unneeded,
    /// A background thread reads the volume.
    Pending(Reduction),
    /// The copy is on the device.
    Ready(Box<CachedSession>),
    /// There is no memory for it, or the volume cannot be read.
    Failed,
}

/// Background thread that reduces a volume. Dropping it cancels the work.
pub struct Reduction {
    task: Task<Result<Volume>>,
    loading: Arc<Loading>,
}

impl Drop for Reduction {
    fn drop(&mut self) {
        self.loading.cancel();
    }
}

impl Reduction {
    fn start(volume: &Arc<Volume>, budget: MemoryBudget) -> Result<Self> {
        let (volume, loading) = (Arc::clone(volume), Arc::new(Loading::default()));
        let own = Arc::clone(&loading);
        let no_wake: Wake = Arc::new(|| ());
        let task = Task::start("reduce", no_wake, move |sender, _| {
            let refuse = |why: String| Error::runtime("cannot reduce volume", &volume.provenance.source, why);
            let factors = budget.factors(volume.dims(), 0).map_err(refuse);
            // The receiver is gone after a cancellation.
            let _ = sender.send(factors.and_then(|factors| volume.downsampled(factors, &own)));
        })?;
        Ok(Self { task, loading })
    }
}

impl ReducedCopy {
    /// Returns the session with the copy of the volume of `full`; the first call starts to make it. Waits until it is made,
    /// and returns `None` if a request in `mailbox` ended the wait, or if there is no copy.
    ///
    /// # Errors
    /// The copy cannot be made. Later calls return `None`.
    pub fn session(&mut self, full: &CachedSession, mailbox: &Mailbox) -> Result<Option<&mut CachedSession>> {
        let Some(loaded) = &full.loaded else { return Ok(None) };
        if matches!(self, Self::Unneeded) {
            *self = Self::Failed;
            *self = Self::Pending(Reduction::start(&loaded.volume, budget(full))?);
        }
        while let Self::Pending(Reduction { task, .. }) = self {
            match task.poll() {
                Ok(volume) => {
                    *self = Self::Failed;
                    let cache = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Covering);
                    let renderer = Arc::clone(&full.renderer);
                    let mut session = CachedSession::new(renderer, DisabledOptimizations::NONE, cache);
                    session.load(Arc::new(volume?), None)?;
                    *self = Self::Ready(Box::new(session));
                }
                Err(TryRecvError::Empty) if mailbox.wait_for_request(WAIT) => return Ok(None),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => {
                    *self = Self::Failed;
                    let why = "an internal error occurred";
                    return Err(Error::runtime(
                        "cannot reduce volume",
                        &loaded.volume.provenance.source,
                        why,
                    ));
                }
            }
        }
        Ok(self.ready())
    }

    /// Gives up the copy, and says why.
    pub fn fail(&mut self, error: &Error, events: &EventSender) {
        *self = Self::Failed;
        events.send(Event::Note(format!("no reduced copy is drawn while something moves: {error}")));
    }

    /// Returns the session with the copy, once it is made.
    pub fn ready(&mut self) -> Option<&mut CachedSession> {
        if let Self::Ready(session) = self { Some(session) } else { None }
    }
}

/// Returns the part of a limit on device memory that a reduced copy may take, bytes.
pub fn reserve(limit: u64) -> u64 {
    limit / PARTS_OF_LIMIT
}

/// Returns the memory that a reduced copy may take beside the pages of a volume.
fn budget(full: &CachedSession) -> MemoryBudget {
    let gpu = full.renderer.gpu();
    let has_labels = full.loaded.as_ref().is_some_and(|loaded| loaded.volume.labels().is_some());
    MemoryBudget {
        fixed: None,
        most_bytes: gpu.memory_limit.map_or(MOST_BYTES, reserve),
        bytes_beside: TEXEL_BYTES + u64::from(has_labels),
        texture_side: gpu.device.limits().max_texture_dimension_3d as usize,
        fits_texture: holds_volume,
    }
}
