"""The whole drive in front of the servo: latched, rounded, limited and delayed command, law, setpoint ramp.

This is the reference for the plugin (mecanum_env/plugin/mecanum_wheel.c), which the tests hold equal to it
bit for bit, and the drive for engines without plugins. Time counts in substeps n of the timestep h:

- Latch j is due at the first substep with n h >= j T, T the command period. u_j is the command rounded, then
  shaped by what the drive does to it: dead band, gain, limit (`received_command`).
- Law tick k is due at the first substep with n h >= k tau, tau the sample period. Its input r(k) is the mean
  over the tick of the command delayed by `delay_s`, as far as it was latched by k tau; so a delay acts
  continuously, and without one r(k) is simply the last latched command. With an acceleration limit r(k) is
  the mean over the tick of a continuous ramp that follows the delayed command at the limit.
- The setpoint at the end of the substep lies on the line from w(k) to w(k+1), which is known when the tick
  starts: the ramp adds no delay.

A clock may be early by 1e-9 of its period, which absorbs the rounding of n h.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import LawState, WheelLaw
from mecanum_env.units import FloatArray

EPS: Final = 1e-9
"""A clock may be early by this part of its period."""
ABSURD_RPM: Final = 1e10
"""Commands beyond this, and NaN, count as 0, as they do for MuJoCo's own actuators."""
RING: Final = 32
"""Latched commands remembered; bounds the delay to RING - 3 command periods less a timestep."""


def longest_delay_s(command_period_s: float, timestep_s: float = 0.0) -> float:
    """Return the longest delay of a command [s] that a drive can remember.

    Args:
        command_period_s: of the robot [s].
        timestep_s: of the physics that runs the plugin [s].
    """
    return (RING - 3) * command_period_s - timestep_s


