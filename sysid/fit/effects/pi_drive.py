"""A start for law and effects from anywhere: a motor of limited voltage and torque under a PI controller.

A law that was fitted alone to a drive that often meets its limits imitates them with its poles, and descents
from there do not find them. Here the motor is of first order, and its controller turns the error e of a
filtered command into a voltage, which counts as the speed that it holds in the end:

    voltage = kp (e + integral(e) / Ti)

The voltage is bounded by `speed_saturation/supply`, the torque by `acceleration_limit/drive`. Beyond the
bounds the integral stands still, or winds up (`wheel.windup`). The few numbers are tried at many places
(a Sobol sequence), from the best of which they descend.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import qmc

from mecanum_env.errors import MecanumError
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import descend_from_afar

WINDUPS: Final = (0.0, 1.0)
"""Values of `wheel.windup` that are tried: with anti-windup and without."""
_RANGES: Final[Mapping[str, tuple[float, float, float, float]]] = {
    "motor_s": (0.01, 0.05, 3.0, 10.0),
    "loop_s": (0.003, 0.01, 0.3, 1.0),
    "integral_s": (0.01, 0.03, 1.0, 3.0),
    "filter_s": (0.002, 0.002, 0.1, 0.5),
    "delay_s": (0.001, 0.002, 0.1, 0.3),
    "gain": (0.5, 0.9, 1.1, 2.0),
    "rise_s": (0.02, 0.05, 2.0, 5.0),
    "brake": (0.25, 0.7, 1.4, 4.0),
    "ceiling": (0.8, 0.95, 1.6, 4.0),
    "supply_s": (0.003, 0.01, 0.5, 2.0),
}
"""Range of each number, and between them that of plausible ones, which are tried; all on a logarithmic scale.

`loop_s` is motor_s / kp, the time constant of the loop around a motor that hardly slows down by itself.
`rise_s` is the time in which the largest torque brings the wheel to the top speed, and `brake` the ratio of
the torque while it brakes. `ceiling` is the speed of the full voltage in top speeds, and `supply_s` the time
constant of the motor at that voltage, which a controller of its current hides. Assumed.
"""
_ENDS: Final = np.log(np.array(list(_RANGES.values()))).T
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
    alone: Model, top_rpm: float, windup: float, residual: Callable[[Model], FloatArray | None]
) -> Model:
    """Return the model with the law of a PI loop and the bounds of its motor that leaves least.

    `alone` gives the rest of the model, `top_rpm` is the largest speed of the logs, and `windup` is as in
    `Wheel`; the `residual` of a model is None if it cannot be simulated.
    """
    law_alone = residual(alone)
    if law_alone is None:
        return alone
    astray = np.full(law_alone.size, _ASTRAY)

    def left(place: FloatArray) -> FloatArray:
        try:
            found = residual(_model(alone, top_rpm, windup, place))
        except MecanumError:
            # The loop is unstable.
            return astray
        return astray if found is None else found

    shares = np.asarray(qmc.Sobol(len(_RANGES), rng=np.random.default_rng(0)).random(_TRIED), float)
    low, first, last, high = _ENDS
    places = (first - low + shares * (last - first)) / (high - low)
    costs = [float(np.sum(left(place) ** 2)) for place in places]
    coarse = [descend_from_afar(left, places[i], 1e-2, _STEPS) for i in np.argsort(costs)[:_DESCENDED]]
    coarse.sort(key=lambda one: one[0])
    fine = [descend_from_afar(left, place, 1e-3, _LAST_STEPS) for _, place in coarse[:_BEST]]
    return _model(alone, top_rpm, windup, min(fine, key=lambda one: one[0])[1])


def _model(alone: Model, top_rpm: float, windup: float, place: FloatArray) -> Model:
    """Return the model of a PI loop at a place between the ends of `_RANGES`, (10,)."""
    low, _, _, high = _ENDS
    numbers = dict(zip(_RANGES, np.exp(low + (high - low) * place).tolist(), strict=True))
    motor_s, kp = numbers["motor_s"], numbers["motor_s"] / numbers["loop_s"]
    times = numbers["integral_s"], numbers["filter_s"]
    law = pi_law(alone.wheel.law.sample_period_s, motor_s, kp, *times)
    wheel = replace(alone.wheel, law=law.require_stable(), windup=windup)
    rise = top_rpm / numbers["rise_s"]
    effects: dict[str, dict[str, float]] = {
        "command_latency": {"delay_s": numbers["delay_s"]},
        "speed_gain": {"gain": numbers["gain"]},
        "acceleration_limit/drive": {"limit_rpm_s": rise, "brake_rpm_s": numbers["brake"] * rise},
        "speed_saturation/supply": {
            "limit_rpm": top_rpm * numbers["ceiling"],
            "motor_s": numbers["supply_s"],
        },
    }
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
