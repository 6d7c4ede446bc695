"""The correction by regression: finds a known pattern, nothing in noise, and applies as it was fitted."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels, wheels_to_twist
from mecanum_env.model import Robot, paper_model, read_model, write_model
from sysid.compare.correction import (
    KEY,
    Correction,
    Term,
    correction_of,
    formula,
)
from sysid.compare.samples import HeldCommand, Samples
from sysid.gap.search.regression import empirical_term, fit_correction
from sysid.logs import BenchCommand, Run

TIME = np.arange(0.0, 4.0, 0.01)
CHANGES = np.array([0.2, 1.1, 2.0, 2.9])
RAD_PER_RPM_S = 2.0 * np.pi / 60.0


def smooth(command: np.ndarray) -> np.ndarray:
    """Return a first-order response to a command on `TIME`."""
    speed = np.zeros_like(command)
    for k in range(1, len(command)):
        speed[k] = speed[k - 1] + 0.12 * (command[k - 1] - speed[k - 1])
    return speed


def bench_runs(pattern=None, count: int = 6, noise_rpm: float = 0.5, seed: int = 0) -> list[Samples]:
    """Return runs whose error is a pattern of (time, command, speed) and white noise."""
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(count):
        held = HeldCommand(CHANGES, rng.integers(-120, 120, (4, 1)).astype(float))
        command = held.at(TIME)[:, 0]
        speed = smooth(command)
        extra = 0.0 if pattern is None else pattern(TIME, command, speed)
        measured = speed + extra + noise_rpm * rng.standard_normal(TIME.size)
        runs.append(Samples("speed_rpm", TIME, measured, speed, speed, held, run=f"{i}.csv", group=str(i)))
    return runs


def ripple(time: np.ndarray, command: np.ndarray, speed: np.ndarray) -> np.ndarray:
    del command
    angle = np.concatenate([[0.0], np.cumsum(np.diff(time) * 0.5 * (speed[1:] + speed[:-1]))]) * RAD_PER_RPM_S
    return 3.0 * np.sin(2.0 * angle + np.radians(30.0))


def test_a_ripple_of_the_wheel_is_found_with_its_size_and_phase():
    found = fit_correction(bench_runs(ripple))
    assert found is not None
    (term,) = found.terms["speed_rpm"]
    assert term.feature == "2 x wheel angle"
    assert np.hypot(*term.coefficients) == pytest.approx(3.0, abs=0.05)
    assert np.degrees(np.arctan2(term.coefficients[1], term.coefficients[0])) == pytest.approx(30.0, abs=2.0)
    assert found.explained["speed_rpm"] == pytest.approx(4.5 / (4.5 + 0.25), abs=0.02)
    report = empirical_term(found, adopted=True)
    assert report.adopted
    expected = r"(2\.9\d|3|3\.0\d) rpm x sin\(2 x wheel angle \+ \d\d deg\)"
    assert re.fullmatch(expected, report.formula["speed_rpm"])


@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_found_in_white_noise(seed: int):
    assert fit_correction(bench_runs(seed=seed)) is None


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_found_in_a_random_walk_of_each_run(seed: int):
    rng = np.random.default_rng(100 + seed)

    def random_walk(time: np.ndarray, *_: np.ndarray) -> np.ndarray:
        return np.cumsum(0.1 * rng.standard_normal(time.size))

    assert fit_correction(bench_runs(random_walk, seed=seed)) is None


def test_two_terms_are_told_apart_and_no_more_are_added():
    def pattern(time: np.ndarray, command: np.ndarray, _: np.ndarray) -> np.ndarray:
        return 2.0 * np.sign(command) + 0.8 * time

    found = fit_correction(bench_runs(pattern, count=8))
    assert found is not None
    chosen = {term.feature: term.coefficients[0] for term in found.terms["speed_rpm"]}
    assert chosen == {
        "sign(command)": pytest.approx(2.0, abs=0.1),
        "time in the run": pytest.approx(0.8, abs=0.05),
    }


def test_one_command_sequence_is_confirmed_by_other_runs_and_one_run_by_none():
    runs = [replace(run, group="same") for run in bench_runs(ripple)]
    assert fit_correction(runs) is not None
    assert fit_correction(runs[:1]) is None
    assert fit_correction([]) is None


def test_a_pose_is_not_tried():
    runs = [replace(run, channel="x_m", measured=run.before + 1.0) for run in bench_runs()]
    assert fit_correction(runs) is None


def test_a_robot_s_coupling_is_found():
    rng = np.random.default_rng(3)
    runs = []
    for i in range(8):
        v, theta, vc = rng.uniform(20, 90, 4), rng.uniform(-180, 180, 4), rng.uniform(-40, 40, 4)
        wheels = HeldCommand(CHANGES, command_to_wheels(v, theta, vc))
        twist = wheels_to_twist(wheels.at(TIME), Robot())
        error = 0.001 * (wheels.at(TIME) @ np.array([-1, 1, -1, 1]) / 4.0)
        measured = twist[:, 1] + error + 0.005 * rng.standard_normal(TIME.size)
        runs.append(Samples("vy_m_s", TIME, measured, twist[:, 1], twist[:, 1], wheels, group=str(i)))
    found = fit_correction(runs)
    assert found is not None
    (term,) = found.terms["vy_m_s"]
    assert term == Term("turn command", (pytest.approx(0.001, rel=0.05),))


def test_an_adopted_correction_survives_the_model_file_and_lowers_the_error(tmp_path):
    runs = bench_runs(ripple)
    found = fit_correction(runs)
    assert found is not None
    write_model(replace(paper_model(), extra={KEY: found.as_json()}), tmp_path / "model.json")
    assert "not physics" in json.loads((tmp_path / "model.json").read_text())[KEY]["what"]
    again = correction_of(read_model(tmp_path / "model.json"))
    assert again == found
    other = bench_runs(ripple, seed=9)[0]
    better = again.added("speed_rpm", other.time_s, other.wheels, other.before)
    assert np.std(other.measured - better) < 0.3 * np.std(other.measured - other.before)
    run = Run("a.csv", "a", "test", TIME, BenchCommand(other.wheels.at(TIME)[:, 0]), {})
    assert np.array_equal(again.added_to(run, {"speed_rpm": other.before})["speed_rpm"], better)
    assert np.array_equal(again.added("vx_m_s", other.time_s, other.wheels, other.before), other.before)


def test_a_model_without_a_correction_has_none():
    assert correction_of(paper_model()) is None


def test_a_broken_correction_is_refused():
    with pytest.raises(InputError, match="must hold channels"):
        correction_of(replace(paper_model(), extra={KEY: {"channels": [1]}}))
    odd = Correction({"speed_rpm": (Term("comand", (1.0,)),)}, {})
    run = bench_runs()[0]
    with pytest.raises(InputError, match='did you mean "command"'):
        odd.added("speed_rpm", run.time_s, run.wheels, run.before)


def test_formulae_have_units():
    terms = (Term("command", (-0.031,)), Term("sign(command)", (1.2,)), Term("3 x wheel angle", (0.0, -2.0)))
    assert formula("speed_rpm", terms) == (
        "-0.031 x command + 1.2 rpm x sign(command) + 2 rpm x sin(3 x wheel angle - 90 deg)"
    )
    assert formula("vx_m_s", (Term("turn command", (0.001,)),)) == "0.001 m/s per rpm x turn command"
    assert formula("speed_rpm", (Term("1", (0.5,)),)) == "0.5 rpm"