@dataclass(frozen=True)
class DriveParameters:
    """The law and what happens to a command before it.

    Raises:
        InputError: a value out of range, or a delay of more than RING - 3 command periods.
    """

    law: WheelLaw
    command_period_s: float
    """The robot latches its command this often [s]."""
    command_quantum_rpm: float = 0.0
    """Commands are rounded to multiples of this [rpm], halves to even; 0: not rounded."""
    saturation_rpm: float = math.inf
    """Commands are clipped to +- this [rpm]."""
    delay_s: float = 0.0
    """A latched command acts this much later [s]."""
    deadband_rpm: float = 0.0
    """Smaller commands count as 0 [rpm]."""
    gain: float = 1.0
    """Commands are multiplied by this."""
    reverse_ratio: float = 1.0
    """Commands to turn backwards are multiplied by this too."""
    drop_per_s: float = 0.0
    """Part of the gain that is lost in each second [1/s]."""
    softness_rpm: float = 0.0
    """The saturation begins this far below its limit, with a parabola that reaches it as far above [rpm]."""
    acceleration_rpm_s: float = math.inf
    """The command changes no faster than this [rpm/s]."""
    gap_rad: float = 0.0
    """Between motor and wheel [rad]. This and what follows is behind the setpoint: in the plugin only."""
    breakaway_n_m: float = 0.0
    """Friction of the wheel's bearing that a moving wheel does not feel [N m]."""
    stribeck_rad_s: float = 0.0
    """Speed at which it has lost 63 % of it [rad/s]."""
    coulomb_n_m: float = 0.0
    """Friction of the wheel's bearing at any speed [N m]."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.command_period_s) and self.command_period_s > 0.0):
            raise InputError(f"command_period_s = {self.command_period_s}, must be a finite number above 0")
        if not (math.isfinite(self.command_quantum_rpm) and self.command_quantum_rpm >= 0.0):
            raise InputError(
                f"command_quantum_rpm = {self.command_quantum_rpm}, must be finite and not below 0"
            )
        if not self.saturation_rpm > 0.0:
            raise InputError(f"saturation_rpm = {self.saturation_rpm}, must be above 0 (infinite: no limit)")
        for name in (
            *("deadband_rpm", "drop_per_s", "softness_rpm"),
            *("gap_rad", "breakaway_n_m", "stribeck_rad_s", "coulomb_n_m"),
        ):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise InputError(f"{name} = {getattr(self, name)}, must be finite and not below 0")
        for name in ("gain", "reverse_ratio"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(f"{name} = {getattr(self, name)}, must be a finite number above 0")
        if not self.acceleration_rpm_s > 0.0:
            raise InputError(
                f"acceleration_rpm_s = {self.acceleration_rpm_s}, must be above 0 (infinite: no limit)"
            )
        longest = longest_delay_s(self.command_period_s)
        if not 0.0 <= self.delay_s <= longest:
            raise InputError(
                f"delay_s = {self.delay_s}, must be 0 to {longest:g} ({RING - 3} command periods)"
            )


@dataclass(frozen=True)
class DriveState:
    """What a drive remembers between substeps; arrays share their leading axes (...), one entry a wheel."""

    substeps: int = 0
    ticks: int = 0
    latches: int = 0
    law: LawState = field(default_factory=LawState)
    """`law.w0` = w(k+1) and `law.w1` = w(k) are the ends of the current ramp [rpm]."""
    commands: FloatArray = field(default_factory=lambda: np.zeros(RING))
    """The last latched commands [rpm], shape (..., RING), the newest last."""
    ramp: npt.ArrayLike = 0.0
    """The command behind the acceleration limit at the end of the current tick [rpm], shape (...)."""

    @staticmethod
    def steady(speed_rpm: npt.ArrayLike) -> DriveState:
        """Return the state of a drive that has followed a constant command [rpm] for long."""
        speed = np.asarray(speed_rpm, float)
        commands = np.repeat(speed[..., None], RING, axis=-1)
        return DriveState(law=LawState.steady(speed), commands=commands, ramp=speed)


def received_command(
    parameters: DriveParameters, command_rpm: npt.ArrayLike, seconds: npt.ArrayLike = 0.0
) -> FloatArray:
    """Return what the drive makes of latched commands [rpm].

    NaN counts as 0; then rounding to the quantum, dead band, gain (in reverse another one, and less as time
    goes on) and saturation.

    Args:
        parameters: of the drive.
        command_rpm: the commands [rpm].
        seconds: since the start, at which each acts, of a shape that fits.
    """
    command = np.asarray(command_rpm, float)
    command = np.where(np.abs(command) <= ABSURD_RPM, command, 0.0)
    if parameters.command_quantum_rpm > 0.0:
        command = np.rint(command / parameters.command_quantum_rpm) * parameters.command_quantum_rpm
    command = np.where(np.abs(command) < parameters.deadband_rpm, 0.0, command)
    command = command * parameters.gain
    command = np.where(command < 0.0, command * parameters.reverse_ratio, command)
    command = command * np.maximum(0.0, 1.0 - parameters.drop_per_s * np.asarray(seconds, float))
    return saturated(command, parameters.saturation_rpm, parameters.softness_rpm)


def saturated(command_rpm: FloatArray, limit_rpm: float, softness_rpm: float) -> FloatArray:
    """Limit commands to +-limit [rpm], bent towards it by a parabola from `softness_rpm` below it on."""
    command, knee = command_rpm, min(softness_rpm, limit_rpm)
    if knee > 0.0 and math.isfinite(limit_rpm):
        beyond = np.abs(command) - (limit_rpm - knee)
        on_it = np.clip(beyond, 0.0, 2.0 * knee)  # where it counts; further out the square may overflow
        bent = np.copysign(limit_rpm - knee + beyond - on_it * on_it / (4.0 * knee), command)
        command = np.where((beyond > 0.0) & (beyond < 2.0 * knee), bent, command)
    limited: FloatArray = np.minimum(np.maximum(command, -limit_rpm), limit_rpm)
    return limited


def law_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
) -> FloatArray:
    """Return the delayed command's mean over each tick k [rpm], shape (..., K), before an acceleration limit.

    Args:
        parameters: of the drive.
        ticks: which k, shape (K,).
        latched_rpm: commands in order of latching, shape (..., J).
        latches: how many commands are latched by each tick, shape (K,) or one number.
        start: the j of the first of `latched_rpm`; earlier commands equal it.
    """
    total = np.zeros((*latched_rpm.shape[:-1], np.size(ticks)))
    for part, command in _held(parameters, ticks, latched_rpm, latches, start):
        total = total + part * command
    return total


def ramped_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
    before: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """Return r(k) [rpm], shape (..., K), and the ramp's end [rpm], shape (...).

    The ramp follows the delayed command and moves by at most the acceleration limit times a tick in a tick;
    r(k) is its mean over the tick. Without a limit it is the command itself, and r(k) that of `law_inputs`.

    Args:
        parameters: of the drive.
        ticks: which k, shape (K,), one after the other.
        latched_rpm: commands in order of latching, shape (..., J).
        latches: how many commands are latched by each tick, shape (K,) or one number.
        start: the j of the first of `latched_rpm`; earlier commands equal it.
        before: where the ramp begins [rpm], shape (...).
    """
    most = parameters.acceleration_rpm_s * parameters.law.sample_period_s
    held = list(_held(parameters, ticks, latched_rpm, latches, start))
    if math.isinf(most):
        inputs = law_inputs(parameters, ticks, latched_rpm, latches, start)
        return inputs, held[-1][1][..., -1] if inputs.shape[-1] else np.asarray(before, float)
    inputs, ramp = np.zeros((*latched_rpm.shape[:-1], np.size(ticks))), np.asarray(before, float)
    for k in range(inputs.shape[-1]):
        for parts, commands in held:
            part, command = parts[k], commands[..., k]
            end = np.minimum(np.maximum(command, ramp - most * part), ramp + most * part)
            way, ramp = end - ramp, end
            inputs[..., k] += part * end - way * np.abs(way) / (2 * most)
    return inputs, ramp


def _held(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the delayed commands that act within ticks, in order: parts (K,) of a tick, commands (..., K).

    A tick in which fewer act than in others has parts of 0 at the end.
    """
    tau, period, delay = parameters.law.sample_period_s, parameters.command_period_s, parameters.delay_s
    t = np.asarray(ticks, float) * tau
    latest = np.minimum(np.floor(t / period + EPS), np.asarray(latches, float) - 1.0)
    j = np.minimum(np.floor((t - delay) / period + EPS), latest)
    done = np.zeros(t.shape)
    while True:
        which = np.clip(j - start, 0, latched_rpm.shape[-1] - 1).astype(np.intp)
        arrival = (j + 1.0) * period + delay
        arrives = (j + 1.0 <= latest) & (arrival < t + tau)
        until = np.where(arrives, (arrival - t) / tau, 1.0)
        yield until - done, latched_rpm[..., which]
        if not arrives.any():
            return
        done, j = until, np.where(arrives, j + 1.0, j)


