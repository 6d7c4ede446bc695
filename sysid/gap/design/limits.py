"""The commands that a platform is known to take: those of its logs.

Neither the ceiling nor the command period of a model says what may be sent. Where its logs show neither, both
are assumed: a ceiling far above the drive's, and a period as short as the law's tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import Geometry, wheels_to_command
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.logs import BodyCommand, Run
from sysid.logs.checks import SETTLED_S
from sysid.logs.runs import Level

_LONGEST_S: Final[dict[Level, float]] = {"bench": 6.0, "robot": 8.0}
"""Duration of the longest sequence [s]."""
_REST_S: Final = 0.2
"""Least time at rest before the first command and after the last one [s]."""
_BEAT_S: Final = 0.1
"""Unit in which sequences state how long commands are held [s]: the robot's command period."""
_SHORTEST: Final = 0.05
"""Quantile of the times between changes of command that counts as the shortest: two commands in one burst do
not show that the platform takes them so fast."""
_LATE: Final = 0.1
"""Share of a command period by which a logged change may be late."""


@dataclass(frozen=True)
class Limits:
    """Commands that a platform takes."""

    limit_rpm: float
    """Largest command of each wheel, in either direction [rpm]."""
    quantum_rpm: float = 1.0
    """Commands are multiples of this [rpm]; 0: any command."""
    period_s: float = 0.1
    """Shortest time for which a command is held [s]: the duration of a row."""
    geometry: Geometry | None = None
    """Geometry of the robot; None on the bench."""
    v_rpm: float = math.inf
    """Largest V of a robot [rpm]."""
    vc_rpm: float = math.inf
    """Largest VC of a robot, in either direction [rpm]."""

    @property
    def level(self) -> Level:
        """Whether sequences are for the bench or the robot."""
        return "bench" if self.geometry is None else "robot"

    @property
    def max_rows(self) -> int:
        """Rows of the longest sequence."""
        return int(_LONGEST_S[self.level] / self.period_s + 1e-9)

    @property
    def rest_rows(self) -> int:
        """Rows at rest before the first command and after the last one."""
        return math.ceil(_REST_S / self.period_s - 1e-9)

    @property
    def driven_rows(self) -> int:
        """Rows of the longest sequence without its rest before and after."""
        return max(1, self.max_rows - 2 * self.rest_rows)

    def rows_of(self, beats: int) -> int:
        """Return the rows, at least one, that last about so many units of `_BEAT_S`."""
        return max(1, round(beats * _BEAT_S / self.period_s))


def limits_of(model: Model, runs: Sequence[Run]) -> Limits:
    """Return the commands that logs show a platform to take: no larger ones, and no faster changes.

    A hold in which a wheel settles tells nothing about faster changes, so none needs to be longer than that.
    """
    wheel = model.wheel
    limit = max(_largest(run.command.wheels_rpm) for run in runs)
    period = _period_s(runs, wheel.command_period_s)
    if runs[0].level == "bench":
        return Limits(limit, wheel.command_quantum_rpm, period)
    straight, turning = (max(sizes) for sizes in zip(*map(_body_sizes, runs), strict=True))
    return Limits(limit, wheel.command_quantum_rpm, period, model.robot, straight, turning)


def _largest(values: FloatArray) -> float:
    return float(np.max(np.abs(values)))


def _body_sizes(run: Run) -> tuple[float, float]:
    """Return the largest V and VC of a robot's run [rpm]."""
    command = run.command
    if isinstance(command, BodyCommand):
        return _largest(command.v_rpm), _largest(command.vc_rpm)
    v, _, vc = wheels_to_command(command.wheels_rpm)
    return _largest(v), _largest(vc)


def _period_s(runs: Sequence[Run], command_period_s: float) -> float:
    """Return the shortest hold of a command [s]: a multiple of a model's command period."""
    holds = np.concatenate([np.diff(run.command_changes()[0][1:]) for run in runs])
    shortest = float(np.quantile(holds, _SHORTEST)) if holds.size else math.inf
    row = float(np.median([run.median_interval_s for run in runs]))
    if command_period_s < (1.0 - _LATE) * row:
        # No clock of the platform is known: a hold may have been logged shorter than it was, by one row.
        shortest += row
    periods = math.ceil(min(shortest, SETTLED_S) / command_period_s - _LATE)
    return max(1, periods) * command_period_s
