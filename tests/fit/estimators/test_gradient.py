"""Gradient descent with and without stability constraints."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import (
    FEASIBLE_POLE,
    feasible,
    nearest_feasible,
    stability_margins,
    stable_abc,
    violation_gradients,
    violations,
)
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.fit.estimators import Options, WheelRun, estimate
from sysid.fit.estimators.batch import all_pole, batch_cost
from sysid.fit.estimators.descent import Constraint, CostAndGradient, Rule, descend
from sysid.fit.estimators.gradient import ROUTH_HURWITZ, gradient, kkt, random_starts
from sysid.fit.estimators.linear import random_coefficients
from sysid.fit.estimators.problem import stack
from sysid.studies.synthetic import step_runs

PAPER = np.array([0.881, -0.151, 0.122, 0.0744, 0.1484, -0.0748])


@pytest.fixture
def mixed_runs() -> list[WheelRun]:
    """Commands of different shapes and lengths, samples between ticks, repeats, different noise."""
    rng = np.random.default_rng(5)
    runs = []
    for ticks in (60, 60, 90):
        times = np.sort(rng.uniform(0.0, ticks, 70))
        runs.append(
            WheelRun(
                command_rpm=np.repeat(rng.uniform(-100.0, 100.0, ticks // 10), 10),
                sample_tick=times,
                speed_rpm=rng.normal(0.0, 50.0, 70),
                sigma_rpm=rng.uniform(0.3, 2.0, 70),
                initial_rpm=0.0,
                sample_period_s=1 / 120,
            )
        )
    return [*runs, replace(runs[0], speed_rpm=runs[0].speed_rpm + 1.0)]


def quadratic(target: FloatArray) -> CostAndGradient:
    """H = |x - target|^2, whose largest curvature is 2."""
    return lambda x: (np.sum((x - target) ** 2, axis=1), 2.0 * (x - target))


def test_batch_cost_is_the_weighted_mean_square_of_the_problem(mixed_runs: list[WheelRun]) -> None:
    problem = stack(mixed_runs)
    predicted, jacobian = problem.predict_with_jacobian(PAPER, problem.traces())
    weights = problem.weight**2 / np.sum(problem.weight**2)
    error = predicted - problem.speed_rpm
    cost, slope = batch_cost(problem)(PAPER[None])
    within = 2.0 * problem.within_cost / np.sum(problem.weight**2)
    assert cost[0] == pytest.approx(weights @ error**2 + within, rel=1e-10)
    np.testing.assert_allclose(slope[0], 2.0 * (weights * error) @ jacobian, rtol=1e-8)
    np.testing.assert_allclose(batch_cost(problem).value(PAPER[None]), cost, rtol=1e-12)


def test_batch_gradient_is_exact_for_an_unstable_law(mixed_runs: list[WheelRun]) -> None:
    cost = batch_cost(stack(mixed_runs))
    law = np.array([0.9, 0.3, -0.1, 0.2, 0.1, -0.1])
    assert not WheelLaw.from_coefficients(law, 1.0).is_stable
    step = 1e-6 * np.eye(6)
    numeric = (cost(law + step)[0] - cost(law - step)[0]) / 2e-6
    np.testing.assert_allclose(cost(law[None])[1][0], numeric, rtol=1e-5)


def test_overflow_is_an_infinite_cost_without_a_warning(mixed_runs: list[WheelRun]) -> None:
    cost, slope = batch_cost(stack(mixed_runs))(np.full((1, 6), 1e30))
    assert cost[0] == np.inf
    np.testing.assert_array_equal(slope, 0.0)


@pytest.mark.parametrize("rule", ["fixed", "spectral"])
@pytest.mark.parametrize("constraint", [None, ROUTH_HURWITZ])
def test_wildly_unstable_starts_raise_no_warning(
    noisy_runs: list[WheelRun], rule: Rule, constraint: Constraint | None
) -> None:
    """Errors of 1e100 rpm and more, whose squares overflow."""
    starts = 8.0 * random_starts(30, 0)
    cost = batch_cost(stack(noisy_runs))
    reached = descend(cost, starts, rate=1e-7, iterations=60, rule=rule, constraint=constraint)
    assert np.all(np.isfinite(reached.laws))
    assert not np.any(np.isnan(reached.cost))


def test_few_and_many_laws_give_the_same_filter_output() -> None:
    rng = np.random.default_rng(0)
    laws, drive = stable_abc(rng.normal(size=(150, 3))), rng.normal(size=(40, 2, 150))
    few = np.concatenate(
        [all_pole(laws[:75], drive[:, :, :75]), all_pole(laws[75:], drive[:, :, 75:])], axis=2
    )
    np.testing.assert_allclose(all_pole(laws, drive), few, rtol=1e-9, atol=1e-12)


triples = st.tuples(*[st.floats(-6.0, 6.0) for _ in range(3)]).map(np.array)


@given(triples)
def test_nearest_feasible_point_is_stable_and_no_stable_law_is_nearer(abc: FloatArray) -> None:
    found = nearest_feasible(abc[None])[0]
    assert np.all(stability_margins(found) > 0.0)
    others = FEASIBLE_POLE ** np.arange(1, 4) * stable_abc(
        np.random.default_rng(0).normal(0.0, 2.0, (5000, 3))
    )
    nearest = np.min(np.linalg.norm(others - abc, axis=1))
    assert np.linalg.norm(found - abc) <= nearest * 1.001 + 1e-3


@given(triples.map(stable_abc).filter(lambda abc: bool(feasible(abc))))
def test_feasible_points_are_left_alone(abc: FloatArray) -> None:
    np.testing.assert_array_equal(nearest_feasible(abc[None])[0], abc)


def test_nearest_feasible_point_repeats_itself() -> None:
    once = nearest_feasible(random_starts(500, 3)[:, :3] * 3.0)
    np.testing.assert_allclose(nearest_feasible(once), once, atol=1e-9)


def test_stable_region_is_not_convex() -> None:
    """The paper's projection theorem needs it convex: three poles at 0.9 and three at -0.9 disprove it."""
    ends = np.array([-np.poly([p, p, p])[1:] for p in (0.9, -0.9)])
    assert np.all(feasible(ends))
    assert not feasible(np.mean(ends, axis=0))


