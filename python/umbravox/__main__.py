"""The program ``umbravox``: the commands of the compiled one, without its window."""

import os
import sys

from ._umbravox import command  # type: ignore


def main() -> int:
    """Runs the command line of this process and returns the exit status."""
    # Without any of these, Mesa's layer that selects a device prints an error although nothing fails.
    if not any(key in os.environ for key in ("XDG_RUNTIME_DIR", "DISPLAY", "DRI_PRIME", "MESA_VK_DEVICE_SELECT")):
        os.environ["NODEVICE_SELECT"] = "1"
    return command(["umbravox", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
