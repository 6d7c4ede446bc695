"""What is inferred about the way from a logged command to the law."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from sysid.fit.drive import infer_command_path, wheel_run
from sysid.fit.drive.choice import choose_clock
from sysid.fit.drive.command_path import CommandPath
from sysid.logs import BenchCommand, Dataset

LAW = paper_model().wheel.law


def test_the_robots_own_path_is_the_default(bench: Callable[..., Dataset]) -> None:
    path = infer_command_path(bench())
    assert (path.command_period_s, path.quantum_rpm, path.saturation_rpm) == (0.1, 1.0, 135.0)
    assert path.sample_period_s == pytest.approx(1 / 120)
    assert path.latched
    assert not path.notes


@pytest.mark.parametrize("rate_hz", [64.0, 100.0, 120.0])
def test_uneven_stamps_leave_the_clock_and_the_law(bench: Callable[..., Dataset], rate_hz: float) -> None:
    rng = np.random.default_rng(1)
    data = bench(rate_hz=1200.0)
    runs = []
    for run in data.runs:
        # Rows of a fine log that come at uneven times: each shows the command and the speed of its moment.
        wanted = np.arange(1.0, run.duration_s * rate_hz) + rng.uniform(
            -0.3, 0.3, int(run.duration_s * rate_hz - 1e-9)
        )
        rows = np.concatenate([[0], np.unique(np.rint(1200.0 / rate_hz * wanted).astype(int))])
        rows = rows[rows < run.time_s.size]
        command = BenchCommand(run.command.wheels_rpm[rows, 0])
        channels = {"speed_rpm": run.channels["speed_rpm"][rows]}
        runs.append(replace(run, time_s=run.time_s[rows], command=command, channels=channels))
    uneven = replace(data, runs=tuple(runs))
    path = infer_command_path(uneven)
    assert path.latched
    assert path.command_period_s == 0.1
    for run in uneven.runs:
        got = wheel_run(run, "wheel", path, 0.3)
        assert got is not None
        residual = got.speed_rpm - np.interp(
            got.sample_tick, np.arange(len(got.command_rpm) + 1), LAW.simulate(got.command_rpm)
        )
        assert np.std(residual) < 0.4


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


@dataclass(frozen=True)
class CostsByPeriod:
    """A search of which only the costs with the commands as stamped and on the robot's clock are known."""

    path: CommandPath
    costs: tuple[float, float]

    def run(self, _data: object) -> SimpleNamespace:
        return SimpleNamespace(cost=self.costs[self.path.command_period_s == 0.1])


@pytest.mark.parametrize(("cost", "period_s"), [(0.8, 0.02), (0.4, 0.1)])
def test_the_robots_clock_is_believed_where_it_halves_the_squared_error(
    bench: Callable[..., Dataset], cost: float, period_s: float
) -> None:
    """Where a law cannot follow a drive, a clock that is wrong may do a little better by chance."""
    path = CommandPath(0.01, 0.02, 1.0, 135.0, seek_ceiling=False, latched=True, notes=())
    search: Any = CostsByPeriod(path, (1.0, cost))
    chosen, _, _, note = choose_clock(bench(), search, {"speed_rpm": 0.5}, given=False)
    assert chosen.path.command_period_s == period_s
    assert (note is None) == (period_s == 0.02)
