"""What it costs a set that nobody knows where in a gap its runs start."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import MIDDLE, START_PRICE, simulator
from sysid.logs import BenchCommand, Dataset, Run

TIME = np.arange(0.0, 2.0, 0.01)
COMMAND = np.where(TIME < 0.2, 0.0, 60.0)
RUNS = 5


@pytest.fixture(scope="module")
def problem() -> ResidualProblem:
    """Return the problem of the paper's wheel in logs of itself, with noise."""
    rng, speed = np.random.default_rng(1), replay_bench(paper_model(), TIME, COMMAND)
    runs = [
        Run(
            f"{i}.csv",
            "a",
            "fit",
            TIME,
            BenchCommand(COMMAND),
            {"speed_rpm": speed + rng.normal(size=TIME.size)},
        )
        for i in range(RUNS)
    ]
    # Stamps of their own: each run is compared by itself.
    runs = [Run(**{**vars(run), "time_s": TIME + 1e-4 * i}) for i, run in enumerate(runs)]
    logs = Dataset("logs", tuple(runs), ())
    observations = observe(logs)
    return ResidualProblem(paper_model(), Whitener(observations, measure_noise(logs, observations), None))


def squares(problem: ResidualProblem, gap_deg: float, form: str = "coast") -> float:
    residual = problem.residual(paper_model().with_effect("backlash", form, gap_deg=gap_deg))
    assert residual is not None
    return float(residual @ residual)


def test_a_gap_that_changes_nothing_costs_the_price_of_a_start_for_each_run(problem: ResidualProblem) -> None:
    plain = float(problem.base_residual @ problem.base_residual)
    assert squares(problem, 1e-9) == pytest.approx(plain + RUNS * START_PRICE, rel=1e-6)


def test_starts_that_the_base_model_leaves_open_cost_nothing(problem: ResidualProblem) -> None:
    loose = paper_model().with_effect("backlash", gap_deg=2.0)
    of_loose = ResidualProblem(loose, problem.whitener)
    plain = problem.whitener.whiten(of_loose.simulators.full.predictions(loose))
    np.testing.assert_array_equal(of_loose.base_residual, of_loose.measured - plain)
    # Else a set that is without the gap would seem to explain what the base model paid.
    assert squares(problem, 2.0) == pytest.approx(
        float(np.sum(of_loose.base_residual**2)) + RUNS * START_PRICE
    )


def test_no_gap_and_one_with_an_elastic_filling_cost_nothing(problem: ResidualProblem) -> None:
    plain = float(problem.base_residual @ problem.base_residual)
    assert squares(problem, 0.0) == pytest.approx(plain, rel=1e-12)
    assert squares(problem, 1e-9, "spring") == pytest.approx(plain, rel=1e-6)


def test_what_a_gap_would_change_does_not_follow_what_was_measured(problem: ResidualProblem) -> None:
    loose, full, whiten = (
        paper_model().with_effect("backlash", gap_deg=20.0),
        problem.simulators.full,
        problem.whitener.whiten,
    )
    (change,) = problem.changes([loose], surrogate=False, reference=problem.base)
    assert change is not None
    plain, middle = (full.predictions(one, starts=MIDDLE) for one in (problem.base, loose))
    np.testing.assert_allclose(change, problem.marginal(whiten(plain) - whiten(middle)), atol=1e-9)
    shown = full.predictions(loose)
    assert any(np.max(np.abs(one - other)) > 1.0 for one, other in zip(shown, middle, strict=True))


def test_starts_that_are_chosen_do_not_pay_for_a_gap_that_is_not_there(problem: ResidualProblem) -> None:
    plain = float(problem.base_residual @ problem.base_residual)
    for gap_deg in (0.1, 0.5, 2.0):
        assert squares(problem, gap_deg) > plain


def test_near_a_model_the_starts_of_its_runs_are_held_and_not_looked_for_again(
    problem: ResidualProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    loose = paper_model().with_effect("backlash", gap_deg=20.0)
    near = problem.residual_near(loose)
    assert near is not None
    expected = problem.residual(loose)
    assert expected is not None
    assert np.any(np.array(problem.simulators.full.starts(loose)) != 0.0)
    monkeypatch.setattr(simulator, "motions_from_gap", None)
    found, faster = near(loose), near(loose.with_effect("speed_gain", gain=1.001))
    assert found is not None
    assert faster is not None
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert 0.0 < np.linalg.norm(faster - expected) < 0.1 * np.linalg.norm(expected)


def test_without_a_gap_there_is_nothing_to_hold(problem: ResidualProblem) -> None:
    assert problem.residual_near(paper_model()) is None
    assert problem.simulators.full.starts(paper_model()) is None


def test_the_place_in_a_gap_is_looked_for_once_whatever_phases_are_tried(
    problem: ResidualProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []
    search = simulator.motions_from_gap
    monkeypatch.setattr(simulator, "motions_from_gap", lambda *args: looked.append(1) or search(*args))
    model = paper_model().with_effect("backlash", gap_deg=7.0)
    model = model.with_effect("torque_ripple", per_turn=5.0, torque_n_m=0.8)
    assert problem.residual(model) is not None
    assert len(looked) == 1