def test_free_running_error_is_not_convex(noisy_runs: list[WheelRun]) -> None:
    """The paper's proof needs a convex H. One in seven random pairs of stable laws is a counterexample."""
    rng = np.random.default_rng(0)
    first, second = (np.array([random_coefficients(rng) for _ in range(200)]) for _ in range(2))
    cost = batch_cost(stack(noisy_runs))
    broken = cost.value((first + second) / 2) > (cost.value(first) + cost.value(second)) / 2
    assert np.mean(broken) > 0.05


@given(triples)
def test_violation_gradients_are_exact(abc: FloatArray) -> None:
    step = 1e-6 * np.eye(3)
    numeric = (violations(abc + step) - violations(abc - step)).T / 2e-6
    np.testing.assert_allclose(violation_gradients(abc), numeric, atol=1e-6)


def test_constant_rate_converges_below_two_over_the_curvature_and_diverges_above() -> None:
    start = PAPER[None] + 0.1
    below = descend(quadratic(PAPER), start, rate=0.95, iterations=2000, rule="fixed")
    above = descend(quadratic(PAPER), start, rate=1.05, iterations=2000, rule="fixed")
    np.testing.assert_allclose(below.laws[0], PAPER, atol=1e-6)
    assert below.converged[0]
    assert above.cost[0] == np.inf


def test_multipliers_work_with_g_below_zero_and_fail_with_the_signs_as_printed() -> None:
    """The optimum is inside the region and the start is near: only the printed signs leave the region."""
    start = PAPER[None] + 0.05
    right = descend(quadratic(PAPER), start, rate=0.1, iterations=300, rule="fixed", constraint=ROUTH_HURWITZ)
    printed = descend(
        quadratic(PAPER),
        start,
        rate=0.1,
        iterations=300,
        rule="fixed",
        constraint=replace(ROUTH_HURWITZ, printed_signs=True),
    )
    assert right.cost[0] < 1e-20
    np.testing.assert_array_equal(right.multipliers, 0.0)
    assert np.max(printed.multipliers) > 1.0
    assert printed.cost[0] > 0.1


def test_optimum_outside_the_region_gives_its_projection() -> None:
    target = np.concatenate([[2.2, -0.4, -0.3], PAPER[3:]])
    nearest = nearest_feasible(target[None, :3])[0]
    for rule in ("fixed", "spectral"):
        reached = descend(
            quadratic(target),
            random_starts(20, 0),
            rate=0.3,
            iterations=3000,
            rule=rule,
            constraint=ROUTH_HURWITZ,
        )
        assert np.all(feasible(reached.laws[:, :3]))
        best = np.argmin(reached.cost)
        np.testing.assert_allclose(reached.laws[best, :3], nearest, atol=1e-2)


