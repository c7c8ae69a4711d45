//! The `umbravox` command.

use std::env;
use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_device_selection();
    umbravox::cli::main(env::args_os())
}

/// Keeps Mesa's device-selection layer out where it could only complain: without `XDG_RUNTIME_DIR` there is no Wayland
/// to ask for its device, and the layer writes an `error:` line to stderr although nothing failed.
fn quiet_device_selection() {
    let asked = ["XDG_RUNTIME_DIR", "DISPLAY", "DRI_PRIME", "MESA_VK_DEVICE_SELECT"];
    if asked.iter().all(|key| env::var_os(key).is_none()) {
        // SAFETY: no other thread has been started yet.
        unsafe { env::set_var("NODEVICE_SELECT", "1") };
    }
}
