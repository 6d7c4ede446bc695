"""Where in the backlash of a gear each run starts: what fits the run best.

A wheel that stops leaves its motor anywhere in the gap, so that the way to its first contact differs from run
to run, up to the whole gap. Nothing in a log says where, but the first motion does. The place is one number
for each run that starts at rest, estimated from the run itself, as is the pose at which a robot starts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects.apply import Sensors
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, FreeWheel
from mecanum_env.statistics import VERY_STRONG
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.parameters import CHAIN
from sysid.compare.predicted.motion import Motion, bench_motions_of
from sysid.logs import Run

_SPEED: Final = "speed_rpm"
_GAP, _SWING = CHAIN.index("gap_rad"), CHAIN.index("gap_swing_rad_s")
_ENDS: Final = (-1.0, 1.0)
_BETWEEN: Final = (-0.75, -0.5, -0.25, 0.25, 0.5, 0.75)
"""Places that are tried beside the middle and the ends, where the ends matter at all."""
_HARDLY: Final = 0.1
"""Twice the log likelihood ratio by which a start at either end is no other than in the middle: then
no place between them is. Assumed."""
_FINER: Final = (0.125, 0.0625)
"""Distances from the best place at which it is looked for again."""
_NONE: Final = 1e-12  # squared error that is none [rpm^2]
START_PRICE: Final = 2.0 * math.log(1 + len(_ENDS) + len(_BETWEEN))
"""Minus twice the logarithm of the prior probability of a place, of those that are tried first: so much less
does a run tell for a gap whose place it must show first."""


@dataclass(frozen=True, eq=False)
class SeenSpeed:
    """The measured speed of a bench run, or the mean of repeats."""

    time_s: FloatArray
    value_rpm: FloatArray
    weight: FloatArray

    @classmethod
    def of(cls, runs: Sequence[Run]) -> SeenSpeed:
        """Return the speed of some `runs` with the same stamps; without samples it has no values."""
        seen = [run for run in runs if _SPEED in run.channels]
        if not seen:
            return cls(np.zeros(0), np.zeros(0), np.zeros(0))
        ones = np.ones(seen[0].time_s.size)
        weights = np.array([np.where(r.finite(_SPEED), r.weights.get(_SPEED, ones), 0.0) for r in seen])
        total = np.sum(weights * np.nan_to_num([r.channels[_SPEED] for r in seen]), axis=0)
        weight = weights.sum(axis=0)
        used = weight > 0.0
        return cls(seen[0].time_s[used], total[used] / weight[used], weight[used])

    def squares(self, motion: Motion) -> float:
        """Return the weighted sum of the squared errors of a motion as sensors see it [rpm^2]."""
        predicted = np.interp(self.time_s, motion.time_s, motion.channels[_SPEED])
        return float(self.weight @ (self.value_rpm - predicted) ** 2)

    def evidence(self, before: float, after: float) -> float:
        """Return twice the logarithm of the likelihood ratio of `squares` that are `after` and `before`."""
        return self.value_rpm.size * math.log(max(before, _NONE) / max(after, _NONE))


def starts_in_gap(wheel: FreeWheel) -> bool:
    """Return whether a wheel at rest may stand anywhere in a gap: one without an elastic filling."""
    return bool(wheel.parameters[_GAP] > 0.0 and not wheel.parameters[_SWING] > 0.0)


def motions_from_gap(
    wheel: FreeWheel, runs: Sequence[BenchRun], seen: Sequence[SeenSpeed], sensors: Sensors
) -> list[Motion]:
    """Return the motion of a wheel in each of the `runs`, from the place in its gap that fits best.

    That is the middle where a run starts in motion, has no samples, or does not show another place: noise
    shall not choose one.

    Args:
        wheel: a wheel that `starts_in_gap`.
        runs: what the wheel is commanded.
        seen: the measured speed of each run.
        sensors: how the speed is measured.

    Raises:
        SimulationDivergedError: the state of any wheel stopped being finite.
    """

    def tried(offered: Sequence[tuple[int, float]]) -> list[_Tried]:
        asked = [replace(runs[i], gap_share=place) for i, place in offered]
        motions = bench_motions_of(wheel, BenchRuns(asked)) if asked else []
        return [
            _Tried(i, place, seen[i].squares(motion.seen_by(sensors)), motion)
            for (i, place), motion in zip(offered, motions, strict=True)
        ]

    middle = tried([(i, 0.0) for i in range(len(runs))])
    free = [i for i, run in enumerate(runs) if run.initial_rpm == 0.0 and seen[i].value_rpm.size]
    best, matters = list(middle), set()
    for one in tried([(i, place) for i in free for place in _ENDS]):
        best[one.run] = min(best[one.run], one, key=_squares)
        if abs(seen[one.run].evidence(middle[one.run].squares, one.squares)) > _HARDLY:
            matters.add(one.run)
    for one in tried([(i, place) for i in free if i in matters for place in _BETWEEN]):
        best[one.run] = min(best[one.run], one, key=_squares)
    shown = [i for i in free if seen[i].evidence(middle[i].squares, best[i].squares) > VERY_STRONG]
    for step in _FINER:
        ends = [(i, best[i].place + off) for i in shown for off in (-step, step)]
        for one in tried([(i, place) for i, place in ends if abs(place) <= 1.0]):
            best[one.run] = min(best[one.run], one, key=_squares)
    return [(best if i in shown else middle)[i].motion for i in range(len(runs))]


@dataclass(frozen=True, eq=False)
class _Tried:
    """A start of a run that was simulated."""

    run: int
    place: float
    squares: float
    motion: Motion


def _squares(one: _Tried) -> float:
    return one.squares
