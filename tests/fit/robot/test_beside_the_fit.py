"""A study of a robot beside the logs of its fit: only what a change does counts, and what is new."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from sysid.compare.least_squares import Fitted, ResidualProblem, base_fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Learned, Whitener, learn
from sysid.compare.predicted import SimulationSettings
from sysid.compare.search_space import EffectSet, effect_set
from sysid.gap.search.beyond_fit import beyond_fit, largest_ratio, without_first_order
from sysid.gap.search.chance import Floor
from sysid.gap.search.decision import _inflation, _is_systematic
from sysid.gap.search.detectable import smallest_detectable
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.scores import group_masks, rises
from sysid.gap.search.sets import EMPTY, Search
from sysid.gap.search.since import since_of_robot
from sysid.gap.search.thresholds import BESIDE_FIT_OF_ROBOT
from sysid.logs import Dataset

MakeLogs = Callable[..., Dataset]
RIPPLE = {"share": 0.03, "per_turn": 4.0}


@pytest.fixture(scope="module")
def learned(robot_logs: MakeLogs) -> Learned:
    rippled = paper_model().with_effect("encoder_eccentricity", **RIPPLE)
    return learn(paper_model(), robot_logs(rippled, runs=3, seconds=1.5))


def problem_of(
    logs: Dataset, learned: Learned, settings: SimulationSettings | None = None
) -> ResidualProblem:
    whitener = Whitener(observe(logs), learned.whitener.noise, learned.error)
    return ResidualProblem(learned.model, whitener, settings, learned=learned)


def logs_of(robot_logs: MakeLogs, model: Model) -> Dataset:
    return robot_logs(model, runs=2, seconds=1.5)


@pytest.fixture(scope="module")
def unchanged(learned: Learned, robot_logs: MakeLogs) -> ResidualProblem:
    """Return the study of a robot that is as its model says."""
    return problem_of(logs_of(robot_logs, paper_model()), learned)


def test_a_change_that_the_planar_plant_shows_has_no_chance_of_rollers_in_it(
    unchanged: ResidualProblem,
) -> None:
    problem = unchanged
    base = problem.base_residual
    moved = [problem.residual(problem.base.with_effect("speed_gain", gain=1.0 - c)) for c in (0.01, 0.02)]
    assert moved[0] is not None
    assert moved[1] is not None
    once, twice = moved[0] - base, moved[1] - base
    # Twice the change does twice as much, to the rounding of commands; on rollers chance is most of it.
    assert np.linalg.norm(twice - 2.0 * once) < 0.2 * np.linalg.norm(twice)
    unmoved = problem.residual(problem.base)
    assert unmoved is not None
    np.testing.assert_allclose(unmoved, base)


def test_without_slip_any_other_model_is_simulated(robot_logs: MakeLogs) -> None:
    """Where there is no faster plant than the one that is asked for, nothing is left to rollers."""
    planar = SimulationSettings("planar")
    logs = robot_logs(paper_model(), runs=2, seconds=1.0)
    problem = problem_of(logs, learn(paper_model(), logs, settings=planar), planar)
    heavier = replace(problem.base, robot=replace(problem.base.robot, mass_kg=40.0))
    residual = problem.residual(heavier)
    assert residual is not None
    assert residual @ residual > problem.base_residual @ problem.base_residual


def test_what_only_rollers_show_is_still_simulated_on_them(unchanged: ResidualProblem) -> None:
    problem = unchanged
    slippery = problem.residual(problem.base.with_effect("low_grip", friction=0.05))
    assert slippery is not None
    assert np.linalg.norm(slippery - problem.base_residual) > 10.0


def test_a_grip_that_no_wheel_misses_changes_next_to_nothing(unchanged: ResidualProblem) -> None:
    problem, base = unchanged, unchanged.base
    weaker = base.with_effect("low_grip", friction=0.9 * base.robot.friction)
    residual = problem.residual(weaker)
    assert residual is not None
    one = problem.simulators.full
    by_chance = problem.whitener.whiten(one.predictions(weaker)) - problem.whitener.whiten(
        one.predictions(base)
    )
    assert np.linalg.norm(residual - problem.base_residual) < 0.5 * np.linalg.norm(by_chance)


@pytest.mark.parametrize(
    "effect", [{"com_offset": {"x_m": 0.02, "y_m": 0.01}}, {"weak_servo": {"servo_n_m_s_rad": 0.1}}]
)
def test_what_the_planar_plant_shows_for_the_most_part_is_simulated_there(
    unchanged: ResidualProblem, effect: dict[str, dict[str, float]]
) -> None:
    problem, ((name, values),) = unchanged, effect.items()
    model = problem.base.with_effect(name, **values)
    planar = problem.surrogate_residual(model), problem.surrogate_residual(problem.base)
    residual = problem.residual(model)
    assert residual is not None
    assert planar[0] is not None
    assert planar[1] is not None
    np.testing.assert_allclose(residual - problem.base_residual, planar[0] - planar[1], atol=1e-9)


def test_every_single_effect_is_fitted_whatever_its_screening_promises(unchanged: ResidualProblem) -> None:
    library = responses(unchanged, ["speed_gain", "viscous_friction", "sensor_scale"])
    search = Search(unchanged, Library(library), BESIDE_FIT_OF_ROBOT)
    search.grow(1)
    assert {fitted.names[0] for fitted in search.of_size(1)} == {response.effect for response in library}


def test_a_ripple_that_the_logs_of_the_fit_show_is_not_looked_for(
    learned: Learned, robot_logs: MakeLogs
) -> None:
    rippled = paper_model().with_effect("encoder_eccentricity", **RIPPLE)
    problem = problem_of(logs_of(robot_logs, rippled), learned)
    library = responses(problem, ["encoder_eccentricity", "speed_gain"])
    assert {r.effect for r in library} == {"encoder_eccentricity", "speed_gain"}
    found = beyond_fit(problem, learned, library)
    assert {r.effect for r in found.searched} == {"speed_gain"}
    assert {r.effect for r in found.left_out} == {"encoder_eccentricity"}


def test_a_ripple_that_is_new_is_looked_for(robot_logs: MakeLogs) -> None:
    learned = learn(paper_model(), robot_logs(paper_model(), runs=3, seconds=1.5))
    rippled = paper_model().with_effect("encoder_eccentricity", **RIPPLE)
    problem = problem_of(logs_of(robot_logs, rippled), learned)
    library = responses(problem, ["encoder_eccentricity"])
    assert beyond_fit(problem, learned, library).searched == library


@pytest.mark.parametrize(("threshold_rpm", "is_searched"), [(0.5, False), (20.0, True)])
def test_a_threshold_that_explains_little_may_be_an_error_that_the_fit_did_not_reach(
    learned: Learned, robot_logs: MakeLogs, threshold_rpm: float, is_searched: bool
) -> None:
    numb = paper_model().with_effect("command_deadband", threshold_rpm=threshold_rpm)
    problem = problem_of(logs_of(robot_logs, numb), learned)
    found = beyond_fit(problem, learned, responses(problem, ["command_deadband"]))
    assert bool(found.searched) == is_searched
    assert bool(found.left_out) != is_searched
    # What the study says that it could have seen counts the least fall.
    both = (*found.searched, *found.left_out)
    seen, by_chance = (smallest_detectable(both, 1.0, least) for least in (found.least, {}))
    assert seen["command_deadband"]["threshold_rpm"] > by_chance["command_deadband"]["threshold_rpm"]


@pytest.mark.parametrize("effect", [{"x_m": 0.01}, {"y_m": 0.01}])
def test_what_an_effect_does_is_the_same_in_the_own_error_as_in_the_search(
    unchanged: ResidualProblem, learned: Learned, effect: dict[str, float]
) -> None:
    """Else its own scatter of rollers would hide it in the one, and it would be new in the other."""
    problem = unchanged
    moved = problem.residual(problem.base.with_effect("com_offset", **effect))
    assert moved is not None
    change = moved - problem.base_residual
    columns = problem.whitener.whiten(learned.columns(problem.simulators))
    sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    assert np.max(np.abs(change @ columns) / sizes) > 0.99 * np.linalg.norm(change)


def test_what_may_act_for_the_first_time_where_the_robot_goes_faster(unchanged: ResidualProblem) -> None:
    names = ["speed_saturation", "static_map", "speed_gain", "encoder_eccentricity", "coulomb_friction"]
    library = responses(unchanged, names)
    assert {response.effect for response in library} == set(names)
    # A soft knee has a first order, and is a limit nevertheless; a curve may be one.
    assert without_first_order(library) == {"speed_saturation", "static_map"}


@pytest.mark.parametrize(
    ("name", "values", "since"),
    [
        ("speed_gain", {"gain": 0.9}, "new"),
        ("speed_saturation", {"limit_rpm": 20.0}, "new"),
        ("speed_saturation", {"limit_rpm": 130.0}, "unknown"),
    ],
)
def test_an_effect_of_a_robot_is_new_only_if_the_logs_of_its_fit_exclude_it(
    unchanged: ResidualProblem, learned: Learned, name: str, values: dict[str, float], since: str
) -> None:
    top = max(float(np.max(np.abs(block.value))) for block in learned.whitener.observations.blocks)
    assert 20.0 < top < 130.0
    whole = effect_set(unchanged.base, [name], scale=unchanged.settings.scale)
    one = EffectSet((name,), tuple(c for c in whole.coordinates if c.parameter in values), whole.fixed)
    place = np.array([c.unit(values[c.parameter]) for c in one.coordinates])
    residual = np.zeros(unchanged.size)
    chosen = Fitted(one, place, residual, np.zeros((unchanged.size, place.size)))
    assert since_of_robot(unchanged, learned, chosen) == {name: since}


def test_an_error_of_few_sequences_may_be_much_larger_in_others(robot_logs: MakeLogs) -> None:
    two, four = (observe(robot_logs(paper_model(), runs=runs, seconds=1.5)) for runs in (2, 4))
    assert largest_ratio(two, two) > 4.0 * largest_ratio(four, four)


@pytest.mark.parametrize(("factor", "raised"), [(1.5, True), (1.0, False), (1.001, False), (-1.5, True)])
def test_a_set_that_raises_what_is_left_in_one_command_sequence_is_refused(
    unchanged: ResidualProblem, factor: float, raised: bool
) -> None:
    problem = unchanged
    before = base_fit(problem, EMPTY)
    # Less is left in the others, and in all.
    after = np.where(group_masks(problem)[0], factor, 0.1) * before.residual
    assert rises(problem, before, replace(before, residual=after)) == raised


def test_a_rise_in_one_sequence_that_a_formula_may_leave_does_not_refuse_a_set(
    unchanged: ResidualProblem,
) -> None:
    """It changes much there, lowers nothing, and explains nearly all that the other sequences show."""
    problem = unchanged
    before = base_fit(problem, EMPTY)
    after = np.where(group_masks(problem)[0], -1.02, 0.1) * before.residual
    assert not problem.same_commands
    assert not rises(problem, before, replace(before, residual=after))


def test_chance_is_as_much_larger_in_other_commands_as_the_error_may_be(
    unchanged: ResidualProblem,
) -> None:
    problem = unchanged
    best = base_fit(problem, EMPTY)
    assert best.cost < 1.5 * problem.size
    assert _inflation(problem, Floor(1e6, trusted=True, slack=1.5), best) == 1.5
    assert _inflation(problem, Floor(1e6, trusted=True), best) < 1.5


def test_an_error_of_roughly_known_size_allows_for_that() -> None:
    exact = Floor(1e6, trusted=True)
    assert replace(exact, slack=1.5).largest_ratio(1000) == pytest.approx(1.5 * exact.largest_ratio(1000))


def test_what_every_command_sequence_shows_alike_is_systematic(robot_logs: MakeLogs) -> None:
    """An error of the model differs from one sequence to the next; a longer radius shows in each."""
    planar, names = SimulationSettings("planar"), ["wheel_radius", "payload", "sensor_scale"]
    nominal = robot_logs(paper_model(), runs=5, seconds=1.5, body=True)
    learned = learn(paper_model(), nominal, settings=planar)
    answers = []
    for scale in (1.02, 1.0):
        longer = paper_model().with_effect("wheel_radius", scale=scale)
        logs = robot_logs(longer, runs=5, seconds=1.5, body=True)
        problem = problem_of(logs, learned, planar)
        search = Search(problem, Library(responses(problem, names)), BESIDE_FIT_OF_ROBOT)
        search.grow(1)
        radius = next(fitted for fitted in search.of_size(1) if fitted.names == ("wheel_radius",))
        answers.append(_is_systematic(search, radius))
    assert answers == [True, False]
