//! Settings from a command line or a scene file: those of a scene, and flags for graphics adapter and output.

use super::SceneSettings;
use super::layer::{Layer, layer};
use crate::error::{Error, Result};
use crate::files::input::is_standard_stream;
use crate::gpu::Gpu;
use crate::volume::ByteCount;
use clap::Args;
use serde::Serialize;
use std::ops::Not;
use std::path::PathBuf;

layer! {
/// Command-line flags for the graphics adapter and for the form of the printed output.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct RunFlags {
    /// Print the render plan: which work runs, which is skipped, and why
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub explain: bool,
    /// Print the command's results as JSON
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub json: bool,
    /// Use the graphics adapter whose name contains NAME [default: fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Device memory for voxels: a larger volume is drawn in pages, block by block if need be [default: no limit]
    #[arg(id = "device-memory", long, value_name = "BYTES")]
    #[serde(rename = "device-memory")]
    pub device_memory: Option<ByteCount>,
}
}

impl RunFlags {
    /// Opens the graphics adapter.
    ///
    /// # Errors
    /// See [`Gpu::open`].
    pub fn gpu(&self) -> Result<Gpu> {
        Ok(Gpu::open(self.adapter.as_deref())?.with_memory_limit(self.memory_limit()))
    }

    /// Returns the choice of an open graphics device.
    pub fn of(gpu: &Gpu) -> Self {
        let device_memory = gpu.memory_limit.map(ByteCount);
        Self { adapter: Some(gpu.info.name.clone()), device_memory, ..Self::default() }
    }

    /// Limit on the memory for voxels on the device, bytes.
    pub fn memory_limit(&self) -> Option<u64> {
        self.device_memory.map(|limit| limit.0)
    }
}

layer! {
/// All settings that a scene file can hold: those of a scene, and flags for graphics adapter and output.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct SceneRequest {
    /// Settings of the scene, such as its volume, transfer function, camera and lights.
    #[command(flatten)]
    #[serde(flatten)]
    pub settings: SceneSettings,
    /// Command-line flags for the graphics adapter and for the form of the printed output.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunFlags,
}
}

/// Command-line flags that all commands share, and the paths of scene files whose settings they override.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct SceneArgs {
    /// Command-line flags that are also keys of scene files.
    #[command(flatten)]
    pub request: SceneRequest,
    /// TOML file with any of these flags as keys, and `volume`; flags win. `compare` takes several, each with its own
    /// --scene. `-` is standard input
    #[arg(long, value_name = "FILE.toml", help_heading = "Scene")]
    pub scene: Vec<PathBuf>,
}

impl SceneArgs {
    /// Combines the command-line flags with the settings of the scene file, if one is given. Flags win over the file.
    ///
    /// # Errors
    /// The scene file cannot be read, or there is more than one.
    pub fn into_request(self) -> Result<SceneRequest> {
        if self.scene.len() > 1 {
            return Err(Error::input("bad command line", "--scene", "only `compare` takes more than one"));
        }
        Ok(self.into_requests()?.swap_remove(0))
    }

    /// Combines the command-line flags with the settings of each scene file in turn. Flags win over a file; without
    /// scene files it returns the flags alone.
    ///
    /// # Errors
    /// A scene file cannot be read, or two are standard input.
    pub fn into_requests(self) -> Result<Vec<SceneRequest>> {
        let Self { request, scene } = self;
        let request = SceneRequest { settings: request.settings.with_phase_function()?, ..request };
        if scene.is_empty() {
            return Ok(vec![request]);
        }
        if scene.iter().filter(|path| is_standard_stream(path)).count() > 1 {
            let why = "standard input holds one scene";
            return Err(Error::input("bad command line", "--scene -", why));
        }
        scene.iter().map(|path| Ok(request.over(&SceneRequest::read(path)?))).collect()
    }
}
