"""The drive of one wheel in front of its servo: from the command that is sent to the speed setpoint.

This is the reference for the plugin (mecanum_env/plugin/chain.c), which tests hold equal to it bit
for bit, and the drive for engines without plugins. Time counts in substeps n of the timestep h:

- Latch j is due at the first substep with n h >= j T, with T the command period. The latched command is
  rounded, then changed by dead band, gain and limit (`received_command`).
- Law tick k is due at the first substep with n h >= k tau, with tau the sample period. Its input r(k) is the
  mean over the tick of the command delayed by `delay_s`, as far as it was latched by k tau. So the response
  is continuous in the delay, and without one r(k) is the last latched command. With an acceleration limit
  r(k) is the mean over the tick of a continuous ramp that follows the delayed command at the limit.
- The law's step from w(k) to w(k+1) may be bounded by the motor (`mecanum_env.law.motor_bounds`).
- The setpoint at the end of the substep lies on the line from w(k) to w(k+1), which is known when the tick
  starts: the interpolation adds no delay.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import LawState, WheelLaw
from mecanum_env.law.motor_bounds import MotorBounds, steepest_share
from mecanum_env.law.program import Program, inputs_of, require_runs
from mecanum_env.law.shaping import shaped
from mecanum_env.law.wheel_load import NO_LOAD, WheelLoad
from mecanum_env.units import FloatArray

EPS: Final = 1e-9
"""Share of its period by which a clock may be early; it absorbs the rounding of n h."""
RING: Final = 32
"""Number of latched commands that a drive remembers; it bounds the delay, see `longest_delay_s`."""


def longest_delay_s(command_period_s: float, timestep_s: float = 0.0) -> float:
    """Return the longest delay of a command [s] that a drive can represent, given the robot's command period.

    `timestep_s` is that of the physics that runs the plugin [s]; 0 without one.
    """
    return (RING - 3) * command_period_s - timestep_s


@dataclass(frozen=True)
class DriveParameters:
    """The law, and what the drive does to a command before and after it.

    Raises:
        InputError: a value out of range, or a delay of more than RING - 3 command periods.
    """

    law: WheelLaw
    command_period_s: float
    """Period at which the robot latches its command [s]."""
    command_quantum_rpm: float = 0.0
    """Commands are rounded to multiples of this [rpm], halves to even; 0: not rounded."""
    saturation_rpm: float = math.inf
    """Commands are clipped to +- this [rpm]."""
    delay_s: float = 0.0
    """Time from the latch to the effect of a command [s]."""
    deadband_rpm: float = 0.0
    """Commands smaller than this count as 0 [rpm]."""
    gain: float = 1.0
    """Factor on every command."""
    reverse_ratio: float = 1.0
    """Further factor on negative commands."""
    drop_per_s: float = 0.0
    """Share of the gain that is lost in each second [1/s]."""
    softness_rpm: float = 0.0
    """The saturation begins this far below its limit [rpm]; see `mecanum_env.law.shaping.saturated`."""
    acceleration_rpm_s: float = math.inf
    """Largest rate of change of the law's input [rpm/s]."""
    drive_acceleration_rpm_s: float = math.inf
    """Largest acceleration of the wheel itself by its motor [rpm/s]."""
    drive_brake_rpm_s: float = 0.0
    """Largest deceleration of the wheel itself by its motor [rpm/s]; 0: as its acceleration."""
    supply_rpm: float = math.inf
    """Speed at which the supply leaves the motor no torque [rpm]."""
    load: WheelLoad = NO_LOAD
    """What acts behind the setpoint; see `mecanum_env.law.servo`."""
    command_program: Program = ()
    """What a custom effect adds to each command before the dead band [rpm]; see `mecanum_env.law.program`."""
    set_point_program: Program = ()
    """What a custom effect adds behind the gains and before the saturation [rpm]."""
    load_program: Program = ()
    """Speed that the wheel gains by a custom load, which is a torque of servo times this speed [rpm]."""

    def __post_init__(self) -> None:
        for name in ("command_period_s", "gain", "reverse_ratio"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(f"{name} = {getattr(self, name)}, must be a finite number above 0")
        for name in (
            *("command_quantum_rpm", "deadband_rpm", "drop_per_s", "softness_rpm", "drive_brake_rpm_s"),
        ):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise InputError(f"{name} = {getattr(self, name)}, must be finite and not below 0")
        limits = ("saturation_rpm", "acceleration_rpm_s", "drive_acceleration_rpm_s", "supply_rpm")
        for name in limits:
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name} = {getattr(self, name)}, must be above 0 (infinite: no limit)")
        for program in (self.command_program, self.set_point_program, self.load_program):
            require_runs(program)
        longest = longest_delay_s(self.command_period_s)
        if not 0.0 <= self.delay_s <= longest:
            raise InputError(
                f"delay_s = {self.delay_s}, must be 0 to {longest:g} ({RING - 3} command periods)"
            )

    @property
    def motor_bounds(self) -> MotorBounds:
        """What the motor's torque and its supply leave of the law's steps."""
        tick = self.law.sample_period_s
        return MotorBounds(
            self.drive_acceleration_rpm_s * tick,
            (self.drive_brake_rpm_s or self.drive_acceleration_rpm_s) * tick,
            self.supply_rpm,
            steepest_share(self.law) if math.isfinite(self.supply_rpm) else 0.0,
        )


