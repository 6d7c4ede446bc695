"""A study of bench logs names a link that jitters or loses commands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator.bench import bench_motion
from sysid.compare.links import AlignedLogs, LinkClock, LinkDelays, LinkFault, link_delays, link_fault
from sysid.gap import link_faults
from sysid.gap.link_faults import with_link_fault
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run

QUIET = GapOptions(next_experiment=False, max_effects=1)
PERIOD_S = 0.1
DELAY_S, JITTER_S, SHARE = 0.1, 0.04, 0.25
SEEDS = (1, pytest.param(2, marks=pytest.mark.slow))


def logs(kind: str, seed: int, commands: int | None = None, share: float = SHARE) -> Dataset:
    """Return runs of steps through a steady link, or one that jitters or loses a share of the commands.

    Logs with the same seed of the `commands` repeat each other.
    """
    model: Model = paper_model()
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 240.0))
    rng, runs = np.random.default_rng(seed), []
    for index in range(8):
        time = np.arange(0.0, 6.0, 0.02)
        given = np.arange(0.5, 5.5, 1.0)
        drawn = rng if commands is None else np.random.default_rng((commands, index))
        levels = np.append(0.0, drawn.choice([-1, 1], given.size) * drawn.integers(30, 110, given.size))
        late = np.zeros(given.size)
        if kind == "jitter":
            late = DELAY_S + JITTER_S * rng.uniform(-1.0, 1.0, given.size) * np.sqrt(3.0)
        if kind == "loss":
            late = PERIOD_S * (rng.geometric(1.0 - share, given.size) - 1)
        clock, true = bench_motion(fine, np.append(0.0, given + late), levels, float(time[-1]))
        speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
        command = levels[np.searchsorted(given, time + 1e-9, side="right")]
        split = ("fit", "fit", "validation", "test")[index % 4]
        runs.append(Run(f"r{index}", f"g{index}", split, time, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("link", tuple(runs), (), f"{kind} {seed}")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_jitter_is_named_with_its_size(seed: int) -> None:
    report = analyse(logs("jitter", seed), paper_model(), replace(QUIET, fitted_on=logs("steady", 9)))
    assert report.verdict == "named"
    (found,) = report.effects
    assert (found.name, found.since) == ("command_latency/jitter", "new")
    assert found.parameters["jitter_s"].low < JITTER_S < found.parameters["jitter_s"].high
    assert found.parameters["delay_s"].low < DELAY_S < found.parameters["delay_s"].high
    assert report.gap.after < 0.5 * report.gap.before


@pytest.mark.parametrize("seed", SEEDS)
def test_lost_commands_are_named_with_their_share(seed: int) -> None:
    report = analyse(logs("loss", seed), paper_model(), replace(QUIET, fitted_on=logs("steady", 9)))
    (found,) = report.effects
    assert found.name == "command_loss"
    assert found.parameters["share"].low < SHARE < found.parameters["share"].high


def test_a_loss_that_may_be_a_jitter_is_told_as_either(monkeypatch: pytest.MonkeyPatch) -> None:
    def either(*given: Any) -> LinkFault | None:
        found = link_fault(*given)
        return None if found is None else replace(found, rival="jitter")

    monkeypatch.setattr(link_faults, "link_fault", either)
    report = analyse(logs("loss", 1), paper_model(), replace(QUIET, fitted_on=logs("steady", 9)))
    assert report.verdict == "ambiguous"
    assert report.candidates == (("command_loss",), ("command_latency",))
    assert [found.name for found in report.effects] == ["command_loss"]
    assert any("or each acts at a time of its own" in note for note in report.notes)


def test_lost_commands_are_no_gap_where_the_logs_of_the_fit_may_have_as_many() -> None:
    """Two of forty are lost for sure, but none of forty before says little."""
    lossy, steady = logs("loss", 25, commands=3, share=0.06), logs("steady", 9, commands=4)
    report = analyse(lossy, paper_model(), replace(QUIET, fitted_on=steady))
    assert (report.verdict, report.effects, report.candidates) == ("no_gap", (), ())
    assert report.gap.after == report.gap.before
    assert dict(report.model.effects) == {}
    assert any("may have lost as many" in note for note in report.notes)
    alone = analyse(lossy, paper_model(), QUIET)
    assert [(found.name, found.since) for found in alone.effects] == [("command_loss", "unknown")]


def test_more_lost_commands_than_the_logs_of_the_fit_allow_are_new() -> None:
    lossy, steady = logs("loss", 1, commands=3), logs("steady", 9, commands=4)
    report = analyse(lossy, paper_model(), replace(QUIET, fitted_on=steady))
    assert [(found.name, found.since) for found in report.effects] == [("command_loss", "new")]
    assert not any("may have lost as many" in note for note in report.notes)


def test_a_steady_link_is_not_named() -> None:
    report = analyse(logs("steady", 1), paper_model(), replace(QUIET, fitted_on=logs("steady", 9)))
    assert report.verdict == "no_gap"


@dataclass
class Again:
    """The study of the logs with their changes moved, and what the best set leaves of the squared error.

    The model alone leaves 100, and moving the changes 4.
    """

    model: Model
    best: Model
    report: GapReport
    left: float
    asked: bool = False

    def __call__(self, *_: object) -> GapReport:
        self.asked = True
        return self.report

    def squares(self, _dataset: Dataset, under: Model) -> float:
        return 100.0 if under is self.model else self.left if under is self.best else 4.0


@pytest.mark.parametrize(("left", "is_asked"), [(5.0, False), (50.0, True)])
def test_a_loss_is_not_named_where_the_best_set_needs_none(
    monkeypatch: pytest.MonkeyPatch, left: float, is_asked: bool
) -> None:
    """The set may be too close to the model's own error for a name; the changes acted in time beside it.

    A set that leaves far more than the moved changes do says nothing against the fault.
    """
    dataset, steady, model = logs("loss", 1), logs("steady", 1), paper_model()
    best = model.with_effect("viscous_friction", damping_n_m_s_rad=0.1)

    def delays(under: Model, runs: tuple[Run, ...], clock: LinkClock) -> LinkDelays:
        return link_delays(under, steady.runs if under is best else runs, clock)

    options = replace(QUIET, fitted_on=logs("steady", 9))
    again = Again(model, best, replace(analyse(steady, model, options), verdict="no_gap"), left)
    monkeypatch.setattr(link_faults, "link_delays", delays)
    monkeypatch.setattr(link_faults, "_squares", again.squares)
    found = with_link_fault(dataset, model, options, again.report, best, again)
    assert again.asked is is_asked
    assert (found is again.report) is not is_asked


@pytest.mark.parametrize(("left", "is_asked"), [(1.0, False), (9.0, True)])
def test_a_fault_is_not_named_beside_effects_that_leave_less_than_it_does(
    monkeypatch: pytest.MonkeyPatch, left: float, is_asked: bool
) -> None:
    """A slow answer looks like a late one: the delays of single changes differ under the best set, too."""
    dataset, model = logs("jitter", 1), paper_model()
    best = model.with_effect("sensor_lowpass", time_constant_s=0.01)
    options = replace(QUIET, fitted_on=logs("steady", 9))
    again = Again(model, best, replace(analyse(logs("steady", 1), model, options), verdict="named"), left)
    monkeypatch.setattr(link_faults, "_squares", again.squares)
    with_link_fault(dataset, model, options, again.report, best, again)
    assert again.asked is is_asked


def test_a_few_lost_commands_show_beside_a_larger_error_of_the_model() -> None:
    """What the logs of the fit show in the same commands is the model's, not a delay of single changes."""
    model = paper_model().with_effect("speed_gain", gain=0.7)
    before = logs("steady", 9, commands=7)
    same = replace(before, runs=before.runs + logs("steady", 8, commands=7).runs)
    report = analyse(logs("loss", 1, commands=7, share=0.1), model, replace(QUIET, fitted_on=same))
    assert "command_loss" in [found.name for found in report.effects]


def test_a_model_that_loses_commands_is_compared_with_the_changes_where_they_acted() -> None:
    model = paper_model().with_effect("command_loss", share=SHARE)
    late = AlignedLogs.stated(logs("loss", 3), model)
    assert late is not None
    assert "command_loss" not in late.model.effects
    report = analyse(logs("loss", 3), model, QUIET)
    assert report.verdict == "no_gap"
    assert report.model.effects["command_loss"] == {"share": SHARE}
