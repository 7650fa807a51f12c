"""Firefox, driven through WebDriver BiDi by the package websocket-client."""

import json
import os
import shutil
import subprocess
import tempfile
import time
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
import websocket

NAMES = ("firefox-esr", "firefox")
KEYS = {"\b": "\ue003", "Tab": "\ue004", "Enter": "\ue006"}  # as WebDriver has them
# Nothing of its own, and no network: what asks for one asks a port where nobody listens.
PREFERENCES = {
    "network.proxy.type": 1, "network.proxy.http": "127.0.0.1", "network.proxy.http_port": 9,
    "network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9,
    "datareporting.policy.dataSubmissionEnabled": False, "app.update.enabled": False,
    "browser.shell.checkDefaultBrowser": False, "browser.startup.page": 0,
    "ui.prefersReducedMotion": 1,
}  # fmt: skip


class Page:
    """A page of a running Firefox, and what went wrong in it."""

    def __init__(self, socket, allowed=()):
        self.socket, self.number, self.wrong = socket, 0, []
        self.allowed = ("file:", "data:", "blob:", "about:", *allowed)
        self.call("session.new", capabilities={})
        self.context = self.call("browsingContext.getTree")["contexts"][0]["context"]
        self.call("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])

    def call(self, method: str, **parameters) -> dict:
        """The result of a command; events that come meanwhile are looked at."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        while True:
            told = json.loads(self.socket.recv())
            if told.get("type") == "event":
                self._notice(told["method"], told["params"])
            elif told["id"] == self.number:
                assert told["type"] == "success", told
                return told["result"]

    def _notice(self, name: str, told: dict) -> None:
        if name == "log.entryAdded" and told["level"] == "error":
            self.wrong.append(told["text"])
        url = told.get("request", {}).get("url", "")
        if url and not url.startswith(self.allowed):
            self.wrong.append(f"asks for {url}")

    def goto(self, url: str) -> None:
        self.call("browsingContext.navigate", context=self.context, url=url, wait="complete")

    def press(self, *keys: str) -> None:
        """Press keys, one after another: letters, or names in `KEYS`."""
        values = [KEYS.get(key, key) for key in keys]
        actions = [{"type": kind, "value": one} for one in values for kind in ("keyDown", "keyUp")]
        self.call("input.performActions", context=self.context,
                  actions=[{"type": "key", "id": "keys", "actions": actions}])  # fmt: skip

    def size(self, width: int, height: int) -> None:
        self.call("browsingContext.setViewport", context=self.context,
                  viewport={"width": width, "height": height})  # fmt: skip

    def shot(self, path) -> None:
        """A picture of the whole page."""
        from base64 import b64decode

        told = self.call(
            "browsingContext.captureScreenshot", context=self.context, origin="document"
        )
        Path(path).write_bytes(b64decode(told["data"]))

    def evaluate(self, expression: str):
        """The value of an expression; a promise is waited for."""
        told = self.call(
            "script.evaluate", expression=f"(async () => JSON.stringify(await ({expression})))()",
            target={"context": self.context}, awaitPromise=True,
        )  # fmt: skip
        assert told["type"] == "success", told
        return json.loads(told["result"].get("value", "null"))


@contextmanager
def firefox(*allowed: str):
    """A page in a running Firefox; skips where there is none, fails if anything went wrong.

    Args:
        allowed: how addresses begin that it may ask, beside those of files.
    """
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("no Firefox here; on Debian: apt-get install firefox-esr")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        lines = (f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items())
        Path(folder, "user.js").write_text("\n".join(lines))
        command = [program, "--headless", "--no-remote", "--profile", folder,
                   "--remote-debugging-port", "0"]  # fmt: skip
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(command, env=os.environ | {"HOME": folder}, **quiet)
        try:
            address = _address(Path(folder))
            with closing(websocket.create_connection(
                address, suppress_origin=True, timeout=120)) as socket:  # fmt: skip
                page = Page(socket, allowed)
                yield page
                assert not page.wrong, "\n".join(page.wrong)
        finally:
            process.terminate()
            process.wait(30)


def _address(folder: Path, seconds: float = 60) -> str:
    """Where a Firefox listens, on this machine only: it says so in its profile."""
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        try:
            told = json.loads((folder / "WebDriverBiDiServer.json").read_text())
            return f"ws://{told['ws_host']}:{told['ws_port']}/session"
        except (OSError, ValueError, KeyError):
            time.sleep(0.1)
    raise TimeoutError("Firefox did not start")
