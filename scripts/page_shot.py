#!/usr/bin/env python3
"""Writes a screenshot of a page of `umbravox export`, once it has drawn its picture.

usage: page_shot.py PAGE.html OUT.png [WIDTHxHEIGHT]

Chromium draws without a window on the software adapter SwiftShader. Commands of the DevTools protocol go through pipes.
"""

import base64
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BROWSERS = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable"
FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--disable-background-networking",
    "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan", "--use-vulkan=swiftshader",
    "--hide-scrollbars", "--remote-debugging-pipe",
]
#: Longest time until the picture is drawn, s.
PATIENCE_S = 300
DRAWN = "String(document.documentElement.dataset.drawn).endsWith('whole')"


class Browser:
    """Chromium, whose file descriptors 3 and 4 are the pipes of the DevTools protocol."""

    def __init__(self, program, profile):
        (reads, self.commands), (self.answers, writes) = os.pipe(), os.pipe()

        def place_pipes():
            # Both ends are moved away first, so that neither overwrites the other.
            ends = os.dup(reads), os.dup(writes)
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        line = [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.child = subprocess.Popen(line, preexec_fn=place_pipes, close_fds=False, **quiet)
        os.close(reads)
        os.close(writes)
        self.count, self.session, self.rest = 0, {}, b""

    def call(self, method, **params):
        """Runs a command, and returns its result."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": params, **self.session}
        os.write(self.commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.next_message()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise SystemExit(f"error: {method}: {answer['error']['message']}")
                return answer["result"]

    def next_message(self):
        while b"\0" not in self.rest:
            part = os.read(self.answers, 1 << 20)
            if not part:
                raise SystemExit("error: the browser has ended")
            self.rest += part
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)


def shot(browser, page, size):
    """Opens a page, waits for its picture, and returns the screenshot as PNG."""
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    browser.session = {"sessionId": session}
    width, height = size
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    browser.call("Page.navigate", url=page.resolve().as_uri())
    start = time.monotonic()
    while browser.call("Runtime.evaluate", expression=DRAWN)["result"].get("value") is not True:
        if time.monotonic() - start > PATIENCE_S:
            raise SystemExit(f"error: {page} has drawn nothing after {PATIENCE_S} s")
        time.sleep(0.2)
    return base64.b64decode(browser.call("Page.captureScreenshot")["data"])


def main(page, output, size="1000x900"):
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise SystemExit(f"error: there is no {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            Path(output).write_bytes(shot(browser, Path(page), [int(side) for side in size.split("x")]))
        finally:
            browser.child.kill()
            browser.child.wait()


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
