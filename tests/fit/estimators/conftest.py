"""Runs with known truth."""

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.fit.estimators import WheelRun
from sysid.studies.synthetic import step_runs


@pytest.fixture
def noisy_runs(paper: Model) -> list[WheelRun]:
    """Steps of the paper's law, 3 repeats, 0.5 rpm noise, 1 rpm rounding."""
    return step_runs(paper.wheel.law, np.random.default_rng(0))


@pytest.fixture
def exact_runs(paper: Model) -> list[WheelRun]:
    """Steps of the paper's law without noise or rounding."""
    return step_runs(paper.wheel.law, np.random.default_rng(0), noise_rpm=0.0, quantum_rpm=0.0, repeats=1)
