//! Entry point of the `umbravox` command.

use std::env;
use std::process::ExitCode;
use umbravox::Result;
use umbravox::cli::view::ViewArgs;

fn main() -> ExitCode {
    quiet_device_selection();
    umbravox::cli::main(env::args_os(), view).into()
}

/// Opens the viewer window for the `view` command.
#[cfg(feature = "gui")]
fn view(args: ViewArgs) -> Result<()> {
    use umbravox::app::{Start, run};
    use umbravox::open::SceneArgs;

    let asked = args.scene != SceneArgs::default();
    let request = args.scene.into_request()?;
    if asked {
        // The window would open without the volume, and show the error there.
        request.settings.check_volume_exists()?;
    }
    let scene = (asked || args.clean).then_some(request.settings);
    run(Start { scene, run: request.run, clean: args.clean, hook: None })
}

/// Returns an error for the `view` command, because this build has no window.
#[cfg(not(feature = "gui"))]
fn view(_args: ViewArgs) -> Result<()> {
    let why = "the window was left out of this build (cargo feature `gui`)";
    Err(umbravox::Error::input("cannot open the window", "view", why)
        .hint("build without --no-default-features, or use `render`"))
}

/// Disables Mesa's Vulkan device-selection layer where it could only print a misleading error. Without
/// `XDG_RUNTIME_DIR` there is no Wayland server to ask for its device. The layer then writes an `error:` line to
/// stderr although nothing failed.
fn quiet_device_selection() {
    let asked = ["XDG_RUNTIME_DIR", "DISPLAY", "DRI_PRIME", "MESA_VK_DEVICE_SELECT"];
    if asked.iter().all(|key| env::var_os(key).is_none()) {
        // SAFETY: no other thread has been started yet.
        unsafe { env::set_var("NODEVICE_SELECT", "1") };
    }
}
