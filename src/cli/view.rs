//! `umbravox view`: flags of the interactive viewer window.

use crate::open::SceneArgs;
use clap::Args;

/// Open the interactive window: drag the light, edit the transfer function, see the error of each shadow method
#[derive(Debug, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Start the window without saved settings (window size, recent files, last scene), and save none
    #[arg(long)]
    pub clean: bool,
}