def received_command(
    parameters: DriveParameters,
    command_rpm: npt.ArrayLike,
    seconds: npt.ArrayLike = 0.0,
    speed_rpm: npt.ArrayLike = 0.0,
    angle_rad: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return latched commands after rounding, dead band, gain and saturation [rpm]; NaN counts as 0.

    `seconds` is the time since the start at which each takes effect [s]; `speed_rpm` and `angle_rad` are
    those of the wheel at the latch, which custom effects may use. They are of shapes that broadcast.
    """
    return shaped(vars(parameters), command_rpm, seconds, speed_rpm, angle_rad)


def law_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
) -> FloatArray:
    """Return the mean of the delayed command over each tick [rpm], shape (..., K), before a ramp.

    Args:
        parameters: parameters of the drive.
        ticks: numbers k of the ticks, shape (K,).
        latched_rpm: commands in order of latching, shape (..., J).
        latches: number of commands that are latched by each tick, shape (K,) or one number.
        start: number j of the first of `latched_rpm`; earlier commands equal it.
    """
    total = np.zeros((*latched_rpm.shape[:-1], np.size(ticks)))
    for share, command in _held(parameters, ticks, latched_rpm, latches, start):
        total = total + share * command
    return total


def ramped_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
    ramp_rpm: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """Return the law's inputs r(k) [rpm], shape (..., K), and the ramp's value at the end [rpm], shape (...).

    The ramp follows the delayed command at the acceleration limit; r(k) is its mean over the tick. Without a
    limit the ramp is the command itself, and r(k) that of `law_inputs`.

    The ticks are consecutive; `latched_rpm`, `latches` and `start` are as for `law_inputs`. `ramp_rpm` is the
    value of the ramp at the first tick [rpm], shape (...).
    """
    limit = parameters.acceleration_rpm_s * parameters.law.sample_period_s  # change in one tick
    held = list(_held(parameters, ticks, latched_rpm, latches, start))
    if math.isinf(limit):
        inputs = law_inputs(parameters, ticks, latched_rpm, latches, start)
        return inputs, held[-1][1][..., -1] if inputs.shape[-1] else np.asarray(ramp_rpm, float)
    inputs, ramp = np.zeros((*latched_rpm.shape[:-1], np.size(ticks))), np.asarray(ramp_rpm, float)
    for k in range(inputs.shape[-1]):
        for shares, commands in held:
            share, command = shares[k], commands[..., k]
            end = np.minimum(np.maximum(command, ramp - limit * share), ramp + limit * share)
            change, ramp = end - ramp, end
            inputs[..., k] += share * end - change * np.abs(change) / (2 * limit)
    return inputs, ramp


def _held(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    latched_rpm: FloatArray,
    latches: npt.ArrayLike,
    start: int,
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the delayed commands that are held within the ticks, in order of time.

    Each item has the shares (K,) of the ticks for which commands (..., K) are held. If one tick has fewer
    commands than another, its last shares are 0.
    """
    tau, period, delay = parameters.law.sample_period_s, parameters.command_period_s, parameters.delay_s
    t = np.asarray(ticks, float) * tau
    latest = np.minimum(np.floor(t / period + EPS), np.asarray(latches, float) - 1.0)
    j = np.minimum(np.floor((t - delay) / period + EPS), latest)
    done = np.zeros(t.shape)
    while True:
        index = np.clip(j - start, 0, latched_rpm.shape[-1] - 1).astype(np.intp)
        arrival = (j + 1.0) * period + delay
        arrives = (j + 1.0 <= latest) & (arrival < t + tau)
        until = np.where(arrives, (arrival - t) / tau, 1.0)
        yield until - done, latched_rpm[..., index]
        if not arrives.any():
            return
        done, j = until, np.where(arrives, j + 1.0, j)


def simulate_drive(
    parameters: DriveParameters,
    command_rpm: npt.ArrayLike,
    timestep: float,
    initial_rpm: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return the setpoints at the end of each substep of a `timestep` [s], in rpm, shape (..., n).

    The commands at each substep [rpm] have the shape (..., n), and the steady speeds before the start [rpm]
    the shape (...); leading axes are wheels or runs.

    Raises:
        InputError: a custom effect changes the command by the wheel's speed or angle, which only a simulation
            of the wheel knows.
    """
    _require_open_loop(parameters)
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    command = np.asarray(command_rpm, float)
    n = command.shape[-1]
    times = np.arange(n + 1) * timestep
    latched_at = _first_substeps(period, times[:n])
    ticked_at = _first_substeps(tau, times[:n])
    initial = np.broadcast_to(np.asarray(initial_rpm, float), command.shape[:-1])
    acts_at = np.arange(latched_at.size) * period + parameters.delay_s
    received = received_command(parameters, command[..., latched_at], acts_at)
    latched = np.concatenate([initial[..., None], received], axis=-1)
    latches = np.searchsorted(latched_at, ticked_at, side="right")
    r, _ = ramped_inputs(parameters, np.arange(ticked_at.size), latched, latches, -1, initial)
    w = parameters.motor_bounds.simulate(parameters.law, r, LawState.steady(initial))
    k = np.searchsorted(ticked_at, np.arange(n), side="right") - 1
    share = np.clip((times[1:] - k * tau) / tau, 0.0, 1.0)
    return np.asarray(w[..., k] + (w[..., k + 1] - w[..., k]) * share)


def latched_commands(
    parameters: DriveParameters,
    time_s: npt.ArrayLike,
    command_rpm: npt.ArrayLike,
    n_ticks: int,
    initial_rpm: float = 0.0,
) -> FloatArray:
    """Return the law's inputs r(k) [rpm], shape (n_ticks,), for a logged command.

    The run of `n_ticks` law ticks starts at the first of the increasing times [s], shape (N,). Each command
    [rpm], shape (N,), is held until the next one. NaN is a missing sample: the previous command holds on, or,
    before the first one, the steady command before the run, `initial_rpm`.

    Raises:
        InputError: an empty log, arrays of different shapes, or a custom effect as for `simulate_drive`.
    """
    _require_open_loop(parameters)
    time, command = np.asarray(time_s, float), np.asarray(command_rpm, float)
    if time.ndim != 1 or time.shape != command.shape or time.size == 0:
        raise InputError(
            f"time of shape {time.shape}, command of shape {command.shape}; must be one equal length"
        )
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    given = ~np.isnan(command)
    # Latch j takes the last command given by j T; index 0 stands for "none yet".
    count = math.floor(max(n_ticks - 1, 0) * tau / period + EPS) + 1
    index = np.searchsorted(time[given] - time[0], np.arange(count) * period + EPS * period, side="right")
    acts_at = np.arange(count) * period + parameters.delay_s
    received = received_command(parameters, np.concatenate([[0.0], command[given]])[index], acts_at)
    latched = np.concatenate([[initial_rpm], np.where(index == 0, initial_rpm, received)])
    return ramped_inputs(parameters, np.arange(n_ticks), latched, count, -1, initial_rpm)[0]


def _require_open_loop(parameters: DriveParameters) -> None:
    used = inputs_of(parameters.command_program) | inputs_of(parameters.set_point_program)
    if used & {"speed", "angle"}:
        raise InputError(
            "a custom effect of the command or the set-point uses the wheel's speed or angle: the commands "
            "alone do not give the set-points, simulate the wheel (mecanum_env.simulator)"
        )


def _first_substeps(period: float, times: FloatArray) -> npt.NDArray[np.intp]:
    """Return the first substep at or after each multiple of the period, up to the last of `times` (n,)."""
    count = math.floor(times[-1] / period + EPS) + 2 if times.size else 0
    due = np.arange(count) * period - EPS * period
    first: npt.NDArray[np.intp] = np.searchsorted(times, due, side="left")
    return first[first < times.size]
