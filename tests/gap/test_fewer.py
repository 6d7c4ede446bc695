"""Smaller sets stay candidates where an effect may only mend formulas; doubt is about effects as a whole."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.effects.scale import REFERENCE
from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem, fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import Coordinate, EffectSet, effect_set
from sysid.gap.search import ties
from sysid.gap.search.chance import Floor
from sysid.gap.search.scores import ScoredSet, doubtful, interval_ends
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.search.ties import formula_error, friction_first, in_first_forms, tied, with_fewer

from .conftest import MakeLogs

BASE_COST = 1000.0
FLOOR = Floor(1e4, trusted=True)
PAIR = ("backlash", "stiction")


def a_set(cost: float, *names: str) -> ScoredSet:
    """Return a set of which only names, score and cost are known."""
    fitted: Any = SimpleNamespace(names=names, cost=cost)
    return ScoredSet(fitted, np.array([cost]))


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a search of which only the cost without effects is known; no set rises or is doubtful."""
    monkeypatch.setattr(ties, "rises", lambda *_: False)
    monkeypatch.setattr(ties, "doubtful", lambda *_: ())
    monkeypatch.setattr(ties, "formula_error", lambda *_: THRESHOLDS.formula_error)
    problem = SimpleNamespace(knows_all=False)
    return SimpleNamespace(problem=problem, base=SimpleNamespace(cost=BASE_COST), told_before=frozenset())


def test_an_effect_that_leaves_little_of_what_a_pair_explains_is_listed_behind_the_pair(search: Any) -> None:
    allowed = THRESHOLDS.crude_formula**2 * (BASE_COST - 100.0)
    pair = a_set(100.0, *PAIR)
    near, far = a_set(99.0 + allowed, "backlash"), a_set(101.0 + allowed, "stiction")
    assert with_fewer(search, FLOOR, (pair,), (pair, near, far), 1.0) == (pair, near)


def test_beside_the_logs_of_a_robots_fit_cruder_formulas_are_listed_whatever_they_are(search: Any) -> None:
    search.problem.knows_all = True
    allowed = THRESHOLDS.crude_robot_formula**2 * (BASE_COST - 100.0)
    pair = a_set(100.0, *PAIR)
    near, far = a_set(99.0 + allowed, "speed_gain"), a_set(101.0 + allowed, "stiction")
    assert with_fewer(search, FLOOR, (pair,), (pair, near, far), 1.0) == (pair, near)


def test_formulas_lack_more_beside_the_logs_of_a_robots_fit() -> None:
    problem: Any = SimpleNamespace(size=100, knows_all=True)
    more, less = (a_set(1e4, *names).fitted for names in (("backlash", "stiction"), ("backlash",)))
    assert formula_error(problem, Floor(1e4, trusted=False), more, less) == THRESHOLDS.robot_formula


@pytest.mark.parametrize(("cost", "taken"), [(105.0, "battery_sag"), (220.0, "battery_sag/voltage")])
def test_a_first_form_takes_the_place_of_another_only_if_its_fit_ended_as_low(
    cost: float, taken: str
) -> None:
    def one(name: str, cost: float) -> ScoredSet:
        fitted: Any = SimpleNamespace(names=(name,), cost=cost, candidate=SimpleNamespace(parameter_count=1))
        return ScoredSet(fitted, np.array([100.0]))

    voltage, first = one("battery_sag/voltage", 100.0), one("battery_sag", cost)
    assert in_first_forms(voltage, [voltage, first], 1.0).names == (taken,)


@pytest.mark.parametrize(
    ("lacking", "names"), [(0.0, [("stiction",)]), (80.0, [("stiction",), ("backlash",)])]
)
def test_what_a_function_without_a_cause_does_better_widens_a_tie(
    search: Any, lacking: float, names: list[tuple[str, ...]]
) -> None:
    """So much the formula of the chosen set lacks at least, and so much may that of the right one."""

    def one(name: str, score: float, size: float) -> ScoredSet:
        candidate = SimpleNamespace(parameter_count=1)
        fitted: Any = SimpleNamespace(
            names=(name,), cost=score, candidate=candidate, residual=np.full(4, size)
        )
        return ScoredSet(fitted, np.array([score]))

    search.problem = SimpleNamespace(has_surrogate=False, knows_all=False)
    search.shared = lambda *_: SimpleNamespace(cost=200.0)
    sets = [one("stiction", 150.0, 6.0), one("backlash", 200.0, -6.0)]
    found = ties.tied(search, FLOOR, sets[0], sets, 1.0, lacking)
    assert [each.names for each in found] == names