def step_drive(
    parameters: DriveParameters, state: DriveState, command_rpm: npt.ArrayLike, timestep: float
) -> tuple[FloatArray, DriveState]:
    """Advance one substep: return the setpoint at its end [rpm], shape (...), and the next state.

    Args:
        parameters: of the drive.
        state: at the substep's start.
        command_rpm: the command now [rpm], shape (...).
        timestep: of the physics [s]; the same at every call.
    """
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    now = state.substeps * timestep
    shape = np.broadcast_shapes(np.shape(command_rpm), state.commands.shape[:-1])
    commands = np.broadcast_to(state.commands, (*shape, RING))
    latches, ticks, law, ramp = state.latches, state.ticks, state.law, state.ramp
    while now >= latches * period - EPS * period:
        received = received_command(parameters, command_rpm, latches * period + parameters.delay_s)
        newest = np.broadcast_to(received, shape)
        commands = np.concatenate([commands[..., 1:], newest[..., None]], axis=-1)
        latches += 1
    while now >= ticks * tau - EPS * tau:
        r, ramp = ramped_inputs(parameters, [ticks], commands, latches, latches - RING, ramp)
        _, law = parameters.law.tick(law, r[..., 0])
        ticks += 1
    w0, w1 = np.asarray(law.w0, float), np.asarray(law.w1, float)
    part = ((state.substeps + 1) * timestep - (ticks - 1) * tau) / tau
    setpoint = w1 + (w0 - w1) * min(max(part, 0.0), 1.0)
    return setpoint, DriveState(state.substeps + 1, ticks, latches, law, commands, ramp)


