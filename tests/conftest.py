"""Fixtures and settings that every test shares."""

import contextlib
import gc
import html
import json
import os
import re
import shutil
import subprocess
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import pytest
from hypothesis import settings

from mecanum_env.errors import BackendError
from mecanum_env.model import Model, paper_model
from mecanum_env.rendering.backend import use_backend

# Waiting for the disk takes most of the time of tests that write many small files, and proves nothing here.
os.fsync = lambda _: None

# Before any test imports mujoco, which picks its graphics library then. Without one, only drawing is amiss.
with contextlib.suppress(BackendError):
    use_backend()

# Deterministic: the same examples on every machine and run, and no verdict that depends on its speed.
settings.register_profile("deterministic", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("deterministic")


LONGEST = (
    "docs/test_blocks.py",
    "fit/effects/test_drive_effects.py",
    "fit/robot/test_simple_robot.py",
    "regression/test_own_robots.py",
    "test_close_the_loop.py",
    "test_onto_a_robot.py",
)
"""Files that take long, and start first: at the end the others would wait for one of them."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first; all others stay in their order."""
    here = Path(__file__).parent
    first = {here / name for name in LONGEST}
    assert all(path.is_file() for path in first), "a file of LONGEST is gone"
    items.sort(key=lambda item: item.path not in first)


@pytest.fixture
def paper() -> Model:
    """Return the packaged model of the paper."""
    return paper_model()


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """Return the folder of recordings of real robots, no part of the repository; skip without it."""
    beside_the_checkout = Path(__file__).parents[1].parent / "shared" / "data"
    path = Path(os.environ.get("MECANUM_REAL_LOGS", beside_the_checkout))
    if not (path / "husky").is_dir():
        pytest.skip(
            "no real logs here; set MECANUM_REAL_LOGS to the folder that holds husky/ and micromouse/"
        )
    return path


@pytest.fixture(scope="session")
def robotino(real_logs: Path) -> Path:
    """Return the folder of the Robotino's recordings; skip without it."""
    path = real_logs / "robotino"
    if not path.is_dir():
        pytest.skip("no robotino among the real logs")
    return path


@pytest.fixture(scope="session")
def browser() -> str:
    """Return the path of a browser; skip without one. CI installs one: there a test that needs it fails."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None and not os.environ.get("CI"):
        pytest.skip("no chromium here to open the page with")
    assert found is not None
    return found


def open_page(browser: str, page: Path, profile: Path, *options: str) -> tuple[str, list[str]]:
    """Open a page in a headless browser without network; return its elements and the console's errors."""
    done = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND",
         "--enable-logging=stderr", "--v=0", f"--user-data-dir={profile}",
         "--virtual-time-budget=20000", *options, "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    return done.stdout, [line for line in done.stderr.splitlines() if ":CONSOLE" in line and "rror" in line]


@pytest.fixture
def draw_page(browser: str, tmp_path: Path) -> Callable[[Path], tuple[int, int, list[str]]]:
    """Open a page in a headless browser without network.

    What it returns takes a page and returns how many figures it has, how many were drawn, and what the
    console said of errors.
    """

    def draw(page: Path) -> tuple[int, int, list[str]]:
        elements, errors = open_page(browser, page, tmp_path / "browser")
        figures = page.read_text(encoding="utf-8").count('class="plotly-graph-div"')
        return figures, len(re.findall(r'<div class="[^"]*svg-container', elements)), errors

    return draw


@pytest.fixture
def crossed_text(browser: str, tmp_path: Path) -> Callable[[Path, int], list[str]]:
    """Open a page in a frame of a width [px] and return where text lies over text, or is cut off."""

    def find(page: Path, width: int) -> list[str]:
        script = Path(__file__).with_name("text_boxes.js").read_text(encoding="utf-8")
        text = page.read_text(encoding="utf-8").replace("</body>", f"<script>{script}</script></body>")
        (tmp_path / "inner.html").write_text(text, encoding="utf-8")
        frame = tmp_path / f"frame_{width}.html"
        frame.write_text(
            f"<!DOCTYPE html><iframe src='inner.html' width={width} height=900></iframe><pre id=found></pre>"
            "<script>addEventListener('message', (event) =>"
            " { document.getElementById('found').textContent = JSON.stringify(event.data); });</script>",
            encoding="utf-8",
        )
        elements, errors = open_page(browser, frame, tmp_path / "browser", "--window-size=1400,1000")
        said = re.search(r'<pre id="found">(.*?)</pre>', elements, re.DOTALL)
        assert said is not None
        assert errors == []
        result = json.loads(html.unescape(said[1]))
        assert result["texts"] > 10
        assert not [button for button in result["buttons"] if "Share" in button], "a page keeps its data"
        return [str(line) for line in result["found"]]

    return find


@pytest.fixture(scope="session")
def read_video() -> Callable[[Path], tuple[Any, float]]:
    """Return a function that reads an mp4 file back: pictures (n, height, width, 3) and frames per second."""

    def read(path: Path) -> tuple[Any, float]:
        # imageio forgets to close a pipe of its own reader; the warning is let go here, where it arises.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            frames, fps = iio.imread(path), iio.immeta(path)["fps"]
            gc.collect()
        return frames, fps

    return read
