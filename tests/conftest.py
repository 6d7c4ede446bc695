"""Fixtures and settings that every test shares."""

import contextlib
import gc
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
os.fsync = lambda handle: None  # noqa: ARG005

# Before any test imports mujoco, which picks its graphics library then. Without one, only drawing is amiss.
with contextlib.suppress(BackendError):
    use_backend()

# Deterministic: the same examples on every machine and run, and no verdict that depends on its speed.
settings.register_profile("deterministic", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("deterministic")


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


@pytest.fixture
def draw_page(tmp_path: Path) -> Callable[[Path], tuple[int, int, list[str]]]:
    """Open a page in a headless browser without network; skip without a browser.

    What it returns takes a page and returns how many figures it has, how many were drawn, and what the
    console said of errors. CI installs a browser: there the test must run, and fails without one.
    """
    names = ("chromium", "chromium-browser", "google-chrome")
    browser = next(filter(None, map(shutil.which, names)), None)
    if browser is None and not os.environ.get("CI"):
        pytest.skip("no chromium here to open the page with")
    assert browser is not None

    def draw(page: Path) -> tuple[int, int, list[str]]:
        done = subprocess.run(
            [browser, "--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND",
             "--enable-logging=stderr", "--v=0", f"--user-data-dir={tmp_path / 'browser'}",
             "--virtual-time-budget=20000", "--dump-dom", page.as_uri()],
            capture_output=True, text=True, timeout=240, check=False,
        )  # fmt: skip
        figures = page.read_text(encoding="utf-8").count('class="plotly-graph-div"')
        drawn = len(re.findall(r'<div class="[^"]*svg-container', done.stdout))
        return (
            figures,
            drawn,
            [line for line in done.stderr.splitlines() if ":CONSOLE" in line and "rror" in line],
        )

    return draw


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
