"""A view in a process of its own, and a real browser that is driven by the DevTools protocol."""

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mecanum_env.errors import BackendError
from mecanum_env.rendering.backend import choose_backend

_LOADS = 3
"""How often a page is loaded before a test says that it cannot be."""
NAMES = ("chromium", "chromium-browser", "google-chrome")


class View:
    """A running `python -m mecanum_env.view`."""

    def __init__(self, *args: str) -> None:
        command = [sys.executable, "-m", "mecanum_env.view", "--no-browser", *args]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ,
            # A program that was started in the background ignores the signal, and so would its child.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C; return the exit code and what was written to stderr."""
        self.process.send_signal(signal.SIGINT)
        _, errors = self.process.communicate(timeout=30)
        return self.process.returncode, errors


@pytest.fixture(scope="module")
def start_view() -> Iterator[Callable[..., View]]:
    """Return a function that starts a view, and ends the one before, which would go on drawing."""
    try:
        choose_backend()
    except BackendError as error:
        pytest.skip(str(error))
    started: list[View] = []

    def start(*args: str) -> View:
        end()
        started.append(View(*args))
        return started[-1]

    def end() -> None:
        for view in started:
            if view.process.poll() is None:
                view.process.kill()
            view.process.communicate()
        started.clear()

    yield start
    end()


class Page:
    """A tab of a browser."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._numbers = socket, itertools.count()

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            answer = json.loads(self._socket.recv(timeout=60))
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]

    def run(self, script: str) -> Any:
        """Return the value of a JavaScript expression."""
        done = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def open(self, url: str, width: int = 1280) -> None:
        """Open an address in a window of some width [px], and wait until it shows the robot or the log."""
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        shown = "document.querySelectorAll('#effects input').length > 0"
        # A loaded machine once left a page without its files; a reader would load it again, too.
        for _ in range(_LOADS - 1):
            failed = self.call("Page.navigate", url=url).get("errorText")
            if not failed and self._becomes(shown, wait_s=20.0):
                return
        failed = self.call("Page.navigate", url=url).get("errorText")
        assert not failed, f"{url}: {failed}"
        self.until(shown)

    def until(self, condition: str) -> None:
        """Wait until a JavaScript expression is true."""
        if not self._becomes(condition, wait_s=60.0):
            page = self.run("`${document.readyState}: ${document.body?.innerText.slice(0, 300)}`")
            raise AssertionError(f"never true: {condition}; the page is {page}")

    def _becomes(self, condition: str, wait_s: float) -> bool:
        """Return whether a JavaScript expression becomes true within some time."""
        deadline = time.monotonic() + wait_s
        while not self.run(condition):
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.05)
        return True

    def key(self, code: str, *, down: bool) -> None:
        """Press a key, or let it go."""
        kind = "rawKeyDown" if down else "keyUp"
        self.call("Input.dispatchKeyEvent", type=kind, code=code, key=code[-1].lower())

    def number(self, name: str) -> float:
        """Return a number that the page shows, by the id of its element."""
        return float(self.run(f"parseFloat(document.getElementById('{name}').textContent)"))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """Return a tab of a headless browser; skip without one. CI installs one: there it must run."""
    from websockets.sync.client import connect

    browser = next(filter(None, map(shutil.which, NAMES)), None)
    if browser is None and not os.environ.get("CI"):
        pytest.skip("no chromium here to open the page with")
    assert browser is not None
    profile = tmp_path_factory.mktemp("browser")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-port=0"]
    # What the browser asks of its maker's hosts only waits for answers on a machine without network.
    flags += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    process = subprocess.Popen(
        [browser, *flags, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        with connect(_address(profile), open_timeout=60, max_size=None, compression=None) as socket:
            yield Page(socket)
            socket.send(json.dumps({"id": -1, "method": "Browser.close"}))
    finally:
        process.terminate()
        process.wait(timeout=30)


def _address(profile: Path) -> str:
    """Return the address of the first tab, which Chromium writes down when it is ready."""
    from urllib.request import urlopen

    file = profile / "DevToolsActivePort"
    deadline = time.monotonic() + 60.0
    while not (file.exists() and len(file.read_text().splitlines()) == 2):
        assert time.monotonic() < deadline, "the browser did not start"
        time.sleep(0.05)
    port = file.read_text().splitlines()[0]
    while time.monotonic() < deadline:
        with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
            tabs = [tab for tab in json.load(answer) if tab["type"] == "page"]
        if tabs:
            return str(tabs[0]["webSocketDebuggerUrl"])
        time.sleep(0.05)
    raise AssertionError("the browser has no tab")