def test_stop_criterion_is_met_at_the_optimum_and_not_after_one_iteration(noisy_runs: list[WheelRun]) -> None:
    found = kkt(noisy_runs, Options(starts=1))
    assert found.starts[0].converged
    cost = batch_cost(stack(noisy_runs))
    once = descend(cost, random_starts(3, 0), rate=1e-6, iterations=1, constraint=ROUTH_HURWITZ)
    assert not np.any(once.converged)


def test_all_three_descents_start_at_the_same_random_laws(noisy_runs: list[WheelRun]) -> None:
    options = Options(starts=4, first_starts="random", seed=7, max_iterations=1)
    starts = [
        [start.initial for start in estimate(noisy_runs, m, options).starts]
        for m in ("gradient", "kkt", "poles")
    ]
    assert starts[0] == starts[1] == starts[2]
    np.testing.assert_array_equal(starts[0], random_starts(9, 7)[:4])


def test_same_seed_gives_the_same_estimate(noisy_runs: list[WheelRun]) -> None:
    options = Options(starts=4, max_iterations=4)
    assert kkt(noisy_runs, options).law == kkt(noisy_runs, options).law


def test_kkt_is_stable_from_every_random_start(noisy_runs: list[WheelRun]) -> None:
    found = kkt(noisy_runs, Options(starts=120, first_starts="random", max_iterations=4))
    assert found.stable_share == 1.0


def test_unconstrained_descent_from_random_starts_leaves_some_unstable(noisy_runs: list[WheelRun]) -> None:
    found = gradient(noisy_runs, Options(starts=40, first_starts="random", max_iterations=8))
    assert 0.2 < found.stable_share < 0.8


def test_kkt_with_informed_starts_always_reaches_the_output_error_optimum(noisy_runs: list[WheelRun]) -> None:
    found = kkt(noisy_runs, Options(starts=12))
    best = estimate(noisy_runs, "output-error").rms_rpm
    assert found.success_share == found.stable_share == 1.0
    assert found.rms_rpm == pytest.approx(best, rel=1e-4)
    assert found.rms_rpm >= best - 1e-9


def test_unit_gain_is_held_on_request(noisy_runs: list[WheelRun]) -> None:
    held = kkt(noisy_runs, Options(starts=2, max_iterations=8))
    free = kkt(noisy_runs, Options(starts=2, max_iterations=8, unit_gain=False))
    assert held.law.dc_gain == pytest.approx(1.0, abs=1e-12)
    assert abs(free.law.dc_gain - 1.0) > 1e-9
    assert "E" in free.free
    assert "E" not in held.free


def test_estimate_cost_is_half_the_weighted_sum_of_squares(noisy_runs: list[WheelRun]) -> None:
    found = kkt(noisy_runs, Options(starts=1))
    reference = estimate(noisy_runs, "output-error", Options(starts=1))
    assert found.cost == pytest.approx(reference.cost, rel=1e-4)


def test_given_starts_replace_the_others(noisy_runs: list[WheelRun], paper: Model) -> None:
    start = tuple(float(x) for x in paper.wheel.law.coefficients)
    found = gradient(noisy_runs, Options(initial=(start,), max_iterations=1))
    assert [s.kind for s in found.starts] == ["given"]
    assert found.starts[0].initial == start


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6), noise=st.floats(0.0, 3.0))
def test_kkt_is_stable_and_no_worse_than_one_step_on_random_systems(seed: int, noise: float) -> None:
    """Poles up to 0.98, any zeros; without the choice of order, which accepts a slightly larger error."""
    rng = np.random.default_rng(seed)
    law = WheelLaw.from_coefficients(random_coefficients(rng), 1 / 120)
    runs = step_runs(law, rng, noise_rpm=noise, repeats=1, seconds=0.8, steps_rpm=(40.0, 80.0))
    baseline = estimate(runs, "one-step").rms_rpm
    found = kkt(runs, Options(starts=3, max_iterations=40, order="third"))
    assert found.stable_share == 1.0
    assert found.law.is_stable
    assert found.rms_rpm <= baseline * (1.0 + 1e-9) + 1e-9
