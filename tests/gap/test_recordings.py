"""However logs are recorded, a right model has no gap, and a gain of the drives that is 5 % less is found."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
import pytest

from mecanum_env.model import Model, cause_of, paper_model
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import FloatArray
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, Split

MODEL = paper_model()
SLOWER = MODEL.with_effect("speed_gain", gain=0.95)
SPLITS: tuple[Split, ...] = ("fit", "fit", "validation", "fit", "test")
Beginning: TypeAlias = Literal["at rest", "with a step", "in motion"]
_CUT_S = 0.9  # of a recording that begins in motion


def held(rng: np.random.Generator, most: int) -> FloatArray:
    """Return six levels from -most to most, each held for 0.3 to 0.8 s, one value every 0.1 s, and rest."""
    levels = rng.integers(-most, most + 1, 6).astype(float)
    return np.append(np.repeat(levels, rng.integers(3, 9, 6)), np.zeros(5))


def begun(values: FloatArray, beginning: Beginning) -> FloatArray:
    """Return commands after 0.3 s of rest, unless they begin with a step."""
    return np.concatenate([np.zeros((3, *values.shape[1:])), values]) if beginning == "at rest" else values


def bench_logs(model: Model, beginning: Beginning, interval_s: float, rows_late_s: float) -> Dataset:
    """Return what a model does on the bench, two noisy runs of each command sequence.

    Rows come every `interval_s`, each late by up to `rows_late_s`.
    """
    rng, runs = np.random.default_rng(3), []
    for i, split in enumerate(SPLITS):
        sent = begun(held(rng, 120), beginning)
        fine = 0.001 * np.arange(100 * sent.size)
        time = np.arange(0.0, fine[-1], interval_s)
        time[1:] += rng.uniform(0.0, rows_late_s, time.size - 1)
        command = sent[np.floor(10.0 * fine + 1e-6).astype(int)]
        speed = replay_bench(model, fine, command, sample_times_s=time)
        shown = sent[np.floor(10.0 * time + 1e-6).astype(int)]
        kept = time >= (_CUT_S if beginning == "in motion" else 0.0)
        for k in range(2):
            measured = speed[kept] + 0.5 * rng.standard_normal(int(kept.sum()))
            stamps = time[kept] - time[kept][0]
            log = BenchCommand(shown[kept])
            runs.append(Run(f"{i}_{k}.csv", f"{i}", split, stamps, log, {"speed_rpm": measured}))
    return Dataset("bench", tuple(runs), ())


@pytest.mark.parametrize(
    ("beginning", "interval_s", "rows_late_s"),
    [
        ("at rest", 0.01, 0.0),
        ("with a step", 0.01, 0.0),
        ("in motion", 0.01, 0.0),
        ("with a step", 0.1, 0.0),
        ("with a step", 0.03, 0.0),
        ("at rest", 0.01, 0.004),
    ],
)
def test_a_wheel(beginning: Beginning, interval_s: float, rows_late_s: float) -> None:
    options = GapOptions(next_experiment=False)
    quiet = analyse(bench_logs(MODEL, beginning, interval_s, rows_late_s), MODEL, options)
    assert quiet.verdict == "no_gap"
    found = analyse(bench_logs(SLOWER, beginning, interval_s, rows_late_s), MODEL, options)
    assert ("speed_gain",) in found.candidates
    assert found.gap.after < 1.1 * quiet.gap.after


NOISE = {
    "_rpm": 0.5,
    "x_m_s": 0.005,
    "y_m_s": 0.005,
    "rad_s": 0.01,
    "x_m": 0.002,
    "y_m": 0.002,
    "_rad": 0.002,
}
"""End of a channel's name -> standard deviation of its noise."""


def robot_logs(model: Model, beginning: Beginning, noise: float = 1.0, seed: int = 1) -> Dataset:
    """Return what a model does on the planar plant with a shorter physics step than that of a study.

    Its sensors have `noise` times that of `NOISE`; `seed` draws commands and noise.
    """
    rng, runs = np.random.default_rng(seed), []
    for i, split in enumerate(SPLITS):
        v, vc = np.abs(held(rng, 110)), held(rng, 40)
        size = min(v.size, vc.size)
        theta = np.repeat(rng.integers(-180, 180, size), 4)[:size].astype(float)
        rows = begun(np.stack([v[:size], theta, vc[:size]], axis=1), beginning)
        commands = BodyCommands(0.1 * np.arange(len(rows)), *rows.T)
        path = drive(model, commands, 0.1 * len(rows), plant="planar", timestep_s=1 / 1000)
        time = np.arange(_CUT_S if beginning == "in motion" else 0.0, 0.1 * len(rows) - 0.02, 0.02)
        shown = commands.at(time)
        for k in range(2):
            channels = {
                name: values + noise * sigma * rng.standard_normal(time.size)
                for name, values in path.channels_at(time).items()
                for sigma in [next(s for end, s in NOISE.items() if name.endswith(end))]
            }
            runs.append(Run(f"{i}_{k}.csv", f"{i}", split, time - time[0], BodyCommand(*shown.T), channels))
    return Dataset("robot", tuple(runs), ())


