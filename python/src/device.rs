//! Graphics adapters that are open, each once.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use umbravox::error::Result;
use umbravox::gpu::Gpu;
use umbravox::render::Renderer;

static OPEN: Mutex<Option<HashMap<Option<String>, Arc<Renderer>>>> = Mutex::new(None);

/// One for a table alone: no picture of another thread's is counted among the work that is measured.
pub fn own(name: Option<&str>) -> Result<Arc<Renderer>> {
    Ok(Arc::new(Renderer::new(Gpu::open(name)?)))
}

/// What draws on the adapter of that name (`None`: the fastest); opened once, and again where its device was lost.
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
