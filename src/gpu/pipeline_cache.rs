//! Compiled pipelines kept between runs of the program, where the adapter can hand them out.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A cache that has grown beyond this is started anew: what older versions compiled never leaves it.
const MOST_BYTES: u64 = 64 << 20;

/// The adapter's cache and the file that keeps it: `umbravox/wgpu_pipeline_cache_...` in the user's cache folder.
///
/// Nothing depends on it: a file that cannot be read or written, or is of another driver, means compiling.
#[derive(Debug)]
pub struct PipelineStore {
    /// wgpu's cache, which pipelines are made with.
    pub cache: wgpu::PipelineCache,
    file: PathBuf,
    /// What the file held when it was read.
    stored: Option<Vec<u8>>,
}

impl PipelineStore {
    /// Opens the cache of a device; `None` where the adapter has none or the user no cache folder.
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
        // SAFETY: only this type writes the file, whole or not at all, with what the same call of wgpu handed out; wgpu and
        // the driver check its headers against adapter and driver version.
        let cache = unsafe {
            device.create_pipeline_cache(&wgpu::PipelineCacheDescriptor {
                label: Some("pipelines"),
                data: stored.as_deref(),
                fallback: true,
            })
        };
        Some(Self { cache, file, stored })
    }

    /// Writes what there is now, unless the file holds that already.
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
            tracing::debug!("cannot keep compiled pipelines ({}): {e}", self.file.display());
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
        let kept = fs::read(&file).unwrap();
        let second = open().unwrap();
        assert_eq!(second.stored.as_ref(), Some(&kept));
        drop(second);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing is left behind");
        fs::write(&file, b"rubbish").unwrap();
        drop(open().unwrap());
        gpu.take_error().unwrap();
        assert_eq!(fs::read(&file).unwrap(), kept, "it is replaced");
    }
}
