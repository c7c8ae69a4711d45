//! Graphics adapters that the Python module has opened, with one GPU device each.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use umbravox::error::Result;
use umbravox::gpu::Gpu;
use umbravox::render::Renderer;

static OPEN: Mutex<Option<HashMap<Option<String>, Arc<Renderer>>>> = Mutex::new(None);

/// Opens a separate GPU device for one measured comparison, so that the measured times do not include rendering by
/// other threads.
pub fn own(name: Option<&str>) -> Result<Arc<Renderer>> {
    Ok(Arc::new(Renderer::new(Gpu::open(name)?)))
}

/// Returns the renderer of the graphics adapter with the given name (`None`: the fastest). It is opened once, and
/// again after its device was lost.
pub fn renderer(name: Option<&str>) -> Result<Arc<Renderer>> {
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    let open = open.get_or_insert_default();
    let key = name.map(str::to_owned);
    if let Some(renderer) = open.get(&key).filter(|r| r.gpu().loss().reason().is_none()) {
        return Ok(Arc::clone(renderer));
    }
    let renderer = Arc::new(Renderer::new(Gpu::open(name)?));
    open.insert(key, Arc::clone(&renderer));
    Ok(renderer)
}
