"""A study of a wheel on the bench that was sent the commands of the fit again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem, base_fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Moved, RepeatedCommands, Whitener, repeated_commands
from sysid.compare.predicted import SimulationSettings
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.search.chance import chance_gains
from sysid.gap.search.responses import responses
from sysid.gap.search.sets import EMPTY
from sysid.gap.search.study_data import study_data
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, Run
from tests.gap.conftest import NOISE_RPM, MakeLogs

Recorded = tuple[Dataset, Model]


def noisy(logs: Dataset, seed: int, jitter_s: float = 0.0) -> Dataset:
    """Return logs with noise of their own, each change of command up to `jitter_s` late in its own way."""
    rng = np.random.default_rng(seed)

    def run_with(run: Run) -> Run:
        changes = run.command_changes()[0]
        late = jitter_s * rng.random(len(changes) + 1)[np.searchsorted(changes, run.time_s, side="right")]
        speed = np.interp(run.time_s - late, run.time_s, run.channels["speed_rpm"])
        return replace(run, channels={"speed_rpm": speed + NOISE_RPM * rng.standard_normal(run.time_s.size)})

    return replace(logs, runs=tuple(map(run_with, logs.runs)), sha256=f"seed {seed}")


@pytest.fixture(scope="module")
def wheel(base: Model) -> Model:
    """Return a wheel that lags behind the model by more than the noise."""
    return base.with_effect("sensor_lowpass", time_constant_s=0.02)


@pytest.fixture(scope="module")
def nominal(bench_logs: MakeLogs, wheel: Model) -> Dataset:
    return noisy(bench_logs(wheel, noise_rpm=0.0), seed=1)


@pytest.fixture(scope="module")
def again(bench_logs: MakeLogs, wheel: Model) -> Dataset:
    return noisy(bench_logs(wheel, noise_rpm=0.0), seed=2)


@pytest.fixture(scope="module")
def weaker(bench_logs: MakeLogs, wheel: Model) -> Dataset:
    return noisy(bench_logs(wheel.with_effect("speed_gain", gain=0.995), noise_rpm=0.0), seed=3)


def study(new: Dataset, nominal: Dataset, base: Model) -> GapReport:
    only = ("speed_gain", "sensor_lowpass", "coulomb_friction")
    return analyse(new, base, GapOptions(fitted_on=nominal, only=only, max_effects=2, next_experiment=False))


def of_own_gains(logs: Dataset, seed: int, spread: float = 0.05) -> Dataset:
    """Return logs in each run of which the wheel has another gain, with a standard deviation of `spread`."""
    rng = np.random.default_rng(seed)

    def run_with(run: Run) -> Run:
        gain = 1.0 + spread * rng.standard_normal()
        return replace(run, channels={"speed_rpm": gain * run.channels["speed_rpm"]})

    return replace(logs, runs=tuple(map(run_with, logs.runs)))


def with_glitch(logs: Dataset, file: str) -> Dataset:
    """Return logs in one run of which the wheel was off for a moment."""

    def run_with(run: Run) -> Run:
        speed = run.channels["speed_rpm"] + 40.0 * ((run.time_s > 0.5) & (run.time_s < 0.6))
        return replace(run, channels={"speed_rpm": speed}) if run.file == file else run

    return replace(logs, runs=tuple(map(run_with, logs.runs)))


def compared(new: Dataset, nominal: Dataset, base: Model) -> tuple[ResidualProblem, RepeatedCommands]:
    found = repeated_commands(base, nominal, observe(new), SimulationSettings())
    assert found is not None
    whitener = Whitener(found.observations, found.noise, None)
    return ResidualProblem(base, whitener, SimulationSettings(), None, found), found


def test_an_error_that_the_logs_of_the_fit_show_in_the_same_commands_is_no_gap(
    again: Dataset, nominal: Dataset, base: Model
) -> None:
    report = study(again, nominal, base)
    assert report.verdict == "no_gap"
    assert any("command by command" in note for note in report.notes)


def test_a_change_far_below_the_error_of_the_model_is_named(
    weaker: Dataset, nominal: Dataset, base: Model
) -> None:
    report = study(weaker, nominal, base)
    assert [found.name for found in report.effects] == ["speed_gain"]
    assert abs(report.effects[0].parameters["gain"].value - 0.995) < 0.002
    assert report.effects[0].since == "new"


def test_what_varies_from_run_to_run_hides_no_other_effect(
    again: Dataset, nominal: Dataset, base: Model
) -> None:
    new, before = of_own_gains(again, seed=6), of_own_gains(nominal, seed=7)
    problem, found = compared(new, before, base)
    library = responses(problem, ["speed_gain", "command_latency"])

    def threshold(beside: RepeatedCommands) -> float:
        """Return what chance gains in these logs."""
        problem = ResidualProblem(base, whitener, SimulationSettings(), None, beside)
        own = [replace(r, change=problem.marginal(r.change)) for r in library]
        rng = np.random.default_rng(0)
        return chance_gains(problem, base_fit(problem, EMPTY), own, rng).threshold()

    whitener = problem.whitener
    effects = [Moved(one.change, one.chosen.model(base, one.place), smooth=True) for one in library]
    varying = found.with_varying(whitener, effects)
    assert threshold(found) > 1.2 * threshold(varying)
    assert study(new, before, base).verdict == "no_gap"


def test_what_was_random_in_the_logs_of_the_fit_is_no_news(
    again: Dataset, nominal: Dataset, base: Model
) -> None:
    new = of_own_gains(again, seed=6, spread=0.3)

    def is_repeatable(before: Dataset) -> bool:
        return study_data(new, base, GapOptions(fitted_on=before)).floor.repeatable

    assert is_repeatable(of_own_gains(nominal, seed=8, spread=0.3))
    assert not is_repeatable(nominal)


def test_what_a_single_run_shows_and_its_repeats_do_not_is_no_gap(
    bench_logs: MakeLogs, wheel: Model, base: Model
) -> None:
    # With stamps of its own each repeat is compared alone.
    uneven = bench_logs(wheel, noise_rpm=0.0, late_s=0.004)
    nominal, new = noisy(uneven, seed=4), with_glitch(noisy(uneven, seed=5), "run1_1.csv")
    report = study(new, nominal, base)
    assert report.verdict == "no_gap"
    assert any(note.startswith("run1_1.csv differs from its repeats") for note in report.notes)
    twice = with_glitch(with_glitch(new, "run0_2.csv"), "run2_0.csv")
    assert study(twice, nominal, base).verdict == "unexplained"


def test_a_single_odd_run_hides_no_change(bench_logs: MakeLogs, wheel: Model, base: Model) -> None:
    changed = wheel.with_effect("speed_gain", gain=0.95)
    before, after = (bench_logs(one, noise_rpm=0.0, late_s=0.004) for one in (wheel, changed))
    report = study(with_glitch(noisy(after, seed=5), "run1_1.csv"), noisy(before, seed=4), base)
    assert [found.name for found in report.effects] == ["speed_gain"]
    assert any(note.startswith("run1_1.csv differs from its repeats") for note in report.notes)


def test_chance_gains_no_less_than_logs_show_in_which_nothing_changed(
    again: Dataset, nominal: Dataset, base: Model
) -> None:
    problem, _ = compared(again, nominal, base)
    library = responses(problem, ["speed_gain", "command_latency"])

    def threshold() -> float:
        rng = np.random.default_rng(0)
        return chance_gains(problem, base_fit(problem, EMPTY), library, rng).threshold()

    problem.exchange = None
    once = threshold()
    problem.unchanged = 5.0 * problem.unchanged
    assert threshold() > 5.0 * once


def test_chance_gains_no_less_than_runs_do_that_are_exchanged(
    again: Dataset, nominal: Dataset, base: Model
) -> None:
    new, before = of_own_gains(again, seed=6), of_own_gains(nominal, seed=7)
    problem, _ = compared(new, before, base)
    library = responses(problem, ["speed_gain", "command_latency"])

    def p_of_best() -> float:
        """Return how probable the gain of another gain is by chance."""
        fitted, rng = base_fit(problem, EMPTY), np.random.default_rng(0)
        change = next(one.change for one in library if one.effect == "speed_gain")
        gain = float(fitted.residual @ change) ** 2 / float(change @ change)
        return chance_gains(problem, fitted, library, rng).p_value(gain)

    exchanged = p_of_best()
    problem.exchange, problem.unchanged = None, np.zeros((problem.size, 0))
    assert p_of_best() < 0.001
    assert exchanged > 0.01


@pytest.mark.parametrize(("seed", "step_rpm"), [(150, 6.0), (170, 10.0), (150, 25.0)])
def test_the_steps_of_an_encoder_are_no_gap(
    bench_logs: MakeLogs, base: Model, wheel: Model, seed: int, step_rpm: float
) -> None:
    def counted(seed: int) -> Dataset:
        """Return logs of an encoder with a phase of its own in each run."""
        logs, rng = bench_logs(wheel, noise_rpm=0.0), np.random.default_rng(seed)
        runs = (
            replace(
                r, channels={"speed_rpm": step_rpm * np.floor(r.channels["speed_rpm"] / step_rpm + phase)}
            )
            for r, phase in zip(logs.runs, rng.random(len(logs.runs)), strict=True)
        )
        return replace(logs, runs=tuple(runs), sha256=f"seed {seed}")

    # Normal noise of the same size would make each of these a gap, with p from 0 to 0.007.
    assert study(counted(seed + 1), counted(seed), base).verdict == "no_gap"


def test_repeats_that_act_at_other_times_are_noise_of_timing(
    bench_logs: MakeLogs, wheel: Model, base: Model
) -> None:
    still = bench_logs(wheel, noise_rpm=0.0)
    problem, found = compared(noisy(still, 6, jitter_s=0.03), noisy(still, 7, jitter_s=0.03), base)
    assert 0.004 < found.noise.timing["speed_rpm"].delay_s < 0.02
    assert 0.7 < float(np.mean(problem.base_residual**2)) < 1.5
