//! Graphics adapters that the Python module has opened, with one GPU device each.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use umbravox::error::Result;
use umbravox::open::RunFlags;
use umbravox::render::Renderer;

/// Name of a graphics adapter, and the limit on its memory.
type Choice = (Option<String>, Option<u64>);

static OPEN: Mutex<Option<HashMap<Choice, Arc<Renderer>>>> = Mutex::new(None);

/// Opens a separate GPU device for one measured comparison, so that the measured times do not include rendering by
/// other threads.
pub fn own(run: &RunFlags) -> Result<Arc<Renderer>> {
    Ok(Arc::new(Renderer::new(run.gpu()?)))
}

/// Returns the renderer of the chosen graphics adapter. It is opened once for each choice, and again after its device
/// was lost.
pub fn renderer(run: &RunFlags) -> Result<Arc<Renderer>> {
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    let open = open.get_or_insert_default();
    let key = (run.adapter.clone(), run.memory_limit());
    if let Some(renderer) = open.get(&key).filter(|r| r.gpu().loss().reason().is_none()) {
        return Ok(Arc::clone(renderer));
    }
    let renderer = Arc::new(Renderer::new(run.gpu()?));
    open.insert(key, Arc::clone(&renderer));
    Ok(renderer)
}
