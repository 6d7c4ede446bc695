"""Where in the backlash of a gear each run starts: what fits the run best.

A wheel that stops leaves its motor anywhere in the gap, so that the way to its first contact differs from run
to run, up to the whole gap. Nothing in a log says where, but the first motion does. The place is one number
for each run that starts at rest, estimated from the run itself, as is the pose at which a robot starts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
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
_SAME_RPM: Final = 1e-2  # difference that no log shows: motions with less than it have come together
_MEET_S: Final = 2.0
"""Time after the first motion in which motions from all places mostly meet [s]; where they do not, the whole
run is simulated. Assumed."""
_TOGETHER_S: Final = 0.25
"""Time for which motions must be together to have met [s]. Assumed."""
_MOVING_RPM: Final = 1.0  # speed at which a wheel that stood is pushed by its motor
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

    def squares(self, as_seen: Motion, until_s: float = math.inf) -> float:
        """Return the weighted sum of the squared errors of a motion `as_seen` by sensors [rpm^2].

        Only those `until_s` seconds after the start of the log count.
        """
        until = np.searchsorted(self.time_s, until_s, "right")
        predicted = np.interp(self.time_s[:until], as_seen.time_s, as_seen.channels[_SPEED])
        return float(self.weight[:until] @ (self.value_rpm[:until] - predicted) ** 2)

    def evidence(self, before: float, after: float) -> float:
        """Return twice the logarithm of the likelihood ratio of `squares` that are `after` and `before`."""
        return self.value_rpm.size * math.log(max(before, _NONE) / max(after, _NONE))


@dataclass(frozen=True, eq=False)
class FromGap:
    """How a wheel moves in each run from the place in its gap that fits best."""

    motions: list[Motion]
    places: tuple[float, ...]
    """Of each run, from -1 to 1; 0: the middle."""


def starts_in_gap(wheel: FreeWheel) -> bool:
    """Return whether a wheel at rest may stand anywhere in a gap: one without an elastic filling."""
    return bool(wheel.parameters[_GAP] > 0.0 and not wheel.parameters[_SWING] > 0.0)


def motions_from_gap(
    wheel: FreeWheel, runs: Sequence[BenchRun], seen: Sequence[SeenSpeed], sensors: Sensors
) -> FromGap:
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
    search = _Search(wheel, tuple(runs), tuple(seen), sensors)
    middle = search.tried([(i, 0.0) for i in range(len(runs))])
    free = [i for i, run in enumerate(runs) if run.initial_rpm == 0.0 and seen[i].value_rpm.size]
    best = list(middle)

    def look(offered: Sequence[tuple[int, float]]) -> None:
        for one in search.tried([(i, place) for i, place in offered if abs(place) <= 1.0]):
            best[one.run] = min(best[one.run], one, key=_squares)

    for i, *both in zip(free, *search.from_ends([middle[i] for i in free]), strict=True):
        best[i] = min(best[i], *both, key=_squares)
        if any(abs(seen[i].evidence(middle[i].squares, end.squares)) > _HARDLY for end in both):
            search.shorten(middle[i], both)
    look([(i, place) for i in search.until_s for place in _BETWEEN])
    shown = [i for i in free if seen[i].evidence(middle[i].squares, best[i].squares) > VERY_STRONG]
    for step in _FINER:
        look([(i, best[i].place + off) for i in shown for off in (-step, step)])
    found = dict(zip(shown, search.motions([(i, best[i].place) for i in shown]), strict=True))
    return FromGap(
        [found.get(i, middle[i].motion) for i in range(len(runs))],
        tuple(best[i].place if i in found else 0.0 for i in range(len(runs))),
    )


@dataclass(frozen=True, eq=False)
class _Tried:
    """A start of a run that was simulated."""

    run: int
    place: float
    squares: float
    motion: Motion
    as_seen: Motion


@dataclass(frozen=True, eq=False)
class _Search:
    """Simulation of runs from places in the gap: no longer than until all places lead to the same motion."""

    wheel: FreeWheel
    runs: tuple[BenchRun, ...]
    seen: tuple[SeenSpeed, ...]
    sensors: Sensors
    until_s: dict[int, float] = field(default_factory=dict)
    """When motions from all places have come together, of the runs of which that is known [s]."""
    later: dict[int, float] = field(default_factory=dict)
    """Their sum of squared errors from then on [rpm^2]."""

    def motions(
        self, places: Sequence[tuple[int, float]], until_s: Mapping[int, float] = MappingProxyType({})
    ) -> list[Motion]:
        """Return the motions in runs from places, each to the end of its run or `until_s`."""
        asked = [
            replace(run, gap_share=place, duration_s=min(run.duration_s, until_s.get(i, math.inf)))
            for run, i, place in ((self.runs[i], i, place) for i, place in places)
        ]
        return bench_motions_of(self.wheel, BenchRuns(asked)) if asked else []

    def tried(self, places: Sequence[tuple[int, float]]) -> list[_Tried]:
        """Return how well motions in runs from places fit what was seen."""
        found = []
        for (i, place), motion in zip(places, self.motions(places, self.until_s), strict=True):
            as_seen = motion.seen_by(self.sensors)
            until_s, later = self.until_s.get(i, math.inf), self.later.get(i, 0.0)
            found.append(_Tried(i, place, self.seen[i].squares(as_seen, until_s) + later, motion, as_seen))
        return found

    def from_ends(self, middles: Sequence[_Tried]) -> tuple[list[_Tried], ...]:
        """Return how well motions from either end of the gap fit, in the runs of motions from the `middles`.

        They are simulated until they have met the motion from the middle, with which they then go on.
        """
        meet_s = {one.run: until_s for one in middles if (until_s := _meeting_s(one.motion)) is not None}
        self.until_s.update(meet_s)
        for one in middles:
            if one.run in meet_s:
                self.later[one.run] = one.squares - self.seen[one.run].squares(one.as_seen, meet_s[one.run])
        found = [self.tried([(one.run, place) for one in middles]) for place in _ENDS]
        for i in meet_s:
            del self.until_s[i], self.later[i]
        for ends, place in zip(found, _ENDS, strict=True):
            apart = [
                k
                for k, (end, middle) in enumerate(zip(ends, middles, strict=True))
                if middle.run in meet_s and not _have_met(middle.as_seen, end.as_seen)
            ]
            again = self.tried([(middles[k].run, place) for k in apart])
            for k, whole in zip(apart, again, strict=True):
                ends[k] = whole
        return tuple(found)

    def shorten(self, middle: _Tried, ends: Sequence[_Tried]) -> None:
        """End later simulations of a run where the motions from the middle and both `ends` have met."""
        i = middle.run
        self.until_s[i] = max(_together_s(middle.as_seen, end.as_seen) for end in ends)
        self.later[i] = middle.squares - self.seen[i].squares(middle.as_seen, self.until_s[i])


def _meeting_s(motion: Motion) -> float | None:
    """Return when motions from other places should have met this one [s]; None if only the whole run tells.

    By then the motor must have pushed the wheel for a while: else both may be elsewhere in the gap.
    """
    speed = np.abs(motion.channels[_SPEED])
    moving = np.flatnonzero(speed > _MOVING_RPM)
    if not moving.size:
        return None
    until_s = float(motion.time_s[moving[0]]) + _MEET_S
    first, end = np.searchsorted(motion.time_s, (until_s - _TOGETHER_S, until_s))
    return until_s if end < speed.size and np.all(speed[first : end + 1] > _MOVING_RPM) else None


def _have_met(whole: Motion, other: Motion) -> bool:
    """Return whether another motion, which may end earlier, ends together with a `whole` one."""
    end = other.time_s.size
    last = other.time_s > other.time_s[-1] - _TOGETHER_S
    return bool(np.all(np.abs(whole.channels[_SPEED][:end] - other.channels[_SPEED])[last] <= _SAME_RPM))


def _together_s(one: Motion, other: Motion) -> float:
    """Return the time after which two motions on the same clock stay together [s]; one may be shorter."""
    end = min(one.time_s.size, other.time_s.size)
    apart = np.flatnonzero(np.abs(one.channels[_SPEED][:end] - other.channels[_SPEED][:end]) > _SAME_RPM)
    return float(one.time_s[min(apart[-1] + 1, one.time_s.size - 1)]) if apart.size else 0.0


def _squares(one: _Tried) -> float:
    return one.squares
