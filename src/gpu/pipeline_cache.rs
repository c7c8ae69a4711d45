//! Cache of compiled compute pipelines on disk, where the adapter supports it.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Largest file of the pipeline cache that is read, in bytes. Pipelines of older versions never leave the cache, and
/// so it is started anew beyond this size.
const MOST_BYTES: u64 = 64 << 20;

/// Cache of an adapter's compiled pipelines, with its file `umbravox/wgpu_pipeline_cache_...` in the user's cache
/// folder.
///
/// If the file cannot be read or written, or comes from another driver, pipelines are compiled anew.
#[derive(Debug)]
pub struct PipelineStore {
    /// Pipeline cache of wgpu, with which compute pipelines are created.
    pub cache: wgpu::PipelineCache,
    file: PathBuf,
    /// Content of the pipeline cache's file when it was opened.
    stored: Option<Vec<u8>>,
}

impl PipelineStore {
    /// Opens the pipeline cache of a device. Returns `None` if the adapter does not support one, or if the user has
    /// no cache folder.
    pub fn open(device: &wgpu::Device, info: &wgpu::AdapterInfo) -> Option<Self> {
        let folder = dirs::cache_dir()?.join("umbravox");
        Self::open_in(&folder, device, info)
    }

    fn open_in(folder: &Path, device: &wgpu::Device, info: &wgpu::AdapterInfo) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let file = folder.join(wgpu::util::pipeline_cache_key(info)?);
        let small = fs::metadata(&file).is_ok_and(|m| m.len() <= MOST_BYTES);
        let stored = if small { fs::read(&file).ok() } else { None };
        // SAFETY: only this type writes the file, whole or not at all, with data from wgpu. wgpu and the driver check
        // its headers against the versions of adapter and driver.
        let cache = unsafe {
            device.create_pipeline_cache(&wgpu::PipelineCacheDescriptor {
                label: Some("pipelines"),
                data: stored.as_deref(),
                fallback: true,
            })
        };
        Some(Self { cache, file, stored })
    }

    /// Writes the compiled pipelines to the cache file, unless the file already has this content.
    fn save(&self) -> std::io::Result<()> {
        let Some(data) = self.cache.get_data().filter(|d| self.stored.as_ref() != Some(d)) else {
            return Ok(());
        };
        let folder = self.file.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(&data)?;
        file.persist(&self.file)?;
        Ok(())
    }
}

impl Drop for PipelineStore {
    fn drop(&mut self) {
        if let Err(e) = self.save() {
            tracing::debug!("cannot save compiled pipelines ({}): {e}", self.file.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;

    #[test]
    fn what_is_kept_is_read_again_and_rubbish_is_not_believed() {
        let Some(gpu) = common::gpu() else { return };
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("new");
        let open = || PipelineStore::open_in(&folder, &gpu.device, &gpu.info);
        let Some(first) = open() else {
            return common::skip("the adapter has no pipeline cache");
        };
        assert_eq!(first.stored, None);
        let file = first.file.clone();
        drop(first);
        let saved = fs::read(&file).unwrap();
        let second = open().unwrap();
        assert_eq!(second.stored.as_ref(), Some(&saved));
        drop(second);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "no temporary file is left");
        fs::write(&file, b"rubbish").unwrap();
        drop(open().unwrap());
        gpu.take_error().unwrap();
        assert_eq!(fs::read(&file).unwrap(), saved, "the damaged file is replaced");
    }
}