def robot_study(model: Model, beginning: Beginning, noise: float = 1.0) -> GapReport:
    drives, body = ("speed_gain", "coulomb_friction"), ("payload", "com_offset", "wheel_radius")
    looked_for = (*drives, *body, "mount_yaw", "sensor_latency")
    options = GapOptions(only=looked_for, plant="planar", next_experiment=False)
    return analyse(robot_logs(model, beginning, noise), MODEL, options)


@pytest.mark.parametrize("beginning", ["at rest", "with a step", "in motion"])
def test_a_robot(beginning: Beginning) -> None:
    quiet = robot_study(MODEL, beginning)
    assert quiet.verdict == "no_gap"
    found = robot_study(SLOWER, beginning)
    assert (found.verdict, found.candidates) == ("named", (("speed_gain",),))


def test_a_load_of_a_fifth_is_named_on_logs_that_begin_with_a_step() -> None:
    found = robot_study(MODEL.with_effect("payload", mass_kg=4.0), "with a step")
    assert (found.verdict, found.candidates) == ("named", (("payload",),))
    mass = found.effects[0].parameters["mass_kg"]
    assert mass.low < 4.0 < mass.high


@pytest.mark.parametrize(("form", "angle_deg"), [("body", 2.0), ("pose", -2.0)])
def test_of_two_sensors_the_one_that_is_turned_is_told(form: str, angle_deg: float) -> None:
    found = robot_study(MODEL.with_effect("mount_yaw", form, angle_deg=angle_deg), "with a step")
    assert (found.verdict, found.candidates) == ("named", (("mount_yaw",),))
    assert found.effects[0].form == form
    assert found.effects[0].parameters["angle_deg"].value == pytest.approx(angle_deg, abs=0.3)


def test_a_robot_in_logs_without_any_noise() -> None:
    assert robot_study(MODEL, "with a step", noise=0.0).verdict == "no_gap"
    assert ("speed_gain",) in robot_study(SLOWER, "with a step", noise=0.0).candidates


MEASURED = ("mass_kg", "wheel_radius_m", "half_wheelbase_m", "half_track_m", "rollers_per_wheel")
"""What a ruler and a scale tell of a robot."""


@pytest.fixture(scope="module")
def of_fit() -> Dataset:
    return robot_logs(MODEL, "at rest", seed=3)


@pytest.fixture(scope="module")
def fitted(of_fit: Dataset) -> Model:
    """Return a model of the robot that was fitted to its logs, whose commands exceed its ceiling."""
    return fitted_model(fit_dataset(of_fit, FitOptions(robot=MODEL.robot, robot_given=MEASURED)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "parameter", "value", "within"),
    [
        ("payload", "mass_kg", 4.0, 1.5),
        ("wheel_radius", "scale", 1.02, 0.012),
        ("mount_yaw", "angle_deg", 1.0, 0.3),
        ("coulomb_friction", "torque_n_m", 0.1, 0.03),
    ],
)
def test_a_small_change_of_a_fitted_robot_is_found(
    fitted: Model, of_fit: Dataset, effect: str, parameter: str, value: float, within: float
) -> None:
    """The commands are others than those of the fit; the change alone explains what they show."""
    logs = robot_logs(MODEL.with_effect(effect, **{parameter: value}), "with a step", seed=9)
    options = GapOptions(plant="planar", fitted_on=of_fit, next_experiment=False)
    report = analyse(logs, fitted, options)
    assert report.verdict in ("named", "ambiguous")
    assert (effect,) in report.candidates
    found = next(one for one in report.effects if cause_of(one.name) == effect)
    assert found.parameters[parameter].value == pytest.approx(value, abs=within)


@pytest.mark.slow
def test_a_fitted_robot_that_nothing_was_changed_on_has_no_gap(fitted: Model, of_fit: Dataset) -> None:
    options = GapOptions(plant="planar", fitted_on=of_fit, next_experiment=False)
    assert analyse(robot_logs(MODEL, "with a step", seed=9), fitted, options).verdict == "no_gap"
