"""The drive of a wheel, one substep after the other, for many sets of parameters and many runs at once.

This is the reference for the plugin: mecanum_env/plugin/chain.c does the same for one wheel, and tests hold
the two equal bit for bit. Time counts in substeps of the timestep h. In each of them `begin` brings latches,
law and setpoint to its end; in `mecanum_env.wheel_drive.servo`, `torques` gives what acts on the wheel, and
`end` takes over how the wheel has moved. What each step is, and why, is told in chain.h and chain.c.

Arrays have the shape (sets, runs), parameters (sets, 1). Numbers are added in the order of the C code.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from mecanum_env.law.coefficients import law_step
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.drive import EPS, RING
from mecanum_env.wheel_drive.light_wheel import across_gap
from mecanum_env.wheel_drive.link import is_lost, own_delay
from mecanum_env.wheel_drive.motor_bounds import bounded, supplied
from mecanum_env.wheel_drive.parameters import Sets
from mecanum_env.wheel_drive.ramp import Ramp, RampLimits
from mecanum_env.wheel_drive.shaping import rounded, shaped

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
    slope: FloatArray
    sent: FloatArray
    excess: FloatArray
    command: FloatArray
    """Latched commands [rpm], command j at j modulo RING, shape (sets, runs, RING)."""
    arrival: FloatArray
    """When they arrive [s], if the delay jitters."""
    substeps: int | FloatArray = field(default=0, init=False)
    """Substeps so far; a batch may hold drives that started at different times."""

    @staticmethod
    def steady(p: Sets, initial_rpm: FloatArray, gap_share: FloatArray | float = 0.0) -> DriveState:
        """Return drives that have long held steady speeds [rpm], shape (runs,), with parameters `p`.

        Motors at rest stand in their backlash at `gap_share`, from -1 to 1, one number or shape (runs,).
        """
        shape = (p["gain"].shape[0], initial_rpm.size)
        state = DriveState(**{f.name: np.zeros(shape) for f in fields(DriveState) if f.init})
        state.command = np.tile(initial_rpm[None, :, None], (shape[0], 1, RING))
        state.arrival = np.zeros(state.command.shape)
        for name in ("w0", "w1", "w2", "r1", "r2", "ramp", "sent"):
            getattr(state, name)[:] = initial_rpm
        state.setpoint[:] = initial_rpm * RAD_S_PER_RPM
        # The motor of a turning wheel has crossed the backlash; an elastic filling rests in its middle.
        place = np.where(initial_rpm == 0.0, gap_share, np.sign(initial_rpm))
        crossed = place * p["gap_rad"] / 2
        state.gap[:] = np.where(p["gap_swing_rad_s"] > 0.0, 0.0, crossed)
        return state


def begin(
    s: DriveState,
    p: Sets,
    command_rpm: FloatArray,
    timestep_s: float,
    speed: FloatArray | float = 0.0,
    lost_v: FloatArray | float = 0.0,
) -> None:
    """Advance the clocks, the law and the setpoint of `s` to the end of the substep.

    `p` are the parameters, `command_rpm` are the commands [rpm], of a shape that broadcasts to (sets, runs),
    and `speed` is that of the wheels [rad/s], which custom effects may use. `lost_v` is the voltage that the
    supply has lost since the start [V], of a shape that broadcasts, too.
    """
    tau, period, now = p["sample_period_s"], p["command_period_s"], s.substeps * timestep_s
    while np.any(due := now >= s.latches * period - EPS * period):
        _latch(s, p, command_rpm, due, speed, lost_v)
    while np.any(due := now >= s.ticks * tau - EPS * tau):
        _tick(s, p, due, lost_v)
    s.substeps += 1
    share = np.clip((s.substeps * timestep_s - (s.ticks - 1) * tau) / tau, 0.0, 1.0)
    motor = (s.w1 + (s.w0 - s.w1) * share) * RAD_S_PER_RPM
    before, (s.setpoint, s.gap) = s.setpoint, across_gap(p, motor, s.setpoint, s.gap, timestep_s)
    s.rise = s.setpoint - before


def _latch(
    s: DriveState,
    p: Sets,
    command_rpm: FloatArray,
    due: Mask,
    speed: FloatArray | float,
    lost_v: FloatArray | float,
) -> None:
    """Latch the commands that are due: those that are lost leave the ones before."""
    sent_at, sent = s.latches * p["command_period_s"], rounded(command_rpm, p["command_quantum_rpm"])
    acts_at, arrival, jitters = sent_at + p["delay_s"], _at(s.arrival, s.latches - 1), p["jitter_s"] > 0.0
    lost = is_lost(p["loss"], p["link_seed"], s.latches) if np.any(p["loss"] > 0.0) else np.False_
    if np.any(jitters):
        own = sent_at + own_delay(p["delay_s"], p["jitter_s"], p["link_seed"], s.latches)
        arrival = np.where((sent != s.sent) & ~lost, np.maximum(arrival, own), arrival)
        acts_at = np.where(jitters, np.maximum(sent_at, arrival), acts_at)
    taken = shaped(p, sent, acts_at, speed / RAD_S_PER_RPM, s.angle, lost_v)
    received = np.where(lost, _at(s.command, s.latches - 1), taken)
    s.sent = np.where(due & ~lost, sent, s.sent)
    for ring, value in ((s.command, received), (s.arrival, arrival)):
        kept = np.where(due, value, _at(ring, s.latches))
        np.put_along_axis(ring, _slots(s.latches), kept[..., None], axis=-1)
    s.latches = s.latches + due


def _tick(s: DriveState, p: Sets, due: Mask, lost_v: FloatArray | float) -> None:
    """Tick the laws that are due."""
    r, ramp = _law_input(s, p)
    w = law_step([p[name] for name in "ABCDEF"], (s.w0, s.w1, s.w2), (r, s.r1, s.r2))
    rise = _off_is_infinite(p["drive_acceleration_rpm_s"])
    brake = np.where(p["drive_brake_rpm_s"] > 0.0, p["drive_brake_rpm_s"], rise)
    tau, supply = p["sample_period_s"], _off_is_infinite(p["supply_rpm"])
    supply = supplied(supply, p["supply_per_volt"], lost_v)
    wanted = w + p["windup"] * s.excess
    w = bounded(s.w0, wanted, rise * tau, brake * tau, supply, p["supply_share"])
    after = {"w0": w, "w1": s.w0, "w2": s.w1, "r1": r, "r2": s.r1, "excess": wanted - w}
    after |= {"ramp": ramp.value_rpm, "slope": ramp.slope_rpm_s}
    for name, value in after.items():
        setattr(s, name, np.where(due, value, getattr(s, name)))
    s.ticks = s.ticks + due


def _off_is_infinite(limit: FloatArray) -> FloatArray:
    """Return limits of which 0 means none, with infinity for none."""
    return np.where(limit > 0.0, limit, np.inf)


def _law_input(s: DriveState, p: Sets) -> tuple[FloatArray, Ramp]:
    """Return r(k), the mean over the tick of the delayed command behind the ramp, and the ramp at its end."""
    tau, period, jitters = p["sample_period_s"], p["command_period_s"], p["jitter_s"] > 0.0
    rise, jerk = _off_is_infinite(p["acceleration_rpm_s"]), _off_is_infinite(p["jerk_rpm_s2"])
    limits = RampLimits(rise, np.where(p["brake_rpm_s"] > 0.0, p["brake_rpm_s"], rise), jerk, tau)
    ramp, t = Ramp(s.ramp, s.slope), s.ticks * tau
    latest = np.minimum(np.floor(t / period + EPS), s.latches - 1)
    j = np.maximum(np.minimum(np.floor((t - p["delay_s"]) / period + EPS), latest), latest - (RING - 1))
    if np.any(jitters):
        j = np.where(jitters, _newest(s, latest, t + EPS * period), j)
    total, done = np.zeros(t.shape), np.zeros(t.shape)
    for _ in range(RING - 1):
        arrival = np.where(jitters, _at(s.arrival, j + 1), (j + 1) * period + p["delay_s"])
        arrives = (j + 1 <= latest) & (arrival < t + tau)
        if not np.any(arrives):
            break
        until = np.where(arrives, (arrival - t) / tau, done)
        moved, part = limits.moved(ramp, _at(s.command, j), until - done)
        total = np.where(arrives, total + part, total)
        ramp = Ramp(
            np.where(arrives, moved.value_rpm, ramp.value_rpm),
            np.where(arrives, moved.slope_rpm_s, ramp.slope_rpm_s),
        )
        done, j = until, j + arrives
    ramp, part = limits.moved(ramp, _at(s.command, j), 1 - done)
    return total + part, ramp


def _newest(s: DriveState, latest: FloatArray, times_s: FloatArray) -> FloatArray:
    """Return the numbers of the newest commands up to the latest that have arrived, or of the oldest kept."""
    ages = np.arange(float(RING))
    arrivals = np.take_along_axis(s.arrival, _slots(latest[..., None] - ages)[..., 0], axis=-1)
    arrived = arrivals <= times_s[..., None]
    arrived[..., -1] = True
    return np.asarray(latest - np.argmax(arrived, axis=-1), float)


def _at(ring: FloatArray, j: FloatArray) -> FloatArray:
    """Return the entries of latches j in a ring, of shape (sets, runs)."""
    return np.take_along_axis(ring, _slots(j), axis=-1)[..., 0]


def _slots(j: FloatArray) -> npt.NDArray[np.intp]:
    return np.asarray(np.mod(j, RING), np.intp)[..., None]
