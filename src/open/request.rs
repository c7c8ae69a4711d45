//! Everything that a command line or a scene file can say: scene settings, and flags about the run.

use super::SceneSettings;
use super::layer::{Layer, layer};
use crate::error::{Error, Result};
use clap::Args;
use serde::Serialize;
use std::ops::Not;
use std::path::PathBuf;

layer! {
/// Flags about the run: the adapter and the output.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct RunFlags {
    /// Print the plan: which work runs, which is skipped, and why
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub explain: bool,
    /// Print the result as JSON
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub json: bool,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}
}

layer! {
/// Everything that a scene file can say: a scene, and flags about the run.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct SceneRequest {
    /// Settings of the scene.
    #[command(flatten)]
    #[serde(flatten)]
    pub settings: SceneSettings,
    /// Flags about the run.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunFlags,
}
}

/// Flags that all commands share, and scene files below them.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct SceneArgs {
    /// Flags that are also keys of scene files.
    #[command(flatten)]
    pub request: SceneRequest,
    /// TOML file with any of these flags as keys, and `volume`; flags win. `compare` takes several, each with its own
    /// --scene
    #[arg(long, value_name = "FILE.toml", help_heading = "Scene")]
    pub scene: Vec<PathBuf>,
}

impl SceneArgs {
    /// The flags over the scene file, if any.
    ///
    /// # Errors
    /// The scene file cannot be read, or there is more than one.
    pub fn into_request(self) -> Result<SceneRequest> {
        if self.scene.len() > 1 {
            return Err(Error::input("bad command line", "--scene", "only `compare` takes more than one"));
        }
        Ok(self.into_requests()?.swap_remove(0))
    }

    /// The flags over each scene file, in their order; the flags alone where there is none.
    ///
    /// # Errors
    /// A scene file cannot be read.
    pub fn into_requests(self) -> Result<Vec<SceneRequest>> {
        let Self { request, scene } = self;
        if scene.is_empty() {
            return Ok(vec![request]);
        }
        scene.iter().map(|path| Ok(request.over(&SceneRequest::read(path)?))).collect()
    }
}
