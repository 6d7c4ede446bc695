"""New runs exchanged with those of the fit: what chance does to a comparison in which nothing changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Exchange, Whitener, repeated_commands
from sysid.compare.model_error.exchange import NewBlock, places_of
from sysid.compare.model_error.series import Series
from sysid.compare.predicted import SimulationSettings
from sysid.logs import BenchCommand, Dataset, Run

MODEL = paper_model()
WHEEL = MODEL.with_effect("sensor_lowpass", time_constant_s=0.03)
"""It is not the model's."""


def logs(
    seed: int, repeats: int, sequences: int = 4, gain: float = 1.0, late_s: float = 0.0, step_rpm: float = 0.0
) -> Dataset:
    """Return noisy runs of the wheel, with stamps that are late by up to `late_s`, or speeds in steps."""
    rng, runs, time = np.random.default_rng(seed), [], np.arange(0.0, 1.5, 0.01)
    for number in range(sequences):
        levels = np.random.default_rng(100 + number).integers(-100, 100, 4).astype(float)
        command = levels[np.minimum((time / 0.4).astype(int), 3)]
        for repeat in range(repeats):
            stamps = time + np.append(0.0, rng.uniform(0.0, late_s, time.size - 1))
            speed = gain * replay_bench(WHEEL, time, command, sample_times_s=stamps)
            speed += 0.5 * rng.standard_normal(time.size)
            if step_rpm:
                speed = step_rpm * np.floor(speed / step_rpm + rng.random())
            name = f"{number}_{repeat}.csv"
            runs.append(Run(name, f"{number}", "fit", stamps, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("wheel", tuple(runs), (), f"{seed}")


def compared(nominal: Dataset, new: Dataset) -> tuple[ResidualProblem, Exchange]:
    found = repeated_commands(MODEL, nominal, observe(new), SimulationSettings())
    assert found is not None
    whitener = Whitener(found.observations, found.noise, None)
    problem = ResidualProblem(MODEL, whitener, SimulationSettings(), None, found)
    assert problem.exchange is not None
    return problem, problem.exchange


def costs(problem: ResidualProblem, exchange: Exchange, draws: int = 2000) -> FloatArray:
    residual = problem.marginal(problem.base_residual)
    nothing = np.zeros((problem.size, 0))
    return exchange.drawn(np.random.default_rng(0), draws, residual, nothing)[1]


@pytest.mark.parametrize("late_s", [0.0, 0.003])
def test_the_runs_of_one_sequence_have_as_many_labellings_as_new_ones_can_be_chosen(late_s: float) -> None:
    _, exchange = compared(logs(1, 3, late_s=late_s), logs(2, 2, late_s=late_s))
    assert exchange.labellings == 10**4


def test_the_true_labelling_has_the_true_cost() -> None:
    problem, exchange = compared(logs(1, 3, sequences=2), logs(2, 1, sequences=2, gain=1.1))
    drawn = costs(problem, exchange)
    # Of two sequences with four labellings each, one of sixteen is the true one.
    true = float(np.sum(problem.marginal(problem.base_residual) ** 2))
    assert np.isclose(drawn.max(), true)
    assert 0.03 < np.mean(np.isclose(drawn, true)) < 0.1


@pytest.mark.parametrize("late_s", [0.0, 0.003])
def test_what_changed_is_in_few_draws_in_its_full_size(late_s: float) -> None:
    problem, exchange = compared(logs(1, 3, late_s=late_s), logs(2, 3, gain=1.05, late_s=late_s))
    true = float(np.sum(problem.marginal(problem.base_residual) ** 2))
    drawn = costs(problem, exchange)
    assert np.mean(drawn >= 0.999 * true) < 0.005
    assert np.median(drawn) < 0.5 * true


@pytest.mark.parametrize(("late_s", "step_rpm"), [(0.0, 0.0), (0.003, 0.0), (0.0, 4.0)])
def test_where_nothing_changed_all_labellings_are_alike(late_s: float, step_rpm: float) -> None:
    shares = []
    for seed in range(20):
        before, after = (logs(10 * seed + k, 3, late_s=late_s, step_rpm=step_rpm) for k in (1, 2))
        problem, exchange = compared(before, after)
        true = float(np.sum(problem.marginal(problem.base_residual) ** 2))
        shares.append(np.mean(costs(problem, exchange, 500) >= true))
    # Uniform shares have the mean 1/2 with a standard deviation of .065. Where stamps differ, a run that
    # stands for one of the fit is not smoothed in its own place, so that draws cost a little more.
    assert 0.3 < np.mean(shares) < (1.0 if late_s else 0.7)
    assert min(shares) > 0.001


def test_repeats_beside_other_runs_of_the_fit_are_not_exchanged() -> None:
    before, after = logs(1, 3, late_s=0.003), logs(2, 2, late_s=0.003)
    found = repeated_commands(MODEL, before, observe(after), SimulationSettings())
    assert found is not None
    blocks = [
        NewBlock(block, block.value[None], (Series(block.time_s, block.value, block.weight),), files, 0.0)
        for block, files in zip(found.observations.blocks, [("a",), ("b",)] * 4, strict=True)
    ]
    assert places_of(found.observations, blocks) == ()
    alike = [replace(block, files=("a",)) for block in blocks]
    assert len(places_of(found.observations, alike)) == len(blocks)


def test_projections_are_those_of_the_residual() -> None:
    problem, exchange = compared(logs(1, 1 + 1, sequences=2), logs(2, 1, sequences=2, gain=1.1))
    residual = problem.marginal(problem.base_residual)
    columns = np.random.default_rng(3).standard_normal((problem.size, 3))
    projected, drawn = exchange.drawn(np.random.default_rng(0), 200, residual, columns)
    truth = np.isclose(drawn, float(residual @ residual))
    np.testing.assert_allclose(projected[truth], np.tile(residual @ columns, (truth.sum(), 1)))
    assert truth.any()


def test_a_run_that_differs_from_its_repeats_as_none_before_is_not_alike() -> None:
    before, after = logs(1, 3), logs(2, 3)
    assert compared(before, after)[1].alike
    first = after.runs[0]
    odd = replace(first, channels={"speed_rpm": first.channels["speed_rpm"] + 20.0 * (first.time_s > 1.3)})
    assert not compared(before, replace(after, runs=(odd, *after.runs[1:])))[1].alike
    assert compared(replace(before, runs=(odd, *before.runs[1:])), after)[1].alike
