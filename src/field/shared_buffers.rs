//! Device buffers that depend on volume and transfer function, but not on a light: the shadow maps of all lights share
//! them.

use crate::error::Result;
use crate::gpu::Span;
use std::sync::{Arc, Mutex, PoisonError};

/// Key of a shared buffer: the shadow method, and the bits of the setting on which the buffer depends.
type BufferKey = (&'static str, u64);

/// Largest number of shared buffers; the least recently used one is dropped.
const MOST_BUFFERS: usize = 8;

/// Buffers that shadow methods compute once for a transfer function, and not once for a light.
#[derive(Debug, Clone, Default)]
pub struct SharedBuffers(Arc<Mutex<Vec<(BufferKey, wgpu::Buffer)>>>);

impl SharedBuffers {
    /// Returns the buffer with a key. The first call computes it with `make`, and also returns the time of its passes.
    ///
    /// # Errors
    /// The device cannot compute the buffer.
    pub fn get_or_make(
        &self,
        key: BufferKey,
        make: impl FnOnce() -> Result<(wgpu::Buffer, Span)>,
    ) -> Result<(wgpu::Buffer, Option<Span>)> {
        let mut buffers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (entry, span) = match buffers.iter().position(|(other, _)| *other == key) {
            Some(place) => (buffers.remove(place), None),
            None => {
                if buffers.len() == MOST_BUFFERS {
                    buffers.remove(0);
                }
                let (buffer, span) = make()?;
                ((key, buffer), Some(span))
            }
        };
        let buffer = entry.1.clone();
        buffers.push(entry);
        Ok((buffer, span))
    }
}
