"""The way of commands to the wheel law: from the command that is sent to the inputs and the speed setpoint.

This is the reference for the plugin (mecanum_env/plugin/set_point.c), which tests hold equal to it bit
for bit, and the drive for engines without plugins. Time counts in substeps n of the timestep h:

- Latch j is due at the first substep with n h >= j T, with T the command period. The latched command is
  rounded, unless it is lost, then changed by dead band, gain and limit (`shaped_command`).
- With jitter each change of the command has its own delay (`mecanum_env.wheel_drive.link`).
- Law tick k is due at the first substep with n h >= k tau, with tau the sample period. Its input r(k) is the
  mean over the tick of the command delayed by `delay_s`, as far as it was latched by k tau. So the response
  is continuous in the delay, and without one r(k) is the last latched command. With an acceleration limit
  r(k) is the mean over the tick of a continuous ramp that follows the delayed command at the limit.
- The law's step from w(k) to w(k+1) may be bounded by the motor (`mecanum_env.wheel_drive.motor_bounds`).
- The setpoint at the end of the substep lies on the line from w(k) to w(k+1), which is known when the tick
  starts: the interpolation adds no delay.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import LawState
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import EPS, DriveParameters, require_open_loop, shaped_command
from mecanum_env.wheel_drive.ramp import Ramp
from mecanum_env.wheel_drive.shaping import rounded


@dataclass(frozen=True)
class Latched:
    """The last latched commands of drives of one kind, oldest first."""

    sent_rpm: FloatArray
    """Those that were not lost, rounded but not shaped, shape (..., J)."""
    received_rpm: FloatArray
    """What the drives make of them, shape (..., J)."""
    arrivals_s: FloatArray
    """When they arrive, shape (..., J); this only counts if the delay jitters."""

    @staticmethod
    def steady(speed_rpm: npt.ArrayLike, count: int = 1) -> Latched:
        """Return `count` equal commands [rpm], shape (...), that have always been there."""
        held = np.repeat(np.asarray(speed_rpm, float)[..., None], count, axis=-1)
        return Latched(held, held, np.zeros(held.shape))

    def followed_by(self, later: Latched) -> Latched:
        """Return these commands and later ones, the first of which is the last of these."""
        pairs = zip(vars(self).values(), vars(later).values(), strict=True)
        return Latched(*(np.concatenate([one[..., :-1], other], axis=-1) for one, other in pairs))

    def last(self, count: int) -> Latched:
        """Return the last of these commands, `count` of them."""
        return Latched(*(one[..., -count:] for one in vars(self).values()))


def latched(
    parameters: DriveParameters,
    command_rpm: FloatArray,
    first: int,
    before: Latched,
    lost_v: npt.ArrayLike = 0.0,
) -> Latched:
    """Return what drives latch: the last command `before`, and those at the latches from `first` on.

    The commands [rpm] have the shape (..., J), the result has J + 1. `lost_v` is the voltage that the supply
    has lost at these latches [V], of a shape that broadcasts to that of the commands.
    """
    link, count = parameters.link, command_rpm.shape[-1]
    kept = link.kept(first, count)
    sent = np.concatenate(
        [before.sent_rpm[..., -1:], rounded(command_rpm, parameters.command_quantum_rpm)], axis=-1
    )[..., kept]
    sent_at = np.arange(first, first + count) * link.period_s
    acts_at, arrivals = sent_at + link.delay_s, np.zeros(sent.shape)
    if link.jitter_s > 0.0:
        arrivals = link.arrivals(first, sent, before.arrivals_s[..., -1])
        acts_at = np.maximum(sent_at, arrivals[..., 1:])
    # A lost command leaves what the one before became.
    lost = np.broadcast_to(lost_v, command_rpm.shape)
    shaped = shaped_command(parameters, sent[..., 1:], acts_at, lost_v=lost)
    received = np.concatenate([before.received_rpm[..., -1:], shaped], axis=-1)[..., kept]
    return Latched(sent, received, arrivals)


def law_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    commands: Latched,
    latches: npt.ArrayLike,
    start: int,
) -> FloatArray:
    """Return the mean of the delayed command over each tick [rpm], shape (..., K), before a ramp.

    Args:
        parameters: parameters of the drive.
        ticks: numbers k of the ticks, shape (K,).
        commands: what the drives latched, of shapes (..., J).
        latches: number of commands that are latched by each tick, shape (K,) or one number.
        start: number j of the first of the commands; earlier ones equal it.
    """
    total = np.zeros((*commands.received_rpm.shape[:-1], np.size(ticks)))
    return _mean(total, _held(parameters, ticks, commands, latches, start))


def _mean(start: FloatArray, held: Iterable[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return the sum of a start, 0, and of all commands that are `held`, each times its share of a tick."""
    return sum((share * command for share, command in held), start=start)


