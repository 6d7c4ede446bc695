"""The gap workflow on recordings of real robots; skipped where they are not there."""

from pathlib import Path

import pytest

from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.analyse import analyse
from sysid.gap.records import GapOptions
from sysid.logs import read_dataset


@pytest.mark.slow
def test_files_with_different_controllers_get_no_name(real_logs: Path) -> None:
    """No law and no effect fits files that were each recorded with other controller settings."""
    data = read_dataset(real_logs / "micromouse/closed_loop_left")
    model = fitted_model(fit_dataset(data, FitOptions(starts=1)))
    report = analyse(data, model, GapOptions(max_effects=2, next_experiment=False))
    assert report.effects == ()
    assert report.gap.after == report.gap.before
    assert any("fitted to these very logs" in note for note in report.notes)
