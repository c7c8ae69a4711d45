"""Chromium without a window, driven over the DevTools protocol, and a page that shows a widget of this process.

The page has a stand-in for the model of anywidget. Its messages are those of a notebook (comm messages of ipywidgets), so that
the widget in Python is the real one.
"""

import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import asynccontextmanager
from pathlib import Path

import tornado.httpclient
import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket
from comm.base_comm import BaseComm

BROWSERS = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable"
#: Longest time for an answer of the page, s, on a busy machine.
PATIENCE_S = 120

PAGE = """<!doctype html><meta charset="utf-8"><title>widget</title><link rel="icon" href="data:,"><link rel="stylesheet" href="widget.css">
<body style="margin: 16px; background: #fff"><div id="widget" style="width: 480px"></div>
<script type="module" src="host.js"></script>"""

HOST = """
import widget from "./widget.js";
const socket = new WebSocket(`ws://${location.host}/comm`);
const [state, dirty, listeners] = [{}, {}, {}];
const fire = (name) => (listeners["change:" + name] ?? []).slice().forEach((listener) => listener());
const model = {
  get: (name) => state[name],
  set: (name, value) => {
    if (JSON.stringify(state[name]) === JSON.stringify(value)) return;
    dirty[name] = state[name] = value;
    fire(name);
  },
  save_changes: () => {
    const changed = { ...dirty };
    for (const name of Object.keys(dirty)) delete dirty[name];
    socket.send(JSON.stringify(changed));
  },
  on: (event, listener) => (listeners[event] ??= []).push(listener),
  off: (event, listener) => (listeners[event] = (listeners[event] ?? []).filter((other) => other !== listener)),
};
window.model = model;
socket.onmessage = ({ data }) => {
  const { opens, changes, buffers } = JSON.parse(data);
  for (const [name, text] of Object.entries(buffers)) {
    changes[name] = new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  }
  Object.assign(state, changes);
  if (opens) widget.render({ model, el: document.getElementById("widget") });
  else Object.keys(changes).forEach(fire);
};
"""


def find_browser():
    """The first browser on the path, or ``None``."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


class PageComm(BaseComm):
    """Comm of a widget whose messages go to the page."""

    socket = None

    def publish_msg(self, msg_type, data=None, metadata=None, buffers=None, **keys):
        # Notebooks send back what a page has changed, also while the page is ahead of it.
        if self.socket is not None and data and data.get("method") in ("update", "echo_update"):
            self.send_state(data, buffers, opens=False)

    def send_state(self, data, buffers, opens):
        names = [path[0] for path in data.get("buffer_paths", [])]
        texts = {name: base64.b64encode(buffer).decode() for name, buffer in zip(names, buffers or [])}
        changes = {name: value for name, value in data["state"].items() if name not in texts}
        message = json.dumps({"opens": opens, "changes": changes, "buffers": texts})
        self.socket.write_message(message)


class Socket(tornado.websocket.WebSocketHandler):
    """End of the page's connection: changes of its model are messages to the widget."""

    def initialize(self, widget, requests):
        self.widget, self.requests = widget, requests

    def open(self):
        self.widget.comm.socket = self
        state = self.widget.get_state()
        names = [name for name, value in state.items() if isinstance(value, (bytes, memoryview))]
        data = {"state": state, "buffer_paths": [[name] for name in names]}
        # References to other widgets, such as the layout, are of no use to the page.
        data["state"] = {name: value for name, value in state.items() if not isinstance(value, str) or "IPY_MODEL" not in value}
        self.widget.comm.send_state(data, [state[name] for name in names], opens=True)

    def on_message(self, message):
        changes = json.loads(message)
        self.requests.append(changes)
        data = {"method": "update", "state": changes, "buffer_paths": []}
        self.widget.comm.handle_msg({"content": {"data": data}, "buffers": []})


class Text(tornado.web.RequestHandler):
    def initialize(self, text, kind):
        self.text, self.kind = text, kind

    def get(self):
        self.set_header("Content-Type", self.kind)
        self.write(self.text)