def ramped_inputs(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    commands: Latched,
    latches: npt.ArrayLike,
    start: int,
    ramp: Ramp,
) -> tuple[FloatArray, Ramp]:
    """Return the law's inputs r(k) [rpm], shape (..., K), and the ramp at the end, of shape (...).

    The ramp follows the delayed command within the limits; r(k) is its mean over the tick. Without limits the
    ramp is the command itself, and r(k) that of `law_inputs`.

    The ticks are consecutive; `commands`, `latches` and `start` are as for `law_inputs`. `ramp` is that at
    the first tick, of shape (...).
    """
    limits = parameters.ramp_limits
    held = list(_held(parameters, ticks, commands, latches, start))
    inputs = np.zeros((*commands.received_rpm.shape[:-1], np.size(ticks)))
    if not limits.act:
        inputs = _mean(inputs, held)
        return inputs, Ramp.steady(held[-1][1][..., -1]) if inputs.shape[-1] else ramp
    for k in range(inputs.shape[-1]):
        for shares, command in held:
            ramp, contribution = limits.moved(ramp, command[..., k], shares[..., k])
            inputs[..., k] += contribution
    return inputs, ramp


def _held(
    parameters: DriveParameters,
    ticks: npt.ArrayLike,
    commands: Latched,
    latches: npt.ArrayLike,
    start: int,
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the delayed commands that are held within the ticks, in order of time.

    Each item has the shares of the ticks, shape (K,) or (..., K), for which commands (..., K) are held. If
    one tick has fewer commands than another, its last shares are 0.
    """
    tau, period, delay = parameters.law.sample_period_s, parameters.command_period_s, parameters.delay_s
    jitters, last = parameters.jitter_s > 0.0, commands.received_rpm.shape[-1] - 1
    t = np.asarray(ticks, float) * tau
    latest = np.minimum(np.floor(t / period + EPS), np.asarray(latches, float) - 1.0)
    if jitters:
        j = np.minimum(_newest(commands.arrivals_s, t + EPS * period) + float(start), latest)
    else:
        j = np.minimum(np.floor((t - delay) / period + EPS), latest)
    done = np.zeros(t.shape)
    while True:
        here, coming = (np.clip(i - start, 0, last).astype(np.intp) for i in (j, j + 1.0))
        arrival = _each(commands.arrivals_s, coming) if jitters else (j + 1.0) * period + delay
        arrives = (j + 1.0 <= latest) & (arrival < t + tau)
        until = np.where(arrives, (arrival - t) / tau, 1.0)
        yield until - done, _each(commands.received_rpm, here)
        if not arrives.any():
            return
        done, j = until, np.where(arrives, j + 1.0, j)


def _newest(arrivals_s: FloatArray, times_s: FloatArray) -> npt.NDArray[np.intp]:
    """Return the index of the last command that has arrived at each time (K,), shape (..., K); at least 0."""
    rows = arrivals_s.reshape(-1, arrivals_s.shape[-1])
    found = [np.maximum(np.searchsorted(row, times_s, side="right") - 1, 0) for row in rows]
    return np.array(found, np.intp).reshape(*arrivals_s.shape[:-1], times_s.size)


def _each(values: FloatArray, index: npt.NDArray[np.intp]) -> FloatArray:
    """Return values (..., J) at indices (K,), the same for all rows, or (..., K)."""
    return values[..., index] if index.ndim == 1 else np.take_along_axis(values, index, axis=-1)


def simulate_drive(
    parameters: DriveParameters,
    command_rpm: npt.ArrayLike,
    timestep: float,
    initial_rpm: npt.ArrayLike = 0.0,
    lost_v: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return the setpoints at the end of each substep of a `timestep` [s], in rpm, shape (..., n).

    The commands at each substep [rpm] have the shape (..., n), and the steady speeds before the start [rpm]
    the shape (...); leading axes are wheels or runs. `lost_v` is the voltage that the supply has lost at each
    substep [V], of a shape that broadcasts to that of the commands.

    Raises:
        InputError: a custom effect changes the command by the wheel's speed or angle, which only a simulation
            of the wheel knows.
    """
    require_open_loop(parameters)
    tau, period = parameters.law.sample_period_s, parameters.command_period_s
    command = np.asarray(command_rpm, float)
    n = command.shape[-1]
    times = np.arange(n + 1) * timestep
    latched_at = _first_substeps(period, times[:n])
    ticked_at = _first_substeps(tau, times[:n])
    initial = np.broadcast_to(np.asarray(initial_rpm, float), command.shape[:-1])
    lost = np.broadcast_to(lost_v, command.shape)
    before = Latched.steady(initial)
    commands = latched(parameters, command[..., latched_at], 0, before, lost[..., latched_at])
    latches = np.searchsorted(latched_at, ticked_at, side="right")
    r, _ = ramped_inputs(parameters, np.arange(ticked_at.size), commands, latches, -1, Ramp.steady(initial))
    at_ticks = lost[..., ticked_at]
    w = parameters.motor_bounds.simulate(parameters.law, r, LawState.steady(initial), at_ticks)
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
    """Return the law's inputs r(k) [rpm], shape (n_ticks,), for a logged command, as for `LatchedLog.of`.

    Raises:
        InputError: an empty log, arrays of different shapes, or a custom effect as for `simulate_drive`.
    """
    return LatchedLog.of(parameters, time_s, command_rpm, n_ticks, initial_rpm).inputs(parameters)


@dataclass(frozen=True, eq=False)
class LatchedLog:
    """What a drive latches of a logged command."""

    commands: Latched
    """The steady command before the run, and those at the `latches` of the run, shape (latches + 1,)."""
    latches: int
    n_ticks: int
    initial_rpm: float

    @classmethod
    def of(
        cls,
        parameters: DriveParameters,
        time_s: npt.ArrayLike,
        command_rpm: npt.ArrayLike,
        n_ticks: int,
        initial_rpm: float = 0.0,
    ) -> LatchedLog:
        """Return what a drive latches of a log.

        The run of `n_ticks` law ticks starts at the first of the increasing times [s], shape (N,). Each
        command [rpm], shape (N,), is held until the next one. NaN is a missing sample: the previous command
        holds on, or, before the first one, the steady command before the run, `initial_rpm`.

        Raises:
            InputError: as for `latched_commands`.
        """
        require_open_loop(parameters)
        time, command = np.asarray(time_s, float), np.asarray(command_rpm, float)
        if time.ndim != 1 or time.shape != command.shape or time.size == 0:
            raise InputError(
                f"time of shape {time.shape}, command of shape {command.shape}; must be one equal length"
            )
        tau, period = parameters.law.sample_period_s, parameters.command_period_s
        given = ~np.isnan(command)
        # Latch j takes the last command given by j T; index 0 stands for "none yet".
        count = math.floor(max(n_ticks - 1, 0) * tau / period + EPS) + 1
        due = np.arange(count) * period + EPS * period
        index = np.searchsorted(time[given] - time[0], due, side="right")
        sent, before = np.concatenate([[initial_rpm], command[given]])[index], Latched.steady(initial_rpm)
        commands = latched(parameters, sent, 0, before)
        # The steady command before the first one is that behind all effects.
        steady = np.concatenate([[True], index == 0])
        commands = replace(commands, received_rpm=np.where(steady, initial_rpm, commands.received_rpm))
        return cls(commands, count, n_ticks, initial_rpm)

    def inputs(self, parameters: DriveParameters) -> FloatArray:
        """Return the law's inputs r(k) [rpm], shape (n_ticks,), of a drive that latches these commands."""
        ticks, ramp = np.arange(self.n_ticks), Ramp.steady(self.initial_rpm)
        return ramped_inputs(parameters, ticks, self.commands, self.latches, -1, ramp)[0]


def _first_substeps(period: float, times: FloatArray) -> npt.NDArray[np.intp]:
    """Return the first substep at or after each multiple of the period, up to the last of `times` (n,)."""
    count = math.floor(times[-1] / period + EPS) + 2 if times.size else 0
    due = np.arange(count) * period - EPS * period
    first: npt.NDArray[np.intp] = np.searchsorted(times, due, side="left")
    return first[first < times.size]
