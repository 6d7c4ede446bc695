"""How a run starts, according to its first samples: at rest, or already moving; and where a robot stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import POSE
from mecanum_env.statistics import MEDIAN_OF_NORMAL
from mecanum_env.units import FloatArray
from sysid.logs import Run
from sysid.logs.first_samples import speed_at_start
from sysid.logs.runs import REST

_FIRST_S: Final = 0.05
"""The samples of this first time [s], or the first three, show how a run starts."""
_LATE: Final = 3.5
"""Sampling intervals after which a sample no longer shows how a run starts, if earlier cells are empty."""
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
    moving = any(speeds.values()) and bool(np.any(run.command.wheels_rpm[0] != 0.0))
    pose = (float(np.mean(_first(run, name))) if name in run.channels else 0.0 for name in POSE)
    return Start(0.0, moving, *pose)


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
