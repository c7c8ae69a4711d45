//! `umbravox view`: the window.

use crate::open::SceneArgs;
use clap::Args;
use std::path::PathBuf;

/// Open the window: drag the light, draw opacity, see where each method errs
#[derive(Debug, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Start without what was kept from earlier runs (window, recent files, last scene), and keep nothing
    #[arg(long)]
    pub clean: bool,
    /// Replay the input of FILE, write what it asks for, and close
    #[arg(long, value_name = "FILE", hide = true)]
    pub script: Option<PathBuf>,
}
