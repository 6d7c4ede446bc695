"""A run of a drive with its wheel off the floor: commands in, rows of a log out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid.studies.zoo.drives import kernel
from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.sensor import Motion, sample
from sysid.studies.zoo.drives.set_point import set_points

STEP_S = 1e-4
"""Largest step of the physics."""
_HISTORY_S = 5e-4
"""Largest time between two recorded points of the motion."""
_SETTLING_S = 0.2
"""Time before the run in which the wheel finds its rest, for example between two cogs."""
_BATTERY_STEP_V = 0.01


@dataclass(frozen=True, eq=False)
class Log:
    """A bench log as its user keeps it; arrays of shape (n,)."""

    time_s: FloatArray
    """Stamps, strictly rising from 0."""
    command_rpm: FloatArray
    """Command that was sent last at each stamp."""
    speed_rpm: FloatArray
    battery_v: FloatArray | None


@compiled
def _run(
    state: FloatArray,
    p: FloatArray,
    set_points_rad_s: FloatArray,
    awake: NDArray[np.bool_],
    load_n_m: FloatArray,
    start_s: float,
    steps: int,
    every: int,
    history: FloatArray,
) -> None:
    """Run `steps` steps of physics per tick and record every `every`-th of all steps."""
    h = p[kernel.TICK_S] / steps
    done = 0
    for n in range(len(set_points_rad_s)):
        if awake[n]:
            kernel.controller_tick(state, p, set_points_rad_s[n])
        for j in range(steps):
            if done % every == 0:
                row = history[done // every]
                row[0] = state[kernel.WHEEL_ANGLE]
                row[1] = state[kernel.WHEEL_SPEED]
                row[2] = state[kernel.WHEEL_ANGLE] + state[kernel.GAP]
                row[3] = state[kernel.MOTOR_SPEED]
                row[4] = state[kernel.SUPPLY]
            time_s = start_s + n * p[kernel.TICK_S] + j * h
            kernel.plant_substep(state, p, load_n_m[n], h, max(time_s, 0.0))
            done += 1


def move(
    drive: Drive,
    commands_rpm: FloatArray,
    rng: np.random.Generator,
    *,
    load_n_m: float = 0.0,
    step_s: float = STEP_S,
) -> Motion:
    """Return the motion of a drive that starts at rest at an angle drawn by `rng`.

    Args:
        drive: What moves.
        commands_rpm: One command [rpm] per `drive.link.period_s`, shape (m,).
        rng: Draws the angle, the place within the play, the phase of the loop's clock and the link's luck.
        load_n_m: External torque on the wheel's shaft while the run lasts.
        step_s: Largest step of the physics.
    """
    p = kernel.pack(drive)
    angle, gap_share, phase = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-1.0, 1.0), rng.random()
    tick_s = float(p[kernel.TICK_S])
    duration_s = len(commands_rpm) * drive.link.period_s
    # Before the run: time to settle, and what the log's window, filter and delay look back on.
    before = math.ceil((_SETTLING_S + drive.sensor.window_s + drive.sensor.late_s) / tick_s) + phase
    ticks = math.ceil(before + duration_s / tick_s) + 2
    ticks_s: FloatArray = (np.arange(ticks, dtype=np.float64) - before) * tick_s
    wanted = set_points(drive, commands_rpm, ticks_s, rng)
    load = np.where(ticks_s >= 0.0, load_n_m, 0.0)
    steps = max(1, math.ceil(tick_s / step_s - 1e-9))
    every = max(1, round(_HISTORY_S * steps / tick_s))
    history = np.empty((-(-len(ticks_s) * steps // every), 5))
    state = kernel.new_state(p, angle, gap_share)
    hangs = rng.random(len(ticks_s)) < drive.controller.freeze_share
    awake = ~hangs[np.maximum(ticks_s / max(drive.controller.freeze_s, tick_s), 0.0).astype(int)]
    _run(state, p, wanted, awake, load, float(ticks_s[0]), steps, every, history)
    time_s = ticks_s[0] + np.arange(len(history)) * (every * tick_s / steps)
    return Motion(time_s, *history.T)


def simulate(drive: Drive, commands_rpm: FloatArray, rng: np.random.Generator) -> Log:
    """Return the log of a run that starts at rest.

    `commands_rpm`, (m,), has one command per `drive.link.period_s`. The same state of `rng` gives the same
    start, the same luck of the link and the same noise, also to a drive with other values.
    """
    commands_rpm = np.asarray(commands_rpm, dtype=float)
    of_motion, of_sensor = rng.spawn(2)
    motion = move(drive, commands_rpm, of_motion)
    period_s = drive.link.period_s
    rows = sample(drive.sensor, motion, len(commands_rpm) * period_s, of_sensor)
    # A command that is sent at the instant of a row stands in that row.
    sent = np.floor(rows.time_s / period_s + 1e-9).astype(int)
    battery_v = None
    if drive.battery.logged:
        volts = np.interp(rows.taken_s, motion.time_s, motion.supply_v)
        volts *= drive.battery.full_v / drive.motor.supply_v
        battery_v = np.rint(volts / _BATTERY_STEP_V) * _BATTERY_STEP_V
    command_rpm = commands_rpm[np.minimum(sent, len(commands_rpm) - 1)]
    return Log(rows.time_s, command_rpm, rows.speed_rpm, battery_v)
