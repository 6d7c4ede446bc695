"""A drive under PI control is found from its residual alone, and with it whether its integral winds up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, EffectNumbers, FreeWheels
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.fit.effects.pi_drive import KINDS, Kind, pi_drive, pi_law
from sysid.logs import BenchCommand, Dataset, Run, Split

TIME_S = np.arange(240) / 100.0
COMMAND_RPM = np.repeat([0.0, 90.0, -40.0, 20.0, 110.0, -110.0, 0.0, 60.0], 30)
SPLITS: tuple[Split, ...] = ("fit", "fit", "fit", "validation", "test")


def limited_drive(windup: float) -> Model:
    """Return a drive whose motor needs 0.5 s for a large step, of which its controller knows nothing."""
    wheel = replace(paper_model().wheel, law=pi_law(0.01, 0.3, 8.0, 0.15, 0.01), windup=windup)
    model = replace(paper_model(), wheel=wheel).with_effect("acceleration_limit/drive", limit_rpm_s=450.0)
    return model.with_effect("speed_saturation/supply", limit_rpm=150.0, motor_s=0.1)


def speeds(model: Model) -> np.ndarray:
    """Return the speeds [rpm] of a wheel on the bench, shape (240,)."""
    return replay_bench(model, TIME_S, COMMAND_RPM)


def ramped_drive() -> Model:
    """Return a drive whose set-point is an S-curve that its motor follows."""
    wheel = replace(paper_model().wheel, law=pi_law(0.01, 0.3, 8.0, 0.15, 0.01))
    rates = {"limit_rpm_s": 350.0, "jerk_rpm_s2": 3500.0, "brake_rpm_s": 500.0}
    return replace(paper_model(), wheel=wheel).with_effect("acceleration_limit/s_curve", **rates)


@pytest.mark.parametrize(
    ("kind", "true"),
    [("anti-windup", limited_drive(0.0)), ("windup", limited_drive(1.0)), ("ramp", ramped_drive())],
)
def test_of_three_kinds_of_drive_the_right_one_leaves_least(kind: Kind, true: Model) -> None:
    measured = speeds(true)
    runs = BenchRuns([BenchRun(TIME_S, COMMAND_RPM, TIME_S[-1])])

    def residuals_of(model: Model, laws: np.ndarray, effects: EffectNumbers) -> list[np.ndarray | None]:
        motions = FreeWheels.of(model, laws, effects).motions(runs)
        return [None if one is None else np.interp(TIME_S, *one[0]) - measured for one in motions]

    top_rpm = float(np.max(np.abs(measured)))
    found = {tried: pi_drive(paper_model(), top_rpm, tried, residuals_of) for tried in KINDS}
    assert [model.wheel.windup for model in found.values()] == [0.0, 1.0, 0.0]
    left = {tried: float(np.std(speeds(model) - measured)) for tried, model in found.items()}
    assert min(left, key=lambda tried: left[tried]) == kind
    assert left[kind] < 0.05 * float(np.std(measured))
    assert left[kind] < 0.5 * sorted(left.values())[1]


def test_a_drive_that_cannot_be_simulated_leaves_the_law_as_it_is() -> None:
    alone = paper_model()
    assert pi_drive(alone, 100.0, "ramp", lambda _, laws, __: [None] * laws.shape[1]) is alone


def test_the_law_of_a_pi_loop_has_a_gain_of_one() -> None:
    law = pi_law(0.01, motor_s=0.3, kp=5.0, integral_s=0.2, filter_s=0.05)
    assert law.dc_gain == pytest.approx(1.0)
    assert np.max(np.abs(law.poles)) < 1.0
    # With a slow integral and a fast filter the loop is of first order, with motor_s / (kp + 1).
    slow = pi_law(0.001, motor_s=0.3, kp=5.0, integral_s=1e6, filter_s=1e-6)
    speed = slow.simulate(np.ones(400))
    assert speed[50] / speed[-1] == pytest.approx(1.0 - math.exp(-0.05 / (0.3 / 6.0)), abs=0.01)


def test_a_fit_tells_an_integral_that_winds_up() -> None:
    true, rng, runs = limited_drive(1.0), np.random.default_rng(0), []
    for number, split in enumerate(SPLITS):
        levels = np.concatenate([[0], rng.integers(-110, 111, 7)]).astype(float)
        command = np.repeat(levels, 30)
        speed = replay_bench(true, TIME_S, command)
        for repeat in (1, 2):
            measured = speed + 0.3 * rng.standard_normal(speed.size)
            name = f"run_{number}_{repeat}.csv"
            runs.append(Run(name, f"{number}", split, TIME_S, BenchCommand(command), {"speed_rpm": measured}))
    fit = fit_dataset(Dataset("made", tuple(runs), ()), FitOptions(starts=2))
    found = fitted_model(fit)
    assert found.wheel.windup == 1.0
    assert fit.drive_effects is not None
    assert "winds up at the motor's bounds" in fit.drive_effects.note
    assert fit.drive_effects.after_rpm < 0.2 * fit.drive_effects.before_rpm
    untouched = runs[-1]
    predicted = replay_bench(found, TIME_S, untouched.command.wheels_rpm[:, 0])
    assert float(np.std(predicted - untouched.channels["speed_rpm"])) < 2.0
