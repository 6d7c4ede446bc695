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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from scipy.stats import qmc

from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.simulator.free_wheel import EffectNumbers
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import descend_from_many

ResidualsOf: TypeAlias = Callable[[Model, FloatArray, EffectNumbers], Sequence[FloatArray | None]]
"""Residuals (N,) of several drives: a model, their laws A-F (6, m), and the numbers of their effects."""
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
"""Places that are tried, a power of two, and those from which the numbers descend. Assumed: some seconds for
a fit."""
_ASTRAY: Final = 1e3
"""Every residual of a drive that cannot be simulated."""
_AT_ONCE: Final = 16
"""Drives that are simulated together, of those that are tried: their motions take much memory."""


def pi_drive(alone: Model, top_rpm: float, kind: Kind, residuals_of: ResidualsOf) -> Model:
    """Return the model with the law of a PI loop, and limits of some `kind`, that leaves least.

    `alone` gives the rest of the model, and `top_rpm` is the largest speed of the logs; the residual of a
    drive that cannot be simulated is None. If none can, the model is returned as it is.
    """
    ranges = {**_LOOP, **(_RAMP if kind == "ramp" else _MOTOR)}
    low, first, last, high = np.log(np.array(list(ranges.values()))).T
    tick_s, windup = alone.wheel.law.sample_period_s, 1.0 if kind == "windup" else 0.0
    plain = replace(alone, wheel=replace(alone.wheel, windup=windup), effects={}, uncertainty={})

    def drives_at(places: FloatArray) -> tuple[FloatArray, EffectNumbers]:
        numbers = dict(zip(ranges, np.exp(low + (high - low) * places).T, strict=True))
        return _laws(tick_s, numbers), _effects(top_rpm, kind, numbers)

    def model_at(place: FloatArray) -> Model:
        laws, effects = drives_at(place[None])
        wheel = replace(plain.wheel, law=WheelLaw.from_coefficients(laws[:, 0], tick_s))
        values = {name: {key: float(v[0]) for key, v in given.items()} for name, given in effects.items()}
        return replace(plain, wheel=wheel, effects=values)

    def left(places: FloatArray) -> FloatArray:
        found = residuals_of(plain, *drives_at(places))
        return np.stack([astray if one is None else one for one in found])

    shares = np.asarray(qmc.Sobol(len(ranges), rng=np.random.default_rng(0)).random(_TRIED), float)
    places = (first - low + shares * (last - first)) / (high - low)
    parts = np.split(places, _TRIED // _AT_ONCE)
    tried = [one for part in parts for one in residuals_of(plain, *drives_at(part))]
    size = next((one.size for one in tried if one is not None), 0)
    if not size:
        return alone
    astray = np.full(size, _ASTRAY)
    costs = [float(np.sum((astray if one is None else one) ** 2)) for one in tried]
    _, best = descend_from_many(left, [places[i] for i in np.argsort(costs)[:_DESCENDED]])
    return model_at(best)


def _laws(tick_s: float, numbers: Mapping[str, FloatArray]) -> FloatArray:
    """Return the coefficients A-F of PI loops with some `numbers` (m,), shape (6, m)."""
    kp = numbers["motor_s"] / numbers["loop_s"]
    return _coefficients(tick_s, numbers["motor_s"], kp, numbers["integral_s"], numbers["filter_s"])


def _effects(top_rpm: float, kind: Kind, numbers: Mapping[str, FloatArray]) -> EffectNumbers:
    """Return the effects of drives of some `kind` with some `numbers` (m,): their delay, gain and limits."""
    rise = top_rpm / numbers["rise_s"]
    rates = {"limit_rpm_s": rise, "brake_rpm_s": numbers["brake"] * rise}
    both = {
        "command_latency": {"delay_s": numbers["delay_s"]},
        "speed_gain": {"gain": numbers["gain"]},
    }
    if kind == "ramp":
        return {**both, "acceleration_limit/s_curve": {**rates, "jerk_rpm_s2": rise / numbers["jerk_s"]}}
    supply = {"limit_rpm": top_rpm * numbers["ceiling"], "motor_s": numbers["supply_s"]}
    return {**both, "acceleration_limit/drive": rates, "speed_saturation/supply": supply}


def pi_law(tick_s: float, motor_s: float, kp: float, integral_s: float, filter_s: float) -> WheelLaw:
    """Return the law of a motor of first order under a PI controller that computes in every tick.

    `tick_s` is the tick [s], `motor_s` the motor's time constant, `kp` the gain from the error to the speed
    that the voltage holds in the end, `integral_s` the time in which the integral adds as much, and
    `filter_s` the time constant of the filter of the command.
    """
    numbers = (np.asarray(one) for one in (motor_s, kp, integral_s, filter_s))
    return WheelLaw.from_coefficients(_coefficients(tick_s, *numbers), tick_s)


def _coefficients(
    tick_s: float, motor_s: FloatArray, kp: FloatArray, integral_s: FloatArray, filter_s: FloatArray
) -> FloatArray:
    """Return the coefficients A-F of what `pi_law` returns, shape (6, ...)."""
    pole, lag = np.exp(-tick_s / motor_s), np.exp(-tick_s / filter_s)
    ki = kp * tick_s / integral_s
    # w(k+1) = pole w(k) + (1 - pole) v(k), v(k) = v(k-1) + kp (e(k) - e(k-1)) + ki e(k), e = u - w
    a, b = 1.0 + pole - (1.0 - pole) * (kp + ki), (1.0 - pole) * kp - pole
    d, e = (1.0 - pole) * (kp + ki), -(1.0 - pole) * kp
    rest = 1.0 - lag
    return np.stack([a + lag, b - lag * a, -lag * b, rest * d, rest * e, np.zeros_like(a)])
