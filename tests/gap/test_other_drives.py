"""A drive that shares no code with ours: a brushed motor under a PI loop, changed in one way each.

Its wheel stands at the same angle before every run, its loop runs at 1 kHz, and its current and voltage are
limited; the law of this project describes it only roughly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import pytest

from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run, Split

pytestmark = pytest.mark.slow

_STEP_S: Final = 5e-4
_SPLITS: Final[tuple[Split, ...]] = ("fit", "fit", "validation", "fit", "fit", "test")
_OHM, _VOLT_S, _VOLT, _AMPERE = 1.0, 0.5, 24.0, 20.0
_PROPORTIONAL, _INTEGRAL = 1.2, 10.0  # [V s/rad], [V/rad]


@dataclass(frozen=True)
class Motor:
    """What may change of the drive."""

    late_s: float = 0.02
    dead_rpm: float = 0.0
    gain: float = 1.0
    reverse: float = 1.0
    ceiling_rpm: float = 135.0
    slew_rpm_s: float = math.inf
    inertia_kg_m2: float = 0.05
    viscous: float = 0.02
    coulomb_n_m: float = 0.1
    cold: float = 0.0
    """Share by which a cold bearing's Coulomb friction is larger; it warms up within some 4 s."""
    lag_s: float = 0.0
    uneven: float = 0.0

    def set_point_rpm(self, command: float) -> float:
        """Return what the loop is told of a command."""
        heard = 0.0 if abs(command) < self.dead_rpm else command
        scaled = heard * self.gain * (self.reverse if heard < 0.0 else 1.0)
        return max(-self.ceiling_rpm, min(self.ceiling_rpm, scaled))

    def speed_rpm(self, command: FloatArray) -> FloatArray:
        """Return the measured speed (n,) for a command (n,), both once a step."""
        late = round(self.late_s / _STEP_S)
        speed = angle = wound = volt = followed = shown = 0.0
        measured = np.empty(command.size)
        for i in range(command.size):
            if i % 2 == 0:
                most = self.slew_rpm_s * 2.0 * _STEP_S
                wanted = self.set_point_rpm(float(command[max(0, i - late)]))
                followed = max(followed - most, min(followed + most, wanted))
                off = followed * RAD_S_PER_RPM - speed
                asked = _PROPORTIONAL * off + _INTEGRAL * wound
                volt = max(-_VOLT, min(_VOLT, asked))
                wound += off * 2.0 * _STEP_S if volt == asked else 0.0
            current = max(-_AMPERE, min(_AMPERE, (volt - _VOLT_S * speed) / _OHM))
            torque = _VOLT_S * current - self.viscous * speed
            coulomb = self.coulomb_n_m * (1.0 + self.cold * math.exp(-i * _STEP_S / 4.0))
            if abs(speed) < 0.02 and abs(torque) < coulomb:
                speed = 0.0
            else:
                rubs = math.copysign(coulomb, speed if abs(speed) >= 0.02 else torque)
                after = speed + _STEP_S * (torque - rubs) / self.inertia_kg_m2
                speed = 0.0 if after * speed < 0.0 and abs(torque) < coulomb else after
            angle += speed * _STEP_S
            seen = speed * (1.0 + self.uneven * math.sin(angle)) / RAD_S_PER_RPM
            shown = seen if self.lag_s == 0.0 else shown + (seen - shown) * _STEP_S / self.lag_s
            measured[i] = shown
        return measured


def logs_of(motor: Motor, seed: int) -> Dataset:
    """Return two noisy runs of each of six sequences of steps between -130 and 130 rpm."""
    rng, runs = np.random.default_rng(seed), []
    for i, split in enumerate(_SPLITS):
        levels = np.concatenate([[0.0], 10.0 * rng.integers(-13, 14, 7), [0.0]])
        held = np.concatenate([[3], rng.integers(4, 10, 7), [8]])
        command = np.repeat(np.repeat(levels, held), round(0.1 / _STEP_S))
        rows = np.arange(0, command.size, round(0.01 / _STEP_S))
        speed, log = motor.speed_rpm(command)[rows], BenchCommand(command[rows])
        for k in range(2):
            channels = {"speed_rpm": speed + 0.4 * rng.standard_normal(rows.size)}
            runs.append(Run(f"{i}_{k}.csv", f"{i}", split, rows * _STEP_S, log, channels))
    return Dataset("motor", tuple(runs), ())


@pytest.fixture(scope="module")
def of_fit() -> Dataset:
    return logs_of(Motor(), 1)


@pytest.fixture(scope="module")
def model(of_fit: Dataset) -> Model:
    return fitted_model(fit_dataset(of_fit, FitOptions()))


def study(motor: Motor, model: Model, of_fit: Dataset) -> GapReport:
    return analyse(logs_of(motor, 7), model, GapOptions(next_experiment=False, fitted_on=of_fit))


def closure(report: GapReport) -> float:
    """Return the share of the error above the noise that a study removes on runs it has not seen."""
    noise = report.gap.noise_floor or 0.0
    return (report.gap.before - report.gap.after) / (report.gap.before - noise)


def test_an_unchanged_motor_has_no_gap(model: Model, of_fit: Dataset) -> None:
    assert study(Motor(), model, of_fit).verdict == "no_gap"


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        (Motor(late_s=0.07), "command_latency"),
        (Motor(dead_rpm=25.0), "command_deadband"),
        (Motor(gain=0.93), "speed_gain"),
        (Motor(reverse=0.92), "direction_asymmetry"),
        (Motor(ceiling_rpm=95.0), "speed_saturation"),
        (Motor(slew_rpm_s=400.0), "acceleration_limit"),
        (Motor(coulomb_n_m=0.5), "coulomb_friction"),
        (Motor(viscous=0.07), "viscous_friction"),
        (Motor(inertia_kg_m2=0.09), "load_inertia"),
        (Motor(lag_s=0.04), "sensor_lowpass"),
    ],
)
def test_a_change_is_named_or_tied_with_what_looks_alike(
    changed: Motor, name: str, model: Model, of_fit: Dataset
) -> None:
    """A late command looks like a late sensor, a gain like a sensor's scale; nothing else is tied."""
    twins = {"command_latency": "sensor_latency", "speed_gain": "sensor_scale"}
    report = study(changed, model, of_fit)
    assert {(name,)} <= set(report.candidates) <= {(name,), (twins.get(name, name),)}
    assert closure(report) > 0.9


def test_a_cold_bearing_of_a_drive_that_was_fitted_warm_is_one_effect(model: Model, of_fit: Dataset) -> None:
    report = study(Motor(cold=3.0), model, of_fit)
    assert report.candidates == (("warm_up",),)
    values = {name: found.value for name, found in report.effects[0].parameters.items()}
    assert values == {"share": pytest.approx(3.0, rel=0.15), "time_constant_s": pytest.approx(4.0, rel=0.2)}
    assert closure(report) > 0.8


def test_an_uneven_encoder_is_as_uneven_as_it_is(model: Model, of_fit: Dataset) -> None:
    report = study(Motor(uneven=0.05), model, of_fit)
    assert report.candidates == (("encoder_eccentricity",),)
    assert report.effects[0].parameters["share"].value == pytest.approx(0.05, abs=0.002)
    assert closure(report) > 0.9
