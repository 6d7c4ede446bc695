"""What is inferred about the way from a logged command to the law."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.fit.command_path import infer_command_path
from sysid.logs import BenchCommand, Dataset


def test_the_robots_own_path_is_the_default(bench: Callable[..., Dataset]) -> None:
    path = infer_command_path(bench())
    assert (path.command_period_s, path.quantum_rpm, path.saturation_rpm) == (0.1, 1.0, 135.0)
    assert path.sample_period_s == pytest.approx(1 / 120)
    assert path.latched
    assert not path.notes


def test_fractional_commands_are_not_rounded(bench: Callable[..., Dataset]) -> None:
    data = bench()
    runs = [replace(r, command=BenchCommand(r.command.wheels_rpm[:, 0] + 0.25)) for r in data.runs]
    path = infer_command_path(replace(data, runs=tuple(runs)))
    assert path.quantum_rpm == 0.0
    assert any("not whole rpm" in note for note in path.notes)


def test_fast_commands_in_one_run_set_the_period(bench: Callable[..., Dataset]) -> None:
    slow = bench()
    fast = bench(hold_s=0.025, rate_hz=400.0, offset_s=1e-6).runs[0]
    path = infer_command_path(replace(slow, runs=(*slow.runs, fast)))
    assert path.command_period_s == pytest.approx(0.025)
    assert path.sample_period_s == pytest.approx(0.025 / 3)
    assert any("faster than 0.1 s" in note for note in path.notes)


def test_commands_on_the_rows_of_the_log_are_latched_there(bench: Callable[..., Dataset]) -> None:
    path = infer_command_path(bench(rate_hz=20.0, hold_s=0.45))
    assert path.latched
    assert path.command_period_s == pytest.approx(0.05)


def test_commands_off_any_clock_act_when_they_are_stamped(bench: Callable[..., Dataset]) -> None:
    path = infer_command_path(bench(offset_s=0.043, rate_hz=1000.0))
    assert not path.latched
    assert path.command_period_s == path.sample_period_s == pytest.approx(1 / 120)


def test_a_ceiling_is_not_assumed_below_speeds_that_were_reached(bench: Callable[..., Dataset]) -> None:
    path = infer_command_path(bench(largest_rpm=300.0, ceiling_rpm=np.inf))
    assert path.saturation_rpm == np.inf


@pytest.mark.parametrize("period", [-0.1, 0.0, np.inf])
def test_an_impossible_period_is_refused(bench: Callable[..., Dataset], period: float) -> None:
    with pytest.raises(InputError, match="must be above 0"):
        infer_command_path(bench(), command_period_s=period)


def test_a_law_slower_than_the_commands_is_refused(bench: Callable[..., Dataset]) -> None:
    with pytest.raises(InputError, match="would miss commands"):
        infer_command_path(bench(), sample_period_s=0.2)


@pytest.mark.parametrize(
    ("rate_hz", "period_s"), [(200.0, 1 / 120), (100.0, 1 / 120), (60.0, 1 / 120), (50.0, 0.02)]
)
def test_the_law_ticks_no_faster_than_the_log_can_show(
    bench: Callable[..., Dataset], rate_hz: float, period_s: float
) -> None:
    path = infer_command_path(bench(rate_hz=rate_hz))
    assert path.sample_period_s == pytest.approx(period_s)
    assert any("samples come every" in note for note in path.notes) == (period_s > 1 / 120)