@pytest.mark.parametrize(
    ("better", "worse", "share"),
    [
        (("speed_gain", "backlash"), ("speed_gain",), THRESHOLDS.exact_formula),
        (("sensor_latency", "speed_gain"), ("speed_gain", "command_latency"), THRESHOLDS.exact_formula),
        (("backlash", "stiction"), ("backlash",), THRESHOLDS.formula_error),
        (("speed_gain", "stiction"), ("speed_gain", "backlash"), THRESHOLDS.formula_error),
        # What the model does between command and sensor tells these two apart, such as its friction.
        (("sensor_scale",), ("speed_gain",), THRESHOLDS.formula_error),
        (("speed_gain", "backlash"), ("sensor_scale", "backlash"), THRESHOLDS.formula_error),
    ],
)
def test_only_formulas_of_which_there_are_several_excuse_what_a_set_leaves(
    better: tuple[str, ...], worse: tuple[str, ...], share: float
) -> None:
    """A factor or a delay has one formula: what it leaves is something else."""
    problem: Any = SimpleNamespace(size=100, knows_all=False, bench=True)
    more, less = (a_set(1e4, *names).fitted for names in (better, worse))
    assert formula_error(problem, Floor(1e4, trusted=False), more, less) == share


@pytest.mark.parametrize(
    ("other", "score", "kept"),
    [
        ("warm_up", 99.0, True),
        ("warm_up", 100.9, True),
        ("warm_up", 101.1, False),
        ("battery_sag/voltage", 99.0, True),
        ("battery_sag/voltage", 100.9, False),
    ],
)
def test_a_set_with_a_parameter_more_is_a_candidate_unless_that_costs_what_a_needless_one_does(
    other: str, score: float, kept: bool
) -> None:
    def one(name: str, score: float, parameters: int) -> ScoredSet:
        candidate = SimpleNamespace(parameter_count=parameters)
        fitted: Any = SimpleNamespace(names=(name,), cost=score, candidate=candidate, residual=np.zeros(9))
        return ScoredSet(fitted, np.array([score]))

    base = SimpleNamespace(cost=BASE_COST)
    problem = SimpleNamespace(has_surrogate=False, knows_all=False, size=100)
    search: Any = SimpleNamespace(base=base, shared=lambda *_: base, problem=problem, told_before=frozenset())
    simple, curved = one("battery_sag", 100.0, 1), one(other, score, 2)
    unknown = Floor(1e4, trusted=False)
    found = ties.tied(search, unknown, simple, (simple, curved), 1.0)
    assert found == ((simple, curved) if kept else (simple,))


def test_a_pair_that_takes_the_residual_to_the_noise_is_alone(
    search: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ties, "formula_error", lambda *_: THRESHOLDS.exact_formula)
    pair, near = a_set(100.0, *PAIR), a_set(110.0, "backlash")
    assert with_fewer(search, FLOOR, (pair,), (pair, near), 1.0) == (pair,)


def test_friction_comes_before_a_dead_zone_that_looks_like_it() -> None:
    dead, rubbing = (
        a_set(99.0, "command_deadband/subtract", "backlash"),
        a_set(101.0, "backlash", "coulomb_friction"),
    )
    other = a_set(100.0, "backlash", "stiction")
    assert friction_first((dead, other, rubbing)) == (rubbing, dead, other)
    assert friction_first((dead, other)) == (dead, other)
    assert friction_first((other, dead, rubbing)) == (other, dead, rubbing)
    assert friction_first(()) == ()


def test_friction_is_no_repetition_of_the_dead_zone_that_looks_like_it(search: Any) -> None:
    def one(name: str, count: int, cost: float) -> ScoredSet:
        candidate = SimpleNamespace(parameter_count=count)
        fitted: Any = SimpleNamespace(
            names=(name,), cost=cost, candidate=candidate, residual=np.array([np.sqrt(cost)])
        )
        return ScoredSet(fitted, np.array([cost]))

    search.shared = lambda *_: search.base
    dead, rubbing = one("command_deadband/subtract", 1, 100.0), one("coulomb_friction", 2, 101.0)
    late, asymmetric = one("sensor_latency", 1, 102.0), one("direction_asymmetry", 2, 103.0)
    # All four predict the same; of those with two parameters friction alone may be the truth.
    sets = [dead, rubbing, late, asymmetric]
    assert tied(search, FLOOR, dead, sets, 1.0) == (dead, rubbing, late)
    # Unless an earlier search of the same logs told one apart from the others.
    search.told_before = frozenset({asymmetric.names})
    assert tied(search, FLOOR, dead, sets, 1.0) == (dead, rubbing, late, asymmetric)