def simulate_drive(
    parameters: DriveParameters,
    command_rpm: npt.ArrayLike,
    timestep: float,
    initial_rpm: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return the setpoints at the end of each substep [rpm], shape (..., n).

    The same as `step_drive` again and again, with a Python loop over law ticks only.

    Args:
        parameters: of the drive.
        command_rpm: the command at each substep [rpm], shape (..., n); leading axes are wheels or runs.
        timestep: of the physics [s].
        initial_rpm: the steady speed before the start [rpm], shape (...).
    """
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    command = np.asarray(command_rpm, float)
    n = command.shape[-1]
    times = np.arange(n + 1) * timestep
    latched_at = _first_substeps(period, times[:n])
    ticked_at = _first_substeps(tau, times[:n])
    before = np.broadcast_to(np.asarray(initial_rpm, float), command.shape[:-1])
    acts_at = np.arange(latched_at.size) * period + parameters.delay_s
    received = received_command(parameters, command[..., latched_at], acts_at)
    latched = np.concatenate([before[..., None], received], axis=-1)
    latches = np.searchsorted(latched_at, ticked_at, side="right")
    r, _ = ramped_inputs(parameters, np.arange(ticked_at.size), latched, latches, -1, before)
    w = parameters.law.simulate(r, LawState.steady(before))
    k = np.searchsorted(ticked_at, np.arange(n), side="right") - 1
    part = np.clip((times[1:] - k * tau) / tau, 0.0, 1.0)
    setpoints: FloatArray = w[..., k] + (w[..., k + 1] - w[..., k]) * part
    return setpoints


def latched_commands(
    parameters: DriveParameters,
    time_s: npt.ArrayLike,
    command_rpm: npt.ArrayLike,
    n_ticks: int,
    initial_rpm: float = 0.0,
) -> FloatArray:
    """Return r(k) [rpm], shape (n_ticks,), of a logged command: all that comes before the law.

    Args:
        parameters: of the drive.
        time_s: when each command was given [s], shape (N,), increasing; the first is the run's time 0.
        command_rpm: the commands [rpm], shape (N,), each held until the next. NaN is a missing sample: the
            one before holds on; before the first there is `initial_rpm`.
        n_ticks: how many law ticks.
        initial_rpm: the steady command before the run [rpm], which a delay lets act a little longer.

    Raises:
        InputError: an empty log, or arrays of different shapes.
    """
    time, command = np.asarray(time_s, float), np.asarray(command_rpm, float)
    if time.ndim != 1 or time.shape != command.shape or time.size == 0:
        raise InputError(
            f"time of shape {time.shape}, command of shape {command.shape}; must be one equal length"
        )
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    given = ~np.isnan(command)
    # Command j is the last one given by j T; index 0 stands for "none yet".
    count = math.floor(max(n_ticks - 1, 0) * tau / period + EPS) + 1
    which = np.searchsorted(time[given] - time[0], np.arange(count) * period + EPS * period, side="right")
    acts_at = np.arange(count) * period + parameters.delay_s
    received = received_command(parameters, np.concatenate([[0.0], command[given]])[which], acts_at)
    latched = np.concatenate([[initial_rpm], np.where(which == 0, initial_rpm, received)])
    return ramped_inputs(parameters, np.arange(n_ticks), latched, count, -1, initial_rpm)[0]


def _first_substeps(period: float, times: FloatArray) -> npt.NDArray[np.intp]:
    """Return, for each multiple of the period up to the last time, the first substep at or after it."""
    count = math.floor(times[-1] / period + EPS) + 2 if times.size else 0
    due = np.arange(count) * period - EPS * period
    first: npt.NDArray[np.intp] = np.searchsorted(times, due, side="left")
    return first[first < times.size]
