"""Ramps between command and wheel law: how fast what the law follows may change.

Each function moves a ramp for a part of a law tick and returns its contribution to the mean over the tick,
which is the law's input. All are exact for any part. Ramps are arrays, one entry for each wheel or run, of
either kind of `mecanum_env.law.arrays`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from mecanum_env.law.arrays import namespace
from mecanum_env.units import FloatArray


@dataclass(frozen=True)
class Ramp:
    """A ramp at some time; both arrays have the shape of the wheels or runs."""

    value_rpm: FloatArray
    slope_rpm_s: FloatArray
    """Its present rate of change [rpm/s], which only an S-curve remembers."""

    @staticmethod
    def steady(speed_rpm: npt.ArrayLike) -> Ramp:
        """Return a ramp that rests at speeds [rpm] of any shape."""
        speed = np.asarray(speed_rpm, float)
        return Ramp(speed, np.zeros(speed.shape))


S_CURVE_LEGS: Final = 3
"""Of an S-curve in a part of a tick, as in set_point.c: up to 0, back through 0, and on to the command."""
BoolArray: TypeAlias = npt.NDArray[np.bool_]
Move: TypeAlias = Callable[[Ramp, FloatArray, FloatArray], tuple[Ramp, FloatArray]]


@dataclass(frozen=True, eq=False)
class RampLimits:
    """What bounds ramps, of a shape that broadcasts to theirs; infinite for no bound."""

    rise_rpm_s: FloatArray
    """Largest rate while the speed grows in size [rpm/s]."""
    brake_rpm_s: FloatArray
    """Largest rate while it falls in size [rpm/s]."""
    jerk_rpm_s2: FloatArray
    """Largest change of the rate [rpm/s2]."""
    sample_period_s: FloatArray | float
    """Period of the law's ticks [s]."""

    @property
    def act(self) -> bool:
        """Whether any ramp is anything but the command itself."""
        bounds = (self.rise_rpm_s, self.brake_rpm_s, self.jerk_rpm_s2)
        return any(bool(namespace(bound).isfinite(bound).any()) for bound in bounds)

    def moved(self, ramp: Ramp, command_rpm: FloatArray, part: FloatArray) -> tuple[Ramp, FloatArray]:
        """Return the ramp after a part of a tick towards a command, and its contribution to the mean [rpm].

        Parts and commands have the ramp's shape, or one that broadcasts to it.
        """
        xp, ((_, move), *others) = namespace(self.rise_rpm_s), self._ways
        after, mean = move(ramp, command_rpm, part)
        for mask, move in others:
            other, other_mean = move(ramp, command_rpm, part)
            after = Ramp(
                xp.where(mask, other.value_rpm, after.value_rpm),
                xp.where(mask, other.slope_rpm_s, after.slope_rpm_s),
            )
            mean = xp.where(mask, other_mean, mean)
        return after, mean

    @cached_property
    def _ways(self) -> list[tuple[BoolArray, Move]]:
        """Which ramps move in which way, for all ways that occur."""
        xp = namespace(self.rise_rpm_s)
        bends = xp.isfinite(self.jerk_rpm_s2)
        differ = ~bends & (self.brake_rpm_s != self.rise_rpm_s)
        limited = ~bends & ~differ & xp.isfinite(self.rise_rpm_s)
        masks = (~(bends | differ | limited), limited, differ, bends)
        functions = (RampLimits._jump, RampLimits._one_rate, RampLimits._two_rates, RampLimits._s_curve)
        return [
            (mask, partial(function, self._only(mask)))
            for mask, function in zip(masks, functions, strict=True)
            if bool(mask.any())
        ]

    def _only(self, mask: BoolArray) -> RampLimits:
        """Return these limits with harmless numbers where the mask is False."""
        rise, brake, jerk = (
            namespace(mask).where(mask, bound, 1.0)
            for bound in (self.rise_rpm_s, self.brake_rpm_s, self.jerk_rpm_s2)
        )
        return RampLimits(rise, brake, jerk, self.sample_period_s)

    def _jump(self, ramp: Ramp, command_rpm: FloatArray, part: FloatArray) -> tuple[Ramp, FloatArray]:
        return Ramp(command_rpm, ramp.slope_rpm_s), part * command_rpm

    def _one_rate(self, ramp: Ramp, command_rpm: FloatArray, part: FloatArray) -> tuple[Ramp, FloatArray]:
        xp = namespace(ramp.value_rpm)
        limit, before = self.rise_rpm_s * self.sample_period_s, ramp.value_rpm  # change in one tick
        end = xp.minimum(xp.maximum(command_rpm, before - limit * part), before + limit * part)
        change = end - before
        return Ramp(end, ramp.slope_rpm_s), part * end - change * xp.abs(change) / (2 * limit)

    def _two_rates(self, ramp: Ramp, command_rpm: FloatArray, part: FloatArray) -> tuple[Ramp, FloatArray]:
        """Move at one rate towards 0 and at another away from it."""
        xp, value, tau = namespace(ramp.value_rpm), ramp.value_rpm, self.sample_period_s
        low, high = xp.clip(value, None, 0.0), xp.clip(value, 0.0, None)
        nearer = xp.minimum(xp.maximum(command_rpm, low), high)
        value, left, area = _leg(value, nearer, self.brake_rpm_s * tau, part)
        further = xp.where(value == nearer, command_rpm, value)
        value, left, added = _leg(value, further, self.rise_rpm_s * tau, left)
        return Ramp(value, ramp.slope_rpm_s), area + added + left * value

    def _s_curve(self, ramp: Ramp, command_rpm: FloatArray, part: FloatArray) -> tuple[Ramp, FloatArray]:
        """Move in the shortest time that the limits allow, so that the slope is 0 at the command.

        If the two rates differ, the ramp passes through 0 with the slope that it has there, and only then
        does the other rate count.
        """
        left, area = part * self.sample_period_s, namespace(ramp.value_rpm).zeros_like(ramp.value_rpm)
        for _ in range(S_CURVE_LEGS):
            ramp, left, added = self._glide(ramp, command_rpm, left)
            area = area + added
        return ramp, (area + left * ramp.value_rpm) / self.sample_period_s

    def _glide(self, ramp: Ramp, to_rpm: FloatArray, left: FloatArray) -> tuple[Ramp, FloatArray, FloatArray]:
        """Return the ramp on its way to a point after at most the seconds left, what is left, and the area.

        The slope goes to a peak at the largest jerk, stays there, and falls to 0. If the two rates differ,
        the ramp stops where it passes through 0.
        """
        xp = namespace(ramp.value_rpm)
        value, slope, jerk = ramp.value_rpm, ramp.slope_rpm_s, self.jerk_rpm_s2
        # Whether to push up or down: from where it would come to rest if the slope fell to 0 from now on.
        push = xp.where(value + slope * xp.abs(slope) / (2 * jerk) < to_rpm, 1.0, -1.0)
        most = xp.where(push * value < 0.0, self.brake_rpm_s, self.rise_rpm_s)
        way, begin = push * (to_rpm - value), push * slope
        peak = xp.minimum(xp.sqrt(xp.clip(jerk * way + begin * begin / 2, 0.0, None)), most)
        # Behind 0 the slope may be steeper than the rate there.
        steep = peak < begin
        bend = xp.where(steep, begin * begin, 2 * peak * peak - begin * begin)
        cruise = xp.clip((way - bend / (2 * jerk)) / xp.where(peak > 0, peak, 1.0), 0.0, None)
        area, arrives = xp.zeros_like(value), xp.isfinite(value)
        halves = self.brake_rpm_s != self.rise_rpm_s
        crossed = ~arrives
        for change, time in (
            (xp.where(steep, -push, push) * jerk, xp.abs(peak - begin) / jerk),
            (0.0 * push, xp.where(peak > 0.0, cruise, 0.0)),
            (-push * jerk, peak / jerk),
        ):
            spent = xp.where(crossed, 0.0, xp.minimum(left, time))
            zero = xp.where(halves, _passes(value, slope, change), xp.inf) if halves.any() else xp.inf
            crosses = ~crossed & (zero < spent)
            spent = xp.where(crosses, zero, spent)
            arrives = arrives & ~crossed & (spent == time)
            area = area + spent * (value + spent * (slope / 2 + change * spent / 6))
            value = value + (slope * spent + change * spent * spent / 2)
            slope = slope + change * spent
            left = left - spent
            value, crossed = xp.where(crosses, 0.0, value), crossed | crosses
        return Ramp(xp.where(arrives, to_rpm, value), xp.where(arrives, 0.0, slope)), left, area


