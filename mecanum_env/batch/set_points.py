"""The set-points of many robots' drives: latches, law ticks, and the line between two ticks.

This is `mecanum_env.wheel_drive.chain.begin` for robots whose clocks started at different times; the stations
themselves are those of `mecanum_env.law`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from mecanum_env.batch.arrays import Arrays, OnArrays
from mecanum_env.batch.latches import Due, Latches
from mecanum_env.law.coefficients import law_step
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.chain import DriveState
from mecanum_env.wheel_drive.drive import EPS
from mecanum_env.wheel_drive.light_wheel import across_gap, is_light
from mecanum_env.wheel_drive.motor_bounds import bounded
from mecanum_env.wheel_drive.ramp import Ramp, RampLimits
from mecanum_env.wheel_drive.shaping import shaped


def due_at(now_s: FloatArray, count: FloatArray, period_s: float) -> tuple[bool, Due]:
    """Return whether the next event is due anywhere at times (n,), and where, given their count so far."""
    due: npt.NDArray[np.bool_] = now_s >= count * period_s - EPS * period_s
    if due.all():
        return True, None
    return bool(due.any()), due


class SetPoints(OnArrays):
    """Brings the set-points of n robots' drives from one physics step to the next.

    `period_s` is that of the drives' latches, `tick_s` that of the law, `timestep_s` the physics step [s].
    """

    def __init__(self, latches: Latches, tick_s: float, timestep_s: float, arrays: Arrays) -> None:
        super().__init__(arrays)
        self.latches, self._tick_s, self._timestep_s = latches, tick_s, timestep_s
        self._ticks = np.zeros(latches.count.size)
        self._ramps: RampLimits | None = None
        self._bounds: tuple[Any, ...] | None = None
        self._light = False

    def restart(self, rows: npt.NDArray[np.intp]) -> None:
        """Start the clocks of some `rows` anew, and forget the commands there."""
        self._ticks[rows] = 0.0
        self.latches.restart(rows)

    def take(self, p: Mapping[str, Any]) -> None:
        """Take over the parameters `p`, arrays (4, n), which have changed."""
        xp, ramps, bounds = self._xp, ("acceleration_rpm_s", "jerk_rpm_s2"), None
        self._ramps = None
        if any(_acts(p[name]) for name in ramps):
            rise = self._or_infinite(p["acceleration_rpm_s"])
            brake = xp.where(p["brake_rpm_s"] > 0.0, p["brake_rpm_s"], rise)
            self._ramps = RampLimits(rise, brake, self._or_infinite(p["jerk_rpm_s2"]), self._tick_s)
        if any(_acts(p[name]) for name in ("drive_acceleration_rpm_s", "supply_rpm")):
            rise = self._or_infinite(p["drive_acceleration_rpm_s"])
            brake = xp.where(p["drive_brake_rpm_s"] > 0.0, p["drive_brake_rpm_s"], rise)
            supply, tau = self._or_infinite(p["supply_rpm"]), self._tick_s
            bounds = (rise * tau, brake * tau, supply, p["supply_share"])
        self._bounds = bounds
        self._light = bool(is_light(p).any())

    def _or_infinite(self, limit: Any) -> Any:
        return self._xp.where(limit > 0.0, limit, math.inf)

    def begin(
        self, s: DriveState, p: Mapping[str, Any], commands: Any, steps: FloatArray, speed: Any
    ) -> None:
        """Advance `s` to the end of the physics step that follows `steps` others, shape (n,).

        `commands` are those of the wheels [rpm] and `speed` is theirs [rad/s], shape (4, n).
        """
        now, tau = steps * self._timestep_s, self._tick_s
        any_due, due = due_at(now, self.latches.count, self.latches.period_s)
        if any_due:
            zero = 0.0 * commands[0, 0]

            def taken(sent: Any, acts_at: Any) -> Any:
                return shaped(p, sent, acts_at, speed / RAD_S_PER_RPM, s.angle, zero)

            self.latches.latch(due, commands, taken)
        any_due, due = due_at(now, self._ticks, tau)
        if any_due:
            self._tick(s, p, due)
        share = ((steps + 1.0) * self._timestep_s - (self._ticks - 1.0) * tau) / tau
        if np.all(share > 1.0 - EPS):
            motor = s.w0 * RAD_S_PER_RPM
        else:
            motor = (s.w1 + (s.w0 - s.w1) * self._array(np.clip(share, 0.0, 1.0))) * RAD_S_PER_RPM
        before = s.setpoint
        if self._light:
            s.setpoint, s.gap = across_gap(p, motor, before, s.gap, self._timestep_s, self._xp)
        else:
            s.setpoint = motor
        s.rise = s.setpoint - before

    def _tick(self, s: DriveState, p: Mapping[str, Any], due: Due) -> None:
        held = self.latches.held(self._ticks * self._tick_s, self._tick_s)
        total: Any = None
        ramp = Ramp(s.ramp, s.slope)
        for part, command in held:
            if self._ramps is None:
                added = command if isinstance(part, float) else part * command
            else:
                share = part if not isinstance(part, float) else 1.0 + 0.0 * command
                ramp, added = self._ramps.moved(ramp, command, share)
            total = added if total is None else total + added
        w = law_step([p[name] for name in "ABCDEF"], (s.w0, s.w1, s.w2), (total, s.r1, s.r2))
        after = {"w1": s.w0, "w2": s.w1, "r1": total, "r2": s.r1}
        after |= {"ramp": ramp.value_rpm, "slope": ramp.slope_rpm_s}
        if self._bounds is not None:
            wanted = w + p["windup"] * s.excess
            w = bounded(s.w0, wanted, *self._bounds)
            after["excess"] = wanted - w
        after["w0"] = w
        if due is not None:
            here = self._array(due)
            after = {name: self._xp.where(here, value, getattr(s, name)) for name, value in after.items()}
        for name, value in after.items():
            setattr(s, name, value)
        self._ticks = self._ticks + 1.0 if due is None else self._ticks + due


def _acts(limit: Any) -> bool:
    return bool((limit > 0.0).any())
