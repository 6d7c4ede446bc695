"""Fixtures and settings that every test shares."""

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import settings

from mecanum_env.errors import BackendError
from mecanum_env.model import Model, paper_model
from mecanum_env.rendering.backend import use_backend

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
