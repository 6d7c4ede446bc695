"""How the opponent's sword moves: on guard, drawn back, forward in a strike, back on guard.

Every motion is made of three shares between 0 and 1 (`StrikeShares`), each a function of time alone. The
simulator places the tip with them; an estimator of the strike's phase evaluates the same functions on its
hypotheses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.numbers import Many, Mathematics, Number, mathematics
from mecanum_env.tankendo.scene import BoolArray, RowArray
from mecanum_env.units import FloatArray

GUARD_HEIGHT_M: Final = 0.58
"""Height of the tip on guard [m]; this project's choice."""
TIP_VELOCITY_S: Final = 0.01
"""The tip's velocity is its mean over this time [s]."""
_LONG_AGO_S = -1e6

Place = tuple[Number, Number, Number]
"""x, y and z [m], or velocities along them [m/s]."""


class StrikeShares(NamedTuple):
    """How far the phases of sword motions have come, each between 0 and 1: numbers, or arrays (..., n)."""

    rise: Number
    """Drawing back: 0 on guard, 1 fully drawn back; s^2 (3 - 2 s) of the elapsed share s."""
    forward: Number
    """Strike: 0 drawn back, 1 at the place of the hit; s^2. Always 0 in a feint."""
    back: Number
    """Return: 1 on guard again; s^2 (3 - 2 s)."""

    def place(self, drawn_m: Number, end_m: Number, guard_m: Number) -> Number:
        """Return one coordinate of the tip [m].

        Args:
            drawn_m: the coordinate by drawing back alone, `guard + rise (raised - guard)`.
            end_m: the coordinate of the hit.
            guard_m: the coordinate on guard.
        """
        forward = drawn_m + self.forward * (end_m - drawn_m)
        return forward + self.back * (guard_m - forward)

    def height(self, raised_m: Number, end_m: Number) -> Number:
        """Return the height of the tip over the floor [m], given that fully drawn back and at the end."""
        drawn = GUARD_HEIGHT_M + self.rise * (raised_m - GUARD_HEIGHT_M)
        return self.place(drawn, end_m, GUARD_HEIGHT_M)

    def ahead(self, raised_m: Number) -> Number:
        """Return the tip's distance ahead of its owner [m] before the strike, given that fully drawn back."""
        return GUARD_TIP_M + self.rise * (raised_m - GUARD_TIP_M)


@dataclass(eq=False)
class StrikeTimes:
    """When n sword motions begin and end their phases [s], each of shape (n,)."""

    raise_s: FloatArray
    """The sword leaves its guard."""
    cut_s: FloatArray
    """It starts forward."""
    land_s: FloatArray
    """It hits; in a feint it sinks from `cut_s` on, and `land_s` equals `cut_s`."""
    free_s: FloatArray
    """It is back on guard."""
    is_feint: BoolArray

    def __post_init__(self) -> None:
        self._math: Mathematics = Many(len(self.raise_s))

    def shares(self, time_s: Number) -> StrikeShares:
        """Return how far each phase has come at a time, or at times of shape (..., n)."""
        strike = self._share(time_s, self.cut_s, self.land_s)
        return StrikeShares(
            _smooth(self._share(time_s, self.raise_s, self.cut_s)),
            self._math.where(self._math.of(self.is_feint), 0.0, strike * strike),
            _smooth(self._share(time_s, self.land_s, self.free_s)),
        )

    def step_share(self, time_s: Number) -> Number:
        """Return the share of its step that the body is forward, as `shares` does; 0 in a feint."""
        forward = _smooth(self._share(time_s, self.raise_s, self.land_s))
        back = _smooth(self._share(time_s, self.land_s, self.free_s))
        return self._math.where(self._math.of(self.is_feint), 0.0, forward - back)

    def _share(self, time_s: Number, start_s: FloatArray, end_s: FloatArray) -> Number:
        """Return the elapsed share of the time from start to end, 0 to 1; a phase of no length is over."""
        math = self._math
        start, end = math.of(start_s), math.of(end_s)
        return math.minimum(math.maximum((time_s - start) / math.maximum(end - start, 1e-9), 0.0), 1.0)


class Sword(StrikeTimes):
    """The motion of the swords of n episodes."""

    def __init__(self, n: int) -> None:
        raise_s, cut_s, land_s, free_s = (np.full(n, _LONG_AGO_S) for _ in range(4))
        super().__init__(raise_s, cut_s, land_s, free_s, np.ones(n, bool))
        self._math = mathematics(n)
        self.raised_m, self.raised_height_m, self.end_height_m = (np.ones(n) for _ in range(3))
        """Distance ahead and height of the tip when drawn back, and its height at the hit, (n,)."""
        self.origin = np.zeros((2, n))
        """Where the opponent stood when the sword rose: x, y, shape (2, n)."""
        self.end = np.zeros((2, n))
        """Where the tip hits: x, y, shape (2, n)."""

    def clear(self, rows: RowArray) -> None:
        """Put the swords of some rows (m,) on guard, without a past."""
        for times in (self.raise_s, self.cut_s, self.land_s, self.free_s):
            times[rows] = _LONG_AGO_S
        self.is_feint[rows] = True

    def idle(self, time_s: Number) -> Number:
        """Return whether each sword is on guard at a time."""
        return time_s >= self._math.of(self.free_s)

    def tip(self, time_s: Number, centre: tuple[Number, Number], facing: tuple[Number, Number]) -> Place:
        """Return the tip's position at a time.

        Args:
            time_s: the time [s].
            centre: position of the opponent's centre, x and y [m].
            facing: cosine and sine of its heading.
        """
        math, (x, y), (cos, sin) = self._math, centre, facing
        moves = (time_s < math.of(self.free_s)) & (time_s > math.of(self.raise_s))
        if not math.any(moves):
            # All swords are on guard: the formulae below would give the same in several times the time.
            return on_guard(centre, facing)
        shares = self.shares(time_s)
        ahead, (end_x, end_y) = shares.ahead(math.of(self.raised_m)), math.of(self.end)
        return (
            shares.place(x + ahead * cos, end_x, x + GUARD_TIP_M * cos),
            shares.place(y + ahead * sin, end_y, y + GUARD_TIP_M * sin),
            shares.height(math.of(self.raised_height_m), math.of(self.end_height_m)),
        )

    def tip_and_velocity(self, time_s: Number, scene: list[Number]) -> tuple[Place, Place]:
        """Return the tip's position [m] and velocity [m/s] at a time with the scene of then."""
        x, y, heading, vx, vy = scene[6:]
        facing, span = (self._math.cos(heading), self._math.sin(heading)), TIP_VELOCITY_S
        now = self.tip(time_s, (x, y), facing)
        before = self.tip(time_s - span, (x - span * vx, y - span * vy), facing)
        along_x, along_y, up = ((late - early) / span for late, early in zip(now, before, strict=True))
        return now, (along_x, along_y, up)


def on_guard(centre: tuple[Number, Number], facing: tuple[Number, Number]) -> Place:
    """Return where the tip of a sword on guard is, given `centre` and `facing` as for `Sword.tip`."""
    (x, y), (cos, sin) = centre, facing
    return x + GUARD_TIP_M * cos, y + GUARD_TIP_M * sin, GUARD_HEIGHT_M + 0.0 * x


def _smooth(share: Number) -> Number:
    return share * share * (3.0 - 2.0 * share)
