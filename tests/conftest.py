"""Fixtures and settings that every test shares."""

import pytest
from hypothesis import settings

from mecanum_env.model import Model, paper_model

# Deterministic: the same examples on every machine and run, and no verdict that depends on its speed.
settings.register_profile("deterministic", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("deterministic")


@pytest.fixture
def paper() -> Model:
    """Return the packaged model of the paper."""
    return paper_model()
