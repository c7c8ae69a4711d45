//! `umbravox view`: the window.

use crate::open::SceneArgs;
use clap::Args;

/// Open the window: drag the light, edit opacity, see the error of each method
#[derive(Debug, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Start without saved settings (window, recent files, last scene), and save none
    #[arg(long)]
    pub clean: bool,
}