def _passes(value: FloatArray, slope: FloatArray, change: FloatArray) -> FloatArray:
    """Return the first times at which values pass through 0, or touch it, [s]; infinite for none.

    Their slopes change by `change` in a second.
    """
    xp, square = namespace(value), slope * slope - 2 * change * value
    twice = -(slope + xp.copysign(xp.sqrt(xp.clip(square, 0.0, None)), slope))
    straight = 2 * value / xp.where(twice != 0.0, twice, 1.0)
    bent = twice / xp.where(change != 0.0, change, 1.0)
    first = xp.where((twice != 0.0) & (straight > 0.0), straight, xp.inf)
    first = xp.where((change != 0.0) & (bent > 0.0), xp.minimum(first, bent), first)
    never: FloatArray = xp.where((value == 0.0) | (square < 0.0), xp.inf, first)
    return never


def _leg(
    value: FloatArray, to_rpm: FloatArray, rate: FloatArray, left: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values moved straight to points at a rate [rpm per tick], the part that is left, the area."""
    xp, way = namespace(value), to_rpm - value
    time = xp.abs(way) / rate
    spent = xp.minimum(left, time)
    fastest = xp.clip(rate, None, 1e300)  # an infinite rate needs no time, and 0 times infinity is no number
    end = xp.where(time <= left, to_rpm, value + xp.copysign(fastest * spent, way))
    return end, left - spent, spent * (value + end) / 2