@pytest.mark.parametrize(("time_constant_s", "is_told"), [(4.0, False), (3.6, True), (None, True)])
def test_what_fades_no_sooner_than_the_logs_end_does_not_tie_with_what_stays(
    search: Any, base: Model, time_constant_s: float | None, is_told: bool
) -> None:
    """A warm-up has more parameters than friction, and looks like it where it is as slow as it may be.

    A set may have lost its time constant as a parameter that it does not need.
    """
    cold, longest_s = "warm_up/cold_friction", 4.0
    slowness = {} if time_constant_s is None else {"time_constant_s": time_constant_s}
    warming = base.with_effect(cold, torque_n_m=0.1, **slowness)

    def one(name: str, count: int, cost: float) -> ScoredSet:
        candidate = SimpleNamespace(parameter_count=count, model=lambda *_: warming)
        residual = np.array([np.sqrt(cost), 0.0] if count == 1 else [0.0, np.sqrt(cost)])
        fitted: Any = SimpleNamespace(
            names=(name,), cost=cost, candidate=candidate, residual=residual, place=None
        )
        return ScoredSet(fitted, np.array([cost]))

    search.shared = lambda *_: search.base
    search.problem.base = base
    search.problem.settings = SimpleNamespace(scale=replace(REFERENCE, run_s=longest_s))
    friction, fading = one("coulomb_friction", 1, 100.0), one(cold, 3, 110.0)
    assert tied(search, FLOOR, friction, [friction, fading], 1.0) == (friction, *[fading] * is_told)


def test_harmful_and_doubtful_effects_are_not_listed(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    pair, near = a_set(100.0, *PAIR), a_set(110.0, "backlash")
    for name, instead in (("rises", lambda *_: True), ("doubtful", lambda *_: ("backlash",))):
        with monkeypatch.context() as only:
            only.setattr(ties, name, instead)
            assert with_fewer(search, FLOOR, (pair,), (pair, near), 1.0) == (pair,)


@pytest.mark.parametrize(("share", "found"), [(0.15, ()), (0.0, ("warm_up",))])
def test_an_effect_whose_parameters_are_vague_is_doubted_only_if_it_may_be_none(
    bench_logs: MakeLogs, base: Model, share: float, found: tuple[str, ...]
) -> None:
    # In runs of 2 s a share that is reached after 6 s is hardly told from a larger one that takes longer.
    hidden = base.with_effect("warm_up", share=share, time_constant_s=6.0) if share else base
    logs = bench_logs(hidden, seed=4)
    observations = observe(logs)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(logs, observations), None))
    candidate = effect_set(base, ["warm_up"])
    place = np.array([one.unit(value) for one, value in zip(candidate.coordinates, (0.15, 6.0), strict=True)])
    fitted = fit(problem, candidate, place, most=30)
    assert fitted is not None
    # One of the two parameters is vague in both cases.
    low, high = interval_ends(problem, fitted, 1.0)
    assert np.any(high - low > 0.5)
    assert doubtful(problem, fitted, 1.0) == found


def test_a_limit_near_the_end_of_its_range_is_not_doubted(bench_logs: MakeLogs, base: Model) -> None:
    """Its neutral value is infinite, and the place of that value is the end of the range."""
    name, most = "acceleration_limit/s_curve", 2500.0
    logs = bench_logs(base.with_effect(name, jerk_rpm_s2=0.99 * most), seed=4)
    observations = observe(logs)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(logs, observations), None))
    candidate = EffectSet((name,), (Coordinate(name, "jerk_rpm_s2", 30.0, most, math.inf),))
    fitted = fit(problem, candidate, np.array([0.995]), most=30)
    assert fitted is not None
    assert float(fitted.place[0]) > 0.99
    assert fitted.cost < 0.1 * float(np.sum(problem.base_residual**2))
    assert doubtful(problem, fitted, 1.0) == ()
