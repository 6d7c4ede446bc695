"""Fixtures and settings that every test shares."""

import contextlib

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
