"""A start for law and effects from anywhere: a motor under a PI controller, and what limits it.

A law that was fitted alone to a drive that often meets its limits imitates them with its poles, and descents
from there do not find them. Here the motor is of first order, and its controller turns the error e of a
filtered command into a voltage, which counts as the speed that it holds in the end:

    voltage = kp (e + integral(e) / Ti)

Either the voltage is bounded by `speed_saturation/supply` and the torque by `acceleration_limit/drive`, and
beyond the bounds the integral stands still, or winds up (`wheel.windup`); or the command passes a ramp with
round ends (`acceleration_limit/s_curve`) that the motor can follow. The few numbers are tried at many places
(a Sobol sequence), from the best of which they descend.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, Literal, get_args

import numpy as np
from scipy.stats import qmc

from mecanum_env.errors import MecanumError
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import descend_from_afar

Kind = Literal["anti-windup", "windup", "ramp"]
"""What limits a drive: its motor, beyond whose bounds the integral stands still or winds up, or the ramp of
its set-point, which the motor follows."""
KINDS: Final = get_args(Kind)
_Range = tuple[float, float, float, float]
_LOOP: Final[Mapping[str, _Range]] = {
    "motor_s": (0.01, 0.05, 3.0, 10.0),
    "loop_s": (0.003, 0.01, 0.3, 1.0),
    "integral_s": (0.01, 0.03, 1.0, 3.0),
    "filter_s": (0.002, 0.002, 0.1, 0.5),
    "delay_s": (0.001, 0.002, 0.1, 0.3),
    "gain": (0.5, 0.9, 1.1, 2.0),
    "rise_s": (0.02, 0.05, 2.0, 5.0),
    "brake": (0.25, 0.7, 1.4, 4.0),
}
"""Range of each number, and between them that of plausible ones, which are tried; all on a logarithmic scale.

`loop_s` is motor_s / kp, the time constant of the loop around a motor that hardly slows down by itself.
`rise_s` is the time in which the largest torque, or the ramp, brings the wheel to the top speed, and `brake`
the ratio of that rate while it brakes. Assumed.
"""
_MOTOR: Final[Mapping[str, _Range]] = {"ceiling": (0.8, 0.95, 1.6, 4.0), "supply_s": (0.003, 0.01, 0.5, 2.0)}
"""The same for the motor: the speed of the full voltage in top speeds, and the motor's time constant at that
voltage, which a controller of its current hides."""
_RAMP: Final[Mapping[str, _Range]] = {"jerk_s": (0.001, 0.002, 0.3, 1.0)}
"""The same for the ramp: the time in which it reaches its rate."""
_TRIED: Final = 512
_DESCENDED: Final = 12
_BEST: Final = 3
"""Places that are tried, a power of two, those from which the numbers descend, and those that go on. Assumed:
some seconds for a fit."""
_STEPS: Final = 12
_LAST_STEPS: Final = 30
_ASTRAY: Final = 1e3
"""Every residual of a drive that cannot be simulated."""


def pi_drive(
    alone: Model, top_rpm: float, kind: Kind, residual: Callable[[Model], FloatArray | None]
) -> Model:
    """Return the model with the law of a PI loop, and limits of some `kind`, that leaves least.

    `alone` gives the rest of the model, and `top_rpm` is the largest speed of the logs; the `residual` of a
    model is None if it cannot be simulated.
    """
    law_alone = residual(alone)
    if law_alone is None:
        return alone
    astray = np.full(law_alone.size, _ASTRAY)
    ranges = {**_LOOP, **(_RAMP if kind == "ramp" else _MOTOR)}
    low, first, last, high = np.log(np.array(list(ranges.values()))).T

    def model_at(place: FloatArray) -> Model:
        numbers = dict(zip(ranges, np.exp(low + (high - low) * place).tolist(), strict=True))
        return _model(alone, top_rpm, kind, numbers)

    def left(place: FloatArray) -> FloatArray:
        try:
            found = residual(model_at(place))
        except MecanumError:
            # The loop is unstable.
            return astray
        return astray if found is None else found

    shares = np.asarray(qmc.Sobol(len(ranges), rng=np.random.default_rng(0)).random(_TRIED), float)
    places = (first - low + shares * (last - first)) / (high - low)
    costs = [float(np.sum(left(place) ** 2)) for place in places]
    coarse = [descend_from_afar(left, places[i], 1e-2, _STEPS) for i in np.argsort(costs)[:_DESCENDED]]
    coarse.sort(key=lambda one: one[0])
    fine = [descend_from_afar(left, place, 1e-3, _LAST_STEPS) for _, place in coarse[:_BEST]]
    return model_at(min(fine, key=lambda one: one[0])[1])


def _model(alone: Model, top_rpm: float, kind: Kind, numbers: Mapping[str, float]) -> Model:
    """Return the model of a PI loop with limits of some kind."""
    motor_s, kp = numbers["motor_s"], numbers["motor_s"] / numbers["loop_s"]
    times = numbers["integral_s"], numbers["filter_s"]
    law = pi_law(alone.wheel.law.sample_period_s, motor_s, kp, *times).require_stable()
    rise = top_rpm / numbers["rise_s"]
    rates = {"limit_rpm_s": rise, "brake_rpm_s": numbers["brake"] * rise}
    effects: dict[str, dict[str, float]] = {
        "command_latency": {"delay_s": numbers["delay_s"]},
        "speed_gain": {"gain": numbers["gain"]},
    }
    if kind == "ramp":
        effects["acceleration_limit/s_curve"] = {**rates, "jerk_rpm_s2": rise / numbers["jerk_s"]}
    else:
        effects["acceleration_limit/drive"] = rates
        ceiling_rpm = top_rpm * numbers["ceiling"]
        effects["speed_saturation/supply"] = {"limit_rpm": ceiling_rpm, "motor_s": numbers["supply_s"]}
    wheel = replace(alone.wheel, law=law, windup=1.0 if kind == "windup" else 0.0)
    return replace(alone, wheel=wheel, effects=effects, uncertainty={})


def pi_law(tick_s: float, motor_s: float, kp: float, integral_s: float, filter_s: float) -> WheelLaw:
    """Return the law of a motor of first order under a PI controller that computes in every tick.

    `tick_s` is the tick [s], `motor_s` the motor's time constant, `kp` the gain from the error to the speed
    that the voltage holds in the end, `integral_s` the time in which the integral adds as much, and
    `filter_s` the time constant of the filter of the command.
    """
    pole, lag = math.exp(-tick_s / motor_s), math.exp(-tick_s / filter_s)
    ki = kp * tick_s / integral_s
    # w(k+1) = pole w(k) + (1 - pole) v(k), v(k) = v(k-1) + kp (e(k) - e(k-1)) + ki e(k), e = u - w
    of_speed = np.array([1.0 + pole - (1.0 - pole) * (kp + ki), (1.0 - pole) * kp - pole, 0.0])
    of_command = np.array([(1.0 - pole) * (kp + ki), -(1.0 - pole) * kp, 0.0])
    delayed = np.array([lag, -lag * of_speed[0], -lag * of_speed[1]])
    return WheelLaw.from_coefficients([*(of_speed + delayed), *((1.0 - lag) * of_command)], tick_s)