class Page:
    """A page of the browser."""

    def __init__(self, connection, requests):
        self.connection, self.requests, self.count, self.faults = connection, requests, 0, []

    async def call(self, method, **params):
        """Runs a command of the DevTools protocol."""
        self.count += 1
        number = self.count
        await self.connection.write_message(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            answer = json.loads(await asyncio.wait_for(self.connection.read_message(), PATIENCE_S))
            if answer.get("method") == "Runtime.exceptionThrown":
                self.faults.append(answer["params"]["exceptionDetails"])
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]

    async def evaluate(self, expression):
        """Value of an expression, or of its promise."""
        found = await self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    async def until(self, expression):
        """Waits until an expression is true."""
        for _ in range(PATIENCE_S * 20):
            if await self.evaluate(expression):
                return
            await asyncio.sleep(0.05)
        raise AssertionError(f"the page does not get to {expression}: {self.faults}")

    async def mouse(self, kind, x, y, **params):
        await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **params)

    async def drag(self, start, end, modifiers=0, steps=6):
        """Drags with the left button from one place of the page to another."""
        pressed = {"button": "left", "buttons": 1, "modifiers": modifiers}
        await self.mouse("mouseMoved", *start, modifiers=modifiers)
        await self.mouse("mousePressed", *start, clickCount=1, **pressed)
        for i in range(1, steps + 1):
            x, y = (a + (b - a) * i / steps for a, b in zip(start, end))
            await self.mouse("mouseMoved", x, y, **pressed)
        await self.mouse("mouseReleased", *end, clickCount=1, **pressed)

    async def touch(self, *places):
        """Moves one or more fingers; ``places`` are the paths of the fingers, of equal length."""
        for i, at in enumerate(zip(*places)):
            points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(at)]
            await self.call("Input.dispatchTouchEvent", type="touchMove" if i else "touchStart", touchPoints=points)
        await self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    async def key(self, key, modifiers=0):
        for kind in ("keyDown", "keyUp"):
            await self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, modifiers=modifiers)

    async def centre(self, selector, at=0):
        """Place of the centre of an element."""
        box = f"document.querySelectorAll({selector!r})[{at}].getBoundingClientRect()"
        return await self.evaluate(f"(() => {{ const b = {box}; return [b.x + b.width / 2, b.y + b.height / 2]; }})()")

    async def screenshot(self, path):
        """Writes the page as a PNG file, to look at."""
        Path(path).write_bytes(base64.b64decode((await self.call("Page.captureScreenshot"))["data"]))


@asynccontextmanager
async def page_of(browser, widget, width=520, height=760):
    """Shows a widget, which was made with ``PageComm``, in a page of a browser."""
    from umbravox import _widget

    folder, requests = Path(_widget.__file__).parent, []
    texts = {"": (PAGE, "text/html"), "host.js": (HOST, "text/javascript")}
    texts["widget.js"] = ((folder / "widget.js").read_text(), "text/javascript")
    texts["widget.css"] = ((folder / "widget.css").read_text(), "text/css")
    routes = [(f"/{name}", Text, {"text": text, "kind": f"{kind}; charset=utf-8"}) for name, (text, kind) in texts.items()]
    routes.append(("/comm", Socket, {"widget": widget, "requests": requests}))
    server = tornado.httpserver.HTTPServer(tornado.web.Application(routes))
    sockets = tornado.netutil.bind_sockets(0, "127.0.0.1")
    server.add_sockets(sockets)
    address = f"http://127.0.0.1:{sockets[0].getsockname()[1]}/"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        line = [browser, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--disable-gpu"]
        line += ["--disable-background-networking", "--remote-debugging-port=0", "--remote-allow-origins=*"]
        line += [f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        child = subprocess.Popen(line, env=os.environ | {"HOME": profile}, **quiet)
        try:
            connection = await _connected(Path(profile), child)
            page = Page(connection, requests)
            await page.call("Runtime.enable")
            await page.call("Page.enable")
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            await page.call("Emulation.setDeviceMetricsOverride", **size)
            await page.call("Page.navigate", url=address)
            await page.until("Boolean(window.model && document.querySelector('.ux-widget'))")
            yield page
            assert not page.faults, page.faults
            connection.close()
        finally:
            child.kill()
            child.wait()
            server.stop()


async def _connected(profile, child):
    """Connection to the first page of a browser that starts."""
    for _ in range(PATIENCE_S * 10):
        assert child.poll() is None, "the browser has ended"
        lines = (profile / "DevToolsActivePort").read_text().splitlines() if (profile / "DevToolsActivePort").exists() else []
        if len(lines) == 2:
            break
        await asyncio.sleep(0.1)
    client = tornado.httpclient.AsyncHTTPClient()
    for _ in range(PATIENCE_S * 10):
        pages = json.loads((await client.fetch(f"http://127.0.0.1:{lines[0]}/json/list")).body)
        found = [page for page in pages if page["type"] == "page"]
        if found:
            return await tornado.websocket.websocket_connect(found[0]["webSocketDebuggerUrl"], max_message_size=1 << 28)
        await asyncio.sleep(0.1)
    raise AssertionError("the browser has no page")
