"""The drive of a wheel, one substep after the other, for many sets of parameters and many runs at once.

This is the reference for the plugin: mecanum_env/plugin/chain.c does the same for one wheel, and tests hold
the two equal bit for bit. Time counts in substeps of the timestep h. In each of them `begin` brings latches,
law and setpoint to its end. In `mecanum_env.law.servo`, `torques` gives what acts on the wheel, and `end`
takes over how the wheel has moved. What each step is, and why, is told in chain.h and chain.c.

Arrays have the shape (sets, runs), parameters (sets, 1). Numbers are added in the order of the C code.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from mecanum_env.law.coefficients import law_step
from mecanum_env.law.drive import EPS, RING
from mecanum_env.law.motor_bounds import reached
from mecanum_env.law.parameters import Sets
from mecanum_env.law.shaping import shaped
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

Mask = npt.NDArray[np.bool_]


@dataclass(eq=False)
class DriveState:
    """The memory of drives; `mecanum_env.plugin.layout.STATE` says what the entries are."""

    ticks: FloatArray
    latches: FloatArray
    w0: FloatArray
    w1: FloatArray
    w2: FloatArray
    r1: FloatArray
    r2: FloatArray
    ramp: FloatArray
    setpoint: FloatArray
    rise: FloatArray
    integral: FloatArray
    change: FloatArray
    gap: FloatArray
    load: FloatArray
    angle: FloatArray
    command: FloatArray
    """Latched commands [rpm], command j at j modulo RING, shape (sets, runs, RING)."""
    substeps: int = field(default=0, init=False)

    @staticmethod
    def steady(p: Sets, initial_rpm: FloatArray) -> DriveState:
        """Return drives that have long held steady speeds [rpm], shape (runs,), with parameters `p`."""
        shape = (p["gain"].shape[0], initial_rpm.size)
        state = DriveState(
            **{f.name: np.zeros(shape) for f in fields(DriveState) if f.name not in ("command", "substeps")},
            command=np.tile(initial_rpm[None, :, None], (shape[0], 1, RING)),
        )
        for name in ("w0", "w1", "w2", "r1", "r2", "ramp"):
            getattr(state, name)[:] = initial_rpm
        state.setpoint[:] = initial_rpm * RAD_S_PER_RPM
        # The motor of a turning wheel has crossed the backlash.
        state.gap[:] = np.sign(initial_rpm) * p["gap_rad"] / 2
        return state


def begin(
    s: DriveState, p: Sets, command_rpm: FloatArray, timestep_s: float, speed: FloatArray | float = 0.0
) -> None:
    """Advance the clocks, the law and the setpoint of `s` to the end of the substep.

    `p` are the parameters, `command_rpm` are the commands [rpm], of a shape that broadcasts to (sets, runs),
    and `speed` is that of the wheels [rad/s], which custom effects may use.
    """
    tau, period, now = p["sample_period_s"], p["command_period_s"], s.substeps * timestep_s
    while np.any(due := now >= s.latches * period - EPS * period):
        acts_at = s.latches * period + p["delay_s"]
        latched = np.where(
            due, shaped(p, command_rpm, acts_at, speed / RAD_S_PER_RPM, s.angle), _commands(s, s.latches)
        )
        np.put_along_axis(s.command, _slots(s.latches), latched[..., None], axis=-1)
        s.latches = s.latches + due
    while np.any(due := now >= s.ticks * tau - EPS * tau):
        _tick(s, p, due)
    s.substeps += 1
    share = np.clip((s.substeps * timestep_s - (s.ticks - 1) * tau) / tau, 0.0, 1.0)
    before, s.setpoint = s.setpoint, (s.w1 + (s.w0 - s.w1) * share) * RAD_S_PER_RPM
    s.rise = s.setpoint - before


def _tick(s: DriveState, p: Sets, due: Mask) -> None:
    """Tick the laws that are due."""
    r, ramp = _law_input(s, p)
    wanted = law_step([p[name] for name in "ABCDEF"], (s.w0, s.w1, s.w2), (r, s.r1, s.r2))
    w = reached(
        s.w0,
        wanted,
        p["drive_acceleration_rpm_s"] * p["sample_period_s"],
        p["drive_brake_rpm_s"] * p["sample_period_s"],
        p["supply_rpm"],
        p["supply_share"],
    )
    after = {"w0": w, "w1": s.w0, "w2": s.w1, "r1": r, "r2": s.r1, "ramp": ramp}
    for name, value in after.items():
        setattr(s, name, np.where(due, value, getattr(s, name)))
    s.ticks = s.ticks + due


def _law_input(s: DriveState, p: Sets) -> tuple[FloatArray, FloatArray]:
    """Return r(k), the mean over the tick of the delayed command behind the ramp, and the ramp at its end."""
    tau, period, delay = p["sample_period_s"], p["command_period_s"], p["delay_s"]
    limit, ramp = p["acceleration_rpm_s"] * tau, s.ramp
    t = s.ticks * tau
    latest = np.minimum(np.floor(t / period + EPS), s.latches - 1)
    j = np.maximum(np.minimum(np.floor((t - delay) / period + EPS), latest), latest - (RING - 1))
    total, done = np.zeros(t.shape), np.zeros(t.shape)
    for _ in range(RING - 1):
        arrival = (j + 1) * period + delay
        arrives = (j + 1 <= latest) & (arrival < t + tau)
        if not np.any(arrives):
            break
        until = np.where(arrives, (arrival - t) / tau, done)
        part, moved = _ramped(ramp, _commands(s, j), until - done, limit)
        total, ramp = np.where(arrives, total + part, total), np.where(arrives, moved, ramp)
        done, j = until, j + arrives
    part, ramp = _ramped(ramp, _commands(s, j), 1 - done, limit)
    return total + part, ramp


def _ramped(
    ramp: FloatArray, command: FloatArray, part: FloatArray, limit: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Move ramps towards commands for a part of a tick; return the parts of the mean, and the ramps.

    A ramp changes by at most `limit` in a whole tick; with 0 it jumps.
    """
    most = np.where(limit > 0.0, limit, 1.0)
    end = np.minimum(np.maximum(command, ramp - most * part), ramp + most * part)
    moved = end - ramp
    mean = part * end - moved * np.abs(moved) / (2 * most)
    return np.where(limit > 0.0, mean, part * command), np.where(limit > 0.0, end, command)


def _commands(s: DriveState, j: FloatArray) -> FloatArray:
    """Return the latched commands j, of shape (sets, runs)."""
    return np.take_along_axis(s.command, _slots(j), axis=-1)[..., 0]


def _slots(j: FloatArray) -> npt.NDArray[np.intp]:
    return np.asarray(np.mod(j, RING), np.intp)[..., None]
