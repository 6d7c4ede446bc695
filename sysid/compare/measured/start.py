"""How a run starts, according to its first samples: at rest, or already moving; and where a robot stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import POSE, WHEEL_SPEEDS
from mecanum_env.statistics import MEDIAN_OF_NORMAL
from mecanum_env.units import FloatArray
from sysid.logs import Run
from sysid.logs.first_samples import speed_at_start
from sysid.logs.runs import REST

_FIRST_S: Final = 0.05
"""The samples of this first time [s], or the first three, show how a run starts."""
_LATE: Final = 3.5
"""Sampling intervals after which a sample no longer shows how a run starts, if earlier cells are empty."""
_LINE: Final = 3  # samples through which a line is drawn
_TOO_FEW: Final = 20  # samples to measure a channel's noise


@dataclass(frozen=True)
class Start:
    """How a run starts, according to its first samples."""

    initial_rpm: float = 0.0
    """Bench: the wheel's steady speed [rpm]."""
    moving: bool = False
    """Robot: whether it is already driving."""
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    """Robot: its pose in the world [m, m, rad]."""
    wheels_rpm: tuple[float, ...] = ()
    """Robot: the speeds of its wheels where it is already driving and all are measured, in whole rpm, so that
    repeats start alike."""


def start_of(run: Run) -> Start:
    """Return how a run starts: at rest, unless its first samples significantly differ from that."""
    speeds = {
        name: speed_at_start(_first(run, name), _noise(run, name), rest)
        for name, rest in REST.items()
        if name in run.channels
    }
    if run.level == "bench":
        return Start(initial_rpm=speeds.get("speed_rpm", 0.0))
    # A sensor may be biased, so a robot moves only if it has a command.
    commanded = bool(np.any(run.command.wheels_rpm[0] != 0.0))
    x, y, yaw = (_pose_at_start(run, name, commanded) if name in run.channels else 0.0 for name in POSE)
    moving = commanded and any(speeds.values())
    known = moving and all(name in speeds for name in WHEEL_SPEEDS)
    wheels = tuple(float(round(speeds[name])) for name in WHEEL_SPEEDS) if known else ()
    return Start(0.0, moving, x, y, yaw, wheels)


def _pose_at_start(run: Run, name: str, commanded: bool) -> float:
    """Return a coordinate of the pose in the first row, from the first samples, of which there is one.

    A robot that is `commanded` then moves between them: a line through them tells where it was.
    """
    values = _first(run, name)
    if values.size < _LINE or not commanded:
        return float(np.mean(values))
    time = run.time_s[run.finite(name)][: values.size] - run.time_s[0]
    return float(np.polynomial.polynomial.polyfit(time, values, 1)[0])


def _first(run: Run, name: str) -> FloatArray:
    """Return the samples of a channel that show how a run starts; there may be none, except of a pose."""
    finite = run.finite(name)
    time, values = run.time_s[finite], run.channels[name][finite]
    first = values[: max(3, int(np.sum(time <= _FIRST_S)))]
    if name in POSE:
        return first
    # If the first cells are empty, the wheel may have been started before the first sample.
    return first[time[: first.size] <= max(_FIRST_S, _LATE * run.median_interval_s)]


def _noise(run: Run, name: str) -> float:
    """Return the standard deviation of a sample, by second differences of the channel."""
    values = run.channels[name][run.finite(name)]
    if values.size < _TOO_FEW:
        return 0.0
    # The median ignores motion; second differences have 1 + 4 + 1 variances.
    return float(np.median(np.abs(np.diff(values, 2)))) / (MEDIAN_OF_NORMAL * math.sqrt(6.0))
