"""How large the trace of a change is in a robot's logs, and the size that gives a wanted trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from sysid.studies.zoo.cases.bench.size import log_distance, without_common_noise
from sysid.studies.zoo.cases.robot.change import with_sensors
from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.simulate import RobotLog, simulate

FloatArray = npt.NDArray[np.float64]

_REPEATS = 3
"""Noisy repeats of each sequence that the noise is estimated from."""
_LEAST_NOISE = 1e-6
_NO_MOTION = ("battery_v",)
"""Channels that say under which conditions a robot moved, not how."""
_STEPS = 9
_CLOSE = math.log(1.1)


@dataclass(frozen=True, eq=False)
class Yardstick:
    """Measures the traces of changes of one robot in the logs of one study."""

    robot: Robot
    """Nominal."""
    commands: Sequence[FloatArray]
    """Sequences, each (m, 3)."""
    seed: int
    noise: Mapping[str, float]
    """Channel -> standard deviation over repeats, whose wheels start anywhere; rms over the samples."""
    _logs: dict[Robot, list[RobotLog]] = field(default_factory=dict)

    def signal(self, changed: Robot) -> float:
        """Return the rms of what a change does to the logs over the noise, in the worst channel.

        Noise that both robots have alike is left out of their difference, so that a trace far below it can be
        measured. Wheels start at the same angles. The signal is infinite where the changed robot's motion is.
        """
        plain, other = _without_common_noise(self.robot, changed)
        if plain not in self._logs:
            self._logs[plain] = self._runs(plain)
        pairs = list(zip(self._logs[plain], self._runs(other), strict=True))
        worst = 0.0
        for name, noise in self.noise.items():
            power = float(np.mean([_mean_square(one, two, name) for one, two in pairs]))
            if not math.isfinite(power):
                return math.inf
            worst = max(worst, math.sqrt(power) / noise)
        return worst

    def _runs(self, robot: Robot) -> list[RobotLog]:
        return [
            simulate(robot, c, np.random.default_rng([self.seed, i])) for i, c in enumerate(self.commands)
        ]


def yardstick(robot: Robot, commands: Sequence[FloatArray], seed: int) -> Yardstick:
    """Return the yardstick of a robot.

    Args:
        robot: the nominal one.
        commands: sequences of a study, each (m, 3).
        seed: of the starts and the noise of repeats.
    """
    noise: dict[str, list[float]] = {}
    for number, rows in enumerate(commands):
        logs = [simulate(robot, rows, np.random.default_rng([seed, number, k])) for k in range(_REPEATS)]
        for name in [name for name in logs[0].channels if name not in _NO_MOTION]:
            samples = [_at(log, name, logs[0].time_s) for log in logs]
            noise.setdefault(name, []).append(float(np.mean(np.var(samples, axis=0, ddof=1))))
    found = {name: math.sqrt(float(np.mean(each))) + _LEAST_NOISE for name, each in noise.items()}
    return Yardstick(robot, commands, seed, found)


def _without_common_noise(before: Robot, after: Robot) -> tuple[Robot, Robot]:
    """Return both robots without the random parts that they have alike."""
    plain, changed = without_common_noise(before.drive, after.drive)
    return _exact(replace(before, drive=plain)), _exact(replace(after, drive=changed))


def _exact(robot: Robot) -> Robot:
    return with_sensors(robot, noise_m_s=0.0, noise_rad_s=0.0, noise_m=0.0, noise_rad=0.0, drop_outs=0.0)


def solve_size(signal: Callable[[float], float], target: float) -> tuple[float, float]:
    """Return the size in (0, 1] whose signal comes closest to a target, and that signal.

    The search narrows a bracket and ends at size 1 where even that shows less.

    Args:
        signal: of a size; it grows with the size, if not always smoothly.
        target: wanted signal.
    """
    low, high = 0.0, 1.0
    found = {high: signal(high)}
    for _ in range(_STEPS):
        # The logarithm of most signals is nearly linear in the size.
        share = 0.5
        if low > 0.0 and 0.0 < found[low] < target and math.isfinite(found[high]):
            share = math.log(target / found[low]) / math.log(found[high] / found[low])
        size = low + min(max(share, 0.1), 0.9) * (high - low)
        found[size] = signal(size)
        if log_distance(found[size], target) < _CLOSE:
            break
        low, high = (size, high) if found[size] < target else (low, size)
    return min(found.items(), key=lambda item: log_distance(item[1], target))


def _mean_square(one: RobotLog, other: RobotLog, name: str) -> float:
    return float(np.mean((_at(one, name, one.time_s) - _at(other, name, one.time_s)) ** 2))


def _at(log: RobotLog, name: str, time_s: FloatArray) -> FloatArray:
    """Return a channel at other times, across its gaps."""
    values = log.channels[name]
    there = np.isfinite(values)
    return np.interp(time_s, log.time_s[there], values[there])
