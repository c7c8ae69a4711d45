//! `umbravox view`: the window.

use super::scene_args::SceneArgs;
use crate::error::Result;
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

/// Runs the command.
///
/// # Errors
/// Bad input, or a system that refuses the window.
#[cfg(feature = "gui")]
pub fn run(args: ViewArgs) -> Result<()> {
    use crate::app::{Script, Start};
    use crate::scene::Shading;

    let script = args.script.as_deref().map(Script::read).transpose()?;
    let asked = args.scene != SceneArgs::default();
    let mut request = args.scene.into_request()?;
    // Said before a window opens, as any other command would.
    request.method()?;
    request.shading = request.shading.or(Some(Shading::Lambert));
    let adapter = request.adapter.clone();
    let request = (asked || args.clean).then_some(request);
    crate::app::run(Start { request, adapter, clean: args.clean, script })
}

/// Refuses: this build has no window.
///
/// # Errors
/// Always.
#[cfg(not(feature = "gui"))]
pub fn run(_args: ViewArgs) -> Result<()> {
    use crate::error::Error;
    let why = "the window was left out of this build (cargo feature `gui`)";
    Err(Error::input("cannot open the window", "view", why)
        .hint("build without --no-default-features, or use `render`"))
}
