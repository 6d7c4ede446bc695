"""The recordings of real robots fit without hand-holding; skipped where they are not there."""

from pathlib import Path

import numpy as np
import pytest

from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import read_dataset

FAST = ("micromouse/closed_loop_left",)
SLOW = (
    "micromouse/closed_loop_right",
    "husky/left",
    "husky/right",
    "husky/body",
    "micromouse/duty_left",
    "micromouse/duty_right",
)


@pytest.mark.parametrize("name", [*FAST, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_a_real_log_becomes_a_stable_model(real_logs: Path, name: str) -> None:
    fit = fit_dataset(read_dataset(real_logs / name), FitOptions(starts=1))
    assert fitted_model(fit).wheel.law.is_stable
    assert not fit.sigma_from_repeats
    assert any("no repeats" in note for note in fit.notes)
    # What one linear law misses is reported, not hidden.
    assert not fit.residual_tests.whiteness.passed
    errors = fit.methods["output-error"].errors
    assert set(errors) == {"fit", "validation", "test"}
    for split, figures in errors.items():
        speeds = np.concatenate([r.speed_rpm for wheel in fit.runs[split].values() for r in wheel])
        assert figures.rms_rpm < np.sqrt(np.mean(speeds**2))


@pytest.mark.slow
def test_held_samples_of_the_husky_count_half(real_logs: Path) -> None:
    sure = fit_dataset(read_dataset(real_logs / "husky/left"), FitOptions(starts=1)).uncertainty
    assert sure.effective_samples / sure.samples == pytest.approx(0.5, abs=0.03)
