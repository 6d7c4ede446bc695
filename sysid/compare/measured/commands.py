"""The changes of command in a run, and how much they excite the wheels at each time."""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.measured.start import start_of
from sysid.logs import Run

COMMAND_STEP_RPM: Final = 1.0
"""Largest difference of commands that count as one level [rpm]: the quantum of the robot's commands."""


def changes_from_rest(run: Run) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] and wheel commands [rpm] of `Run.command_changes`, (m,) and (m, wheels).

    A run that starts at rest and with a command begins with a change, from 0: it is the second row then.
    """
    times, wheels = run.command_changes()
    start = start_of(run)
    if start.moving or start.initial_rpm != 0.0 or not np.any(wheels[0]):
        return times, wheels
    return np.insert(times, 0, times[0]), np.insert(wheels, 0, 0.0, axis=0)


def command_changes(run: Run) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and sizes [rpm] of a run's changes of command, each of shape (m,)."""
    times, wheels = changes_from_rest(run)
    return times[1:], np.max(np.abs(np.diff(wheels, axis=0)), axis=1)


def activity_rpm(run: Run, time_s: FloatArray, decay_s: float) -> FloatArray:
    """Return how much the changes of command still excite the wheels at some times [s]: [rpm], shape (n,).

    At a time t it is the root of the sum of size_c^2 exp(-2 (t - t_c) / decay_s) over the changes c before.
    """
    total = np.zeros(time_s.shape)
    for when, size in zip(*command_changes(run), strict=True):
        since = time_s - when
        total += np.where(since >= 0.0, size**2 * np.exp(-2.0 * np.maximum(since, 0.0) / decay_s), 0.0)
    return np.sqrt(total)
