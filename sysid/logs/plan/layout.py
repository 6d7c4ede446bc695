"""How much to record: the errors that a plan lets expect, and the shortest plan that is precise enough.

The drive is not known yet, so the errors are those of a first-order drive with a delay and friction,

    tau dw/dt = gain c(t - delay) - droop sign(w) - w,

whose speed is sampled every 10 ms with white noise: two standard errors by the Cramer-Rao bound (Ljung,
System Identification, 1999, chapter 7). A real drive has more parameters, and noise with a colour, so it is
a size, not a promise; `python -m sysid.fit` states the errors of the recorded data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import lfilter

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from sysid.logs.plan.sequences import Sequence, Size, base_sequences, steps_sequence

SAMPLE_S: Final = 0.01
"""Time between two samples of a log that the sizes are computed for [s]."""
_RISE_OVER_TAU: Final = math.log(9.0)
"""Rise time (10 to 90 %) of a first-order drive over its time constant."""
_MOST: Final = 40
"""Sequences of random steps of the longest plan."""
_PAUSE_S: Final = 5.0
"""Time between two runs, to store one and start the next [s]."""


@dataclass(frozen=True)
class Plan:
    """What to record."""

    size: Size
    sequences: tuple[Sequence, ...]
    noise_rpm: float
    """Assumed noise of a measured speed [rpm]."""
    precision_percent: float
    """Wanted error [%]."""
    errors_percent: dict[str, float]
    """Expected errors [%]: of the gain, the rise time, the delay (of the rise time), the droop (of the
    top speed)."""

    @property
    def minutes(self) -> float:
        """Time to record everything, repeats and pauses included [min]."""
        return _minutes(self.size, self.sequences)


def make_plan(
    size: Size,
    *,
    precision_percent: float = 1.0,
    noise_rpm: float | None = None,
    minutes: float | None = None,
) -> Plan:
    """Return the shortest plan that is precise enough, or the one that fills the time.

    Args:
        size: what is known of the robot.
        precision_percent: wanted error of gain, rise time, delay and droop [%].
        noise_rpm: noise of a measured speed [rpm]; None: 1 % of the top speed.
        minutes: time for the whole session [min]; None: as much as the precision needs.

    Raises:
        InputError: a number that cannot be, or a precision that the time does not give.
    """
    noise = 0.01 * size.top_rpm if noise_rpm is None else noise_rpm
    for option, value in (("--precision", precision_percent), ("--noise", noise), ("--minutes", minutes)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{option} {value:g}, must be a number above 0")
    sequences = base_sequences(size)
    fitted = [_information(size, one) for one in sequences if one.split == "fit"]
    information: FloatArray = np.sum(fitted, axis=0) / noise**2
    least, needed = _minutes(size, sequences), None
    for number in range(2, _MOST + 2):
        errors = _errors(size, information)
        if needed is None and max(errors.values()) <= precision_percent:
            needed = _minutes(size, sequences)
        more = (*sequences, steps_sequence(size, number))
        full = minutes is not None and _minutes(size, more) > minutes
        if (minutes is None and needed is not None) or full or number > _MOST:
            break
        sequences = more
        information = information + _information(size, sequences[-1]) / noise**2
    if minutes is not None and minutes < least:
        raise InputError(f"--minutes {minutes:g}: the shortest plan takes {_up(least)}; give at least that")
    if needed is None:
        enough = (
            "a longer --minutes," if minutes is not None else "a smaller --noise (a better speed sensor),"
        )
        raise InputError(
            f"--precision {precision_percent:g}: {_up(_minutes(size, sequences))} minutes give "
            f"{max(errors.values()):.2g} % with a noise of {noise:.3g} rpm; give {enough} or a coarser "
            f"--precision"
        )
    return Plan(size, _in_order(sequences), noise, precision_percent, errors)


def _in_order(sequences: Many[Sequence]) -> tuple[Sequence, ...]:
    """Return what is fitted before what is held out."""
    return tuple(sorted(sequences, key=lambda one: one.split != "fit"))


def _minutes(size: Size, sequences: Many[Sequence]) -> float:
    return sum(one.repeats * (one.duration_s(size) + _PAUSE_S) for one in sequences) / 60.0


def _up(minutes: float) -> str:
    return f"{math.ceil(10.0 * minutes) / 10.0:g}"


def _errors(size: Size, information: FloatArray) -> dict[str, float]:
    """Return two standard errors of gain, rise time, delay and droop [%] from their information, (4, 4)."""
    errors = 200.0 * np.sqrt(np.diag(np.linalg.inv(information)))
    names = ("gain", "rise time", "delay", "droop")
    scales = (1.0, 1.0 / size.rise_s, 1.0 / size.rise_s, 1.0 / size.top_rpm)
    return {n: float(e * s) for n, e, s in zip(names, errors, scales, strict=True)}


def _information(size: Size, sequence: Sequence) -> FloatArray:
    """Return the Fisher information of a sequence with its repeats for noise of 1 rpm, (4, 4).

    The parameters are gain, rise time [s], delay [s] and droop [rpm], at a gain of 1, no delay and no droop.
    """
    rows = np.arange(0.0, sequence.duration_s(size) - SAMPLE_S / 2.0, SAMPLE_S)
    command = sequence.wheels_rpm(size)[np.floor(rows / size.period_s + 1e-9).astype(int)]
    speed = _follow(command, size.rise_s)
    rise = (_follow(command, 1.01 * size.rise_s) - speed) / (0.01 * size.rise_s)
    delay = -np.gradient(speed, SAMPLE_S)
    droop = -_follow(np.sign(speed) * (np.abs(speed) > 1e-6 * size.top_rpm), size.rise_s)
    jacobian = np.column_stack([speed, rise, delay, droop])
    return np.asarray(sequence.repeats * jacobian.T @ jacobian)


def _follow(values: FloatArray, rise_s: float) -> FloatArray:
    """Return the response of a first-order drive to held values, shape (n,)."""
    pole = math.exp(-SAMPLE_S * _RISE_OVER_TAU / rise_s)
    return np.asarray(lfilter([0.0, 1.0 - pole], [1.0, -pole], values))
