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
from mecanum_env.tankendo.scene import BoolArray, RowArray
from mecanum_env.units import FloatArray

GUARD_HEIGHT_M: Final = 0.58
"""Height of the tip on guard [m]; this project's choice."""
TIP_VELOCITY_S: Final = 0.01
"""The tip's velocity is its mean over this time [s]."""
_EARLIER_S = np.array([[0.0], [TIP_VELOCITY_S]])
_LONG_AGO_S = -1e6


class StrikeShares(NamedTuple):
    """How far the phases of sword motions have come, each between 0 and 1 and of shape (..., n)."""

    rise: FloatArray
    """Drawing back: 0 on guard, 1 fully drawn back; s^2 (3 - 2 s) of the elapsed share s."""
    forward: FloatArray
    """Strike: 0 drawn back, 1 at the place of the hit; s^2. Always 0 in a feint."""
    back: FloatArray
    """Return: 1 on guard again; s^2 (3 - 2 s)."""

    def place(self, drawn_m: FloatArray, end_m: FloatArray, guard_m: FloatArray | float) -> FloatArray:
        """Return one coordinate of the tip [m].

        Args:
            drawn_m: the coordinate by drawing back alone, `guard + rise (raised - guard)`.
            end_m: the coordinate of the hit.
            guard_m: the coordinate on guard.
        """
        forward = drawn_m + self.forward * (end_m - drawn_m)
        return forward + self.back * (guard_m - forward)

    def height(self, raised_m: FloatArray, end_m: FloatArray) -> FloatArray:
        """Return the height of the tip over the floor [m], given that fully drawn back and at the end."""
        drawn = GUARD_HEIGHT_M + self.rise * (raised_m - GUARD_HEIGHT_M)
        return self.place(drawn, end_m, GUARD_HEIGHT_M)

    def ahead(self, raised_m: FloatArray) -> FloatArray:
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

    def shares(self, time_s: FloatArray | float) -> StrikeShares:
        """Return how far each phase has come at times of shape (..., n), or at one time."""
        strike = _share(time_s, self.cut_s, self.land_s)
        return StrikeShares(
            _smooth(_share(time_s, self.raise_s, self.cut_s)),
            np.where(self.is_feint, 0.0, strike * strike),
            _smooth(_share(time_s, self.land_s, self.free_s)),
        )

    def step_share(self, time_s: FloatArray | float) -> FloatArray:
        """Return the share of its step that the body is forward at times (..., n); 0 in a feint."""
        forward = _smooth(_share(time_s, self.raise_s, self.land_s))
        back = _smooth(_share(time_s, self.land_s, self.free_s))
        return np.where(self.is_feint, 0.0, forward - back)


class Sword(StrikeTimes):
    """The motion of the swords of n episodes."""

    def __init__(self, n: int) -> None:
        raise_s, cut_s, land_s, free_s = (np.full(n, _LONG_AGO_S) for _ in range(4))
        super().__init__(raise_s, cut_s, land_s, free_s, np.ones(n, bool))
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

    def idle(self, time_s: FloatArray) -> BoolArray:
        """Return whether each sword is on guard at times (n,), shape (n,)."""
        return np.asarray(time_s >= self.free_s)

    def tip(
        self, time_s: FloatArray, x_m: FloatArray, y_m: FloatArray, heading_rad: FloatArray
    ) -> FloatArray:
        """Return the tip's position x, y, z [m], shape (3, ..., n), at times of shape (..., n).

        `x_m` and `y_m` are the opponent's centre at these times; its heading has the shape (n,).
        """
        tip = np.empty((3, *x_m.shape))
        cos, sin = np.cos(heading_rad), np.sin(heading_rad)
        if np.all((time_s >= self.free_s) | (time_s <= self.raise_s)):
            # All swords are on guard: the formulae below would give the same in several times the time.
            tip[0], tip[1] = x_m + GUARD_TIP_M * cos, y_m + GUARD_TIP_M * sin
            tip[2] = GUARD_HEIGHT_M
            return tip
        shares = self.shares(time_s)
        ahead = shares.ahead(self.raised_m)
        tip[0] = shares.place(x_m + ahead * cos, self.end[0], x_m + GUARD_TIP_M * cos)
        tip[1] = shares.place(y_m + ahead * sin, self.end[1], y_m + GUARD_TIP_M * sin)
        tip[2] = shares.height(self.raised_height_m, self.end_height_m)
        return tip

    def tip_and_velocity(self, time_s: FloatArray, scene: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the tip's position [m] and velocity [m/s], (3, n) each, at times (n,) with scene (11, n)."""
        x, y = scene[6] - _EARLIER_S * scene[9], scene[7] - _EARLIER_S * scene[10]
        tip = self.tip(time_s - _EARLIER_S, x, y, scene[8])
        return tip[:, 0], (tip[:, 0] - tip[:, 1]) / TIP_VELOCITY_S


def _share(time_s: FloatArray | float, start_s: FloatArray, end_s: FloatArray) -> FloatArray:
    """Return the elapsed share of the time from start to end, 0 to 1; a phase of no length is over."""
    return np.minimum(np.maximum((time_s - start_s) / np.maximum(end_s - start_s, 1e-9), 0.0), 1.0)


def _smooth(share: FloatArray) -> FloatArray:
    return share * share * (3.0 - 2.0 * share)
