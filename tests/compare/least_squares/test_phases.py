"""Effects that follow the wheel's angle in runs that start at unknown angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.least_squares import ResidualProblem, likely_frequencies
from sysid.compare.least_squares.phases import _repeats_begin_alike, with_unknown_phases
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import SearchEffort
from sysid.logs import BenchCommand, Dataset, Run

MODEL = paper_model()
NOISE_RPM = 0.2


def turned_logs(effect: str, repeats: int = 1, homed: bool = True, **values: float) -> Dataset:
    """Return bench logs of a wheel with an effect, each group of which starts at another angle.

    So does each repeat of a wheel that is not homed.
    """
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 4.0, 0.01)
    runs = []
    for i in range(6):
        levels = rng.uniform(20.0, 120.0, 4) * rng.choice((-1.0, 1.0), 4)
        command = np.rint(np.concatenate([np.zeros(20), np.repeat(levels, 95)]))
        true = MODEL.with_effect(effect, **values, phase_deg=float(rng.uniform(-180.0, 180.0)))
        speed = replay_bench(true, time, command)
        for k in range(repeats):
            if k > 0 and not homed:
                speed = replay_bench(with_phase(true, effect, 110.0 * i + 95.0), time, command)
            channels = {"speed_rpm": speed + NOISE_RPM * rng.standard_normal(time.size)}
            runs.append(Run(f"{i}_{k}.csv", f"{i}", "fit", time, BenchCommand(command), channels))
    return Dataset("turned", tuple(runs), ())


def problem_of(logs: Dataset) -> ResidualProblem:
    observations = observe(logs)
    return ResidualProblem(MODEL, Whitener(observations, measure_noise(logs, observations), None))


def with_phase(model: Model, effect: str, phase_deg: float) -> Model:
    return replace(model, effects={effect: {**model.effects[effect], "phase_deg": phase_deg}})


@pytest.mark.parametrize(
    ("effect", "values", "within"),
    [
        # A phase acts to first order alone, and overestimates a ripple that swings the wheel this much.
        ("torque_ripple", {"per_turn": 7.0, "torque_n_m": 0.8}, 0.12),
        ("torque_ripple", {"per_turn": 12.0, "share": 0.03}, 0.1),
        ("encoder_eccentricity", {"per_turn": 2.0, "share": 0.03}, 0.1),
    ],
)
def test_an_effect_of_the_angle_is_found_whatever_the_phase_of_each_run(
    effect: str, values: dict[str, float], within: float
) -> None:
    problem = problem_of(turned_logs(effect, **values))
    search = Search(
        problem, Library(responses(problem, ["torque_ripple", "encoder_eccentricity"])), SearchEffort()
    )
    search.grow(1)
    best = search.of_size(1)[0]
    found = best.candidate.model(MODEL, best.place).effects[effect]
    assert best.cost < 1.3 * problem.size < 0.5 * search.base.cost
    for name, value in values.items():
        assert found[name] == pytest.approx(value, rel=within)


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("torque_ripple", {"per_turn": 12.0, "share": 0.03}),
        ("encoder_eccentricity", {"per_turn": 1.0, "share": 0.05}),
    ],
)
def test_repeats_that_all_start_at_one_angle_show_the_true_size(
    effect: str, values: dict[str, float]
) -> None:
    """A wheel that is homed before each run: the mean of its repeats loses nothing of the wave."""
    problem = problem_of(turned_logs(effect, repeats=2, **values))
    search = Search(problem, Library(responses(problem, [effect])), SearchEffort())
    search.grow(1)
    best = search.best_fit
    found = best.candidate.model(MODEL, best.place).effects[effect]
    for name, value in values.items():
        assert found[name] == pytest.approx(value, rel=0.1)
    assert best.cost < 1.3 * problem.size


@pytest.mark.parametrize("alike", [True, False])
def test_what_repeats_differ_by_tells_whether_they_begin_at_one_angle(alike: bool) -> None:
    """Where each begins at another angle they differ by the wave; where all begin alike by noise only."""
    logs = turned_logs("encoder_eccentricity", repeats=2, homed=alike, per_turn=3.0, share=0.02)
    assert _repeats_begin_alike(observe(logs).blocks, 3.0) is alike


def test_the_phase_of_a_model_does_not_matter() -> None:
    problem = problem_of(turned_logs("encoder_eccentricity", per_turn=3.0, share=0.05))
    one = MODEL.with_effect("encoder_eccentricity", per_turn=3.0, share=0.05, phase_deg=10.0)
    here, there = (problem.residual(model) for model in (one, with_phase(one, "encoder_eccentricity", 70.0)))
    assert here is not None
    np.testing.assert_array_equal(here, there)


def test_the_phases_of_a_ripple_that_the_model_has_already_are_unknown_too() -> None:
    logs = turned_logs("torque_ripple", per_turn=5.0, torque_n_m=0.5)
    observations = observe(logs)
    known = MODEL.with_effect("torque_ripple", per_turn=5.0, torque_n_m=0.5)
    problem = ResidualProblem(known, Whitener(observations, measure_noise(logs, observations), None))
    np.testing.assert_array_equal(problem.base_residual, problem.residual(known))
    neutral = known.with_effect("encoder_eccentricity", per_turn=9.0, share=0.0)
    np.testing.assert_array_equal(problem.base_residual, problem.residual(neutral))
    assert problem.base_residual @ problem.base_residual < 1.3 * problem.size


def test_an_effect_that_is_not_there_is_not_rewarded_for_its_free_phases() -> None:
    problem = problem_of(turned_logs("encoder_eccentricity", per_turn=3.0, share=0.0))
    base = problem.residual(MODEL)
    assert base is not None
    for per_turn in range(1, 25):
        tried = MODEL.with_effect("encoder_eccentricity", per_turn=float(per_turn), share=0.01)
        residual = problem.residual(tried)
        assert residual is not None
        assert residual @ residual > base @ base - 4.0


def test_the_residual_says_which_frequency_to_try() -> None:
    problem = problem_of(turned_logs("torque_ripple", per_turn=18.0, torque_n_m=0.3))
    blocks, rows = problem.observations.blocks, problem.whitener.slices
    assert likely_frequencies(problem.base_residual, blocks, rows, 1) == (18,)


def test_a_ripple_against_integral_action_is_found_with_its_times() -> None:
    true = {"per_turn": 6.0, "torque_n_m": 0.8, "answer_s": 0.03, "washout_s": 0.08}
    problem = problem_of(turned_logs("torque_ripple/washed_out", **true))
    name = "torque_ripple/washed_out"
    search = Search(problem, Library(responses(problem, [name])), SearchEffort())
    search.grow(1)
    found = search.best_fit
    assert found.candidate.owners == (name,) * 3
    values = found.candidate.model(MODEL, found.place).effects[name]
    assert {key: values[key] for key in true} == pytest.approx(true, rel=0.2)


def test_a_phase_that_cancels_a_huge_residual_costs_nothing_below_zero() -> None:
    logs = turned_logs("torque_ripple", torque_n_m=0.3, per_turn=6.0)
    problem = problem_of(logs)
    model = MODEL.with_effect("torque_ripple", torque_n_m=0.3, per_turn=6.0, phase_deg=0.0)
    blocks, rows = problem.observations.blocks, problem.whitener.slices
    shapes = [np.cos(0.1 * np.arange(block.value.size) + 0.3) * 1e9 for block in blocks]

    def predictions_of(turned: Model) -> list[np.ndarray]:
        phase = np.radians(turned.effects["torque_ripple"]["phase_deg"] + 10.0)
        return [-shape * (1.0 + np.cos(phase)) for shape in shapes]

    whiten, measured = problem.whitener.whiten, np.zeros(problem.size)
    found = with_unknown_phases(predictions_of, whiten, measured, model, blocks, rows)
    assert found is not None
    assert np.all(np.isfinite(found))


def test_a_ripple_is_found_though_the_model_errs_in_the_angle() -> None:
    """Speeds that are predicted 2 % too low put a ripple of 12 periods per turn out of phase in a second."""
    values = {"per_turn": 12.0, "share": 0.05}
    logs = turned_logs("torque_ripple", **values)
    observations = observe(logs)
    slow = MODEL.with_effect("speed_gain", gain=0.98)
    problem = ResidualProblem(slow, Whitener(observations, measure_noise(logs, observations), None))
    model = slow.with_effect("torque_ripple", **values, phase_deg=0.0)
    without, beside = problem.residual(slow), problem.residual(model)
    assert without is not None
    assert beside is not None
    # Nearly all of what the ripple does is gone, and the error of the gain is left.
    right = problem.residual(MODEL.with_effect("torque_ripple", **values, phase_deg=0.0))
    gain = problem.residual(MODEL)
    assert right is not None
    assert gain is not None
    of_ripple = gain @ gain - right @ right
    assert without @ without - beside @ beside > 0.9 * of_ripple
