"""What is measured of one episode's motion: pure functions of arrays over its samples.

One episode: its samples while it is played, and what is kept of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.model import Model
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.arena import TaskName
from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]


def settling_time(time_s: FloatArray, inside: BoolArray) -> float | None:
    """Return when a response was within its band for good [s]; None if it was outside at the end.

    Args:
        time_s: of the samples, (n,) [s].
        inside: whether it was within the band, (n,).
    """
    if not inside[-1]:
        return None
    outside = np.flatnonzero(~inside)
    return float(time_s[0] if outside.size == 0 else time_s[outside[-1] + 1])


def overshoot(values: FloatArray, target: float) -> float | None:
    """Return how far a response went beyond its target, over the whole change; None for no change.

    Args:
        values: (n,), the first one is where it starts.
        target: where it should end.
    """
    change = target - float(values[0])
    if change == 0.0:
        return None
    beyond = np.max((values - target) / change)
    return max(float(beyond), 0.0)


def rms(values: FloatArray) -> float | None:
    """Return the root mean square of values, of any shape; None for none."""
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def saturated(asked_rpm: FloatArray, ceiling_rpm: float, quantum_rpm: float) -> BoolArray:
    """Return which commands ask some wheel for its ceiling or more, (n,).

    Args:
        asked_rpm: of each wheel, (n, 4).
        ceiling_rpm: beyond it a command is cut.
        quantum_rpm: commands are rounded to it: that near counts as at the ceiling.
    """
    at_ceiling: BoolArray = np.max(np.abs(asked_rpm), axis=-1) >= ceiling_rpm - quantum_rpm
    return at_ceiling


Reason = Literal[
    "", "hit", "clash", "left the field", "not back at maai", "no opening", "not kept", "lost", "time over"
]
"""Why an episode failed; empty for a success."""


@dataclass(frozen=True)
class Episode:
    """What is kept of one episode; None where a measure does not apply."""

    seed: int
    success: bool
    reason: Reason
    technique: str
    """What the opponent strikes first with, or would have; empty where it never strikes (tracking)."""
    warning_s: float | None
    """From the first visible motion of that strike to its hit [s]."""
    duration_s: float
    total_reward: float
    """The return: the undiscounted sum of rewards."""
    distance_error_m: float | None
    """Tracking error: root mean square of distance - maai [m]; in the dodge from settling until the sword
    first rises, in tracking from when it counts."""
    bearing_error_rad: float | None
    """The same of the bearing [rad]."""
    speed_error_m_s: float
    """Root mean square of commanded minus actual velocity (ahead, left) at the end of each command [m/s]."""
    settling_s: float | None
    """Until at maai and facing, for good until the sword first rises [s]."""
    overshoot: float | None
    """How much nearer than maai it came before the sword first rose, over the distance to cover."""
    saturated_share: float
    """Of the commands, those that ask a wheel for its ceiling or more."""
    command_time_s: float | None = field(compare=False)
    """Mean processor time of the controller for a command [s]; it does not count in `==`."""


@dataclass(frozen=True)
class Trace:
    """The samples of an episode: at its start (row 0) and at the end of each command, n + 1 of them."""

    time_s: FloatArray
    """(n + 1,)"""
    distance_m: FloatArray
    """(n + 1,)"""
    bearing_rad: FloatArray
    """(n + 1,)"""
    commands: FloatArray
    """V [rpm], theta [deg], VC [rpm] that were held until the sample, (n + 1, 3); the first is 0."""
    actual: FloatArray
    """Body velocity: ahead, left [m/s], turn [rad/s], (n + 1, 3)."""
    guarded: FloatArray
    """1 while the opponent's sword has not moved yet, else 0, (n + 1,)."""
    reward: FloatArray
    """Of the step that ended at the sample, (n + 1,); the first is 0."""


@dataclass(frozen=True)
class Ending:
    """How an episode ended."""

    seed: int
    success: bool
    reason: Reason
    technique: str
    warning_s: float | None
    command_times_s: tuple[float, ...]
    """Of the commands that were timed."""


def summarise(trace: Trace, ending: Ending, model: Model, rules: Rules, task: TaskName) -> Episode:
    """Return what is kept of an episode.

    Args:
        trace: its samples.
        ending: how it ended.
        model: the robot as the controller knows it: its kinematics and its wheels' ceiling count.
        rules: maai, band and angle.
        task: what was played.
    """
    error = trace.distance_m - rules.maai_m
    inside = (np.abs(error) <= rules.band_m) & (np.abs(trace.bearing_rad) <= rules.facing_rad)
    before = slice(0, int(np.sum(np.cumprod(trace.guarded)))) if task != "track" else slice(None)
    settling = settling_time(trace.time_s[before], inside[before])
    since = rules.track_settle_s if task == "track" else np.inf if settling is None else settling
    # In tracking the moment it counts from is not part of the time that counts.
    counts = trace.time_s[before] > since if task == "track" else trace.time_s[before] >= since
    v, theta, vc = trace.commands[1:].T
    wanted = command_to_twist(v, theta, vc, model.robot)
    wheels = command_to_wheels(v, theta, vc)
    ceiling, quantum = model.wheel.saturation_rpm, model.wheel.command_quantum_rpm
    return Episode(
        seed=ending.seed,
        success=ending.success,
        reason=ending.reason,
        technique=ending.technique,
        warning_s=ending.warning_s,
        duration_s=float(trace.time_s[-1]),
        total_reward=float(np.sum(trace.reward)),
        distance_error_m=rms(error[before][counts]),
        bearing_error_rad=rms(trace.bearing_rad[before][counts]),
        speed_error_m_s=rms(np.hypot(*(wanted - trace.actual[1:])[:, :2].T)) or 0.0,
        settling_s=settling,
        overshoot=overshoot(trace.distance_m[before], rules.maai_m),
        saturated_share=float(np.mean(saturated(wheels, ceiling, quantum))),
        command_time_s=float(np.mean(ending.command_times_s)) if ending.command_times_s else None,
    )
