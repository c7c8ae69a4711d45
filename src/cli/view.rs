//! `umbravox view`: the window.

use crate::open::SceneArgs;
use clap::Args;
use std::path::PathBuf;

/// Open the window: move the light, edit the transfer function, and view the errors of each method
#[derive(Debug, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Ignore the state of earlier runs (window, recent files, last scene), and save none
    #[arg(long)]
    pub clean: bool,
    /// Replay the input of FILE, write its output files, and close
    #[arg(long, value_name = "FILE", hide = true)]
    pub script: Option<PathBuf>,
}
