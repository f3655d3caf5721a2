"""A headless Chromium, driven through its debugging pipe, without a package for it.

Tests look at pages with it, and docs/scripts/page_pictures.py photographs them.
"""

from __future__ import annotations

import base64
import fcntl
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

NAMES = (
    *("chromium-headless-shell", "chromium", "chromium-browser"),
    *("google-chrome", "google-chrome-stable", "chrome"),
)
_HIGH_FD = 20  # below are those that the browser itself wants: 3 to read from, 4 to write to
_LAUNCH = """import os, sys
os.dup2(int(sys.argv[1]), 3)
os.dup2(int(sys.argv[2]), 4)
os.execv(sys.argv[3], sys.argv[3:])"""


def find_browser() -> str | None:
    """The first Chromium on the path."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


class Page:
    """A tab: loads files, runs script in them, and keeps what was said and asked for."""

    def __init__(self, pipe_in: int, pipe_out: int) -> None:
        self._write = pipe_in
        self._read = os.fdopen(pipe_out, "rb", 0)
        self._numbers = itertools.count(1)
        self._rest = b""
        self._session: str | None = None
        self.events: list[dict[str, Any]] = []

    def begin(self) -> None:
        """Makes the tab."""
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")

    def open(self, path: Path, fragment: str = "") -> None:
        """Loads a file and waits until its own script says which moment it shows."""
        self._call("Page.navigate", url=f"{path.as_uri()}{fragment}")
        self.wait("document.readyState === 'complete' && 'shown' in document.body.dataset")

    def wait(self, condition: str) -> None:
        """Waits, in the page, until an expression is true; an error after a minute."""
        self.script(
            "new Promise((done, fail) => { const until = Date.now() + 60000; const look = () => {"
            f"if ({condition}) done(); else if (Date.now() > until) fail(new Error('waited'));"
            "else setTimeout(look, 20); }; look(); })"
        )

    def script(self, expression: str) -> Any:
        """The value of an expression in the page."""
        answer = self._call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def key(self, name: str) -> None:
        """Presses a key."""
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=name)

    def resize(self, width: int, height: int, *, dark: bool = False) -> None:
        """Makes the window so large, by day or by night."""
        self._call(
            "Emulation.setDeviceMetricsOverride",
            **{"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )
        self._call("Emulation.setScrollbarsHidden", hidden=True)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[scheme])

    def photograph(self) -> bytes:
        """What the window shows, as a PNG."""
        data: str = self._call("Page.captureScreenshot", format="png")["data"]
        return base64.b64decode(data)

    def complaints(self) -> list[dict[str, Any]]:
        """Errors and warnings so far."""
        kinds = ("Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled")
        return [event for event in self.events if event.get("method") in kinds]

    def requests(self) -> list[str]:
        """Addresses that were asked for so far."""
        sent = (e for e in self.events if e.get("method") == "Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in sent]

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                data = self._read.read(1 << 16)
                assert data, "the browser has ended"
                self._rest += data
            one, _, self._rest = self._rest.partition(b"\0")
            answer = json.loads(one)
            if answer.get("id") == number:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def close(self) -> None:
        """Closes both ends, which ends the browser."""
        os.close(self._write)
        self._read.close()


@contextmanager
def browser_page(browser: str, profile: Path) -> Iterator[Page]:
    """A tab of a fresh browser, which ends with the block."""
    child_in, ours_out = os.pipe()
    ours_in, child_out = os.pipe()
    high_in, high_out = (fcntl.fcntl(fd, fcntl.F_DUPFD, _HIGH_FD) for fd in (child_in, child_out))
    options = ["--headless", "--remote-debugging-pipe", f"--user-data-dir={profile}"]
    options.append("--disable-features=IsolateSandboxedIframes")  # they complain in their page too
    if os.geteuid() == 0:
        options.append("--no-sandbox")  # root may not have one
    process = subprocess.Popen(
        [sys.executable, "-c", _LAUNCH, str(high_in), str(high_out), browser, *options],
        pass_fds=(high_in, high_out),
        stderr=subprocess.DEVNULL,
    )
    for descriptor in (child_in, child_out, high_in, high_out):
        os.close(descriptor)
    page = Page(ours_out, ours_in)
    try:
        page.begin()
        yield page
    finally:
        page.close()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
