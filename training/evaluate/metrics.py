"""The metrics of one episode, and their shares and means over many episodes with confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.model import Model
from mecanum_env.statistics import rms, wilson_interval
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.arena import TaskName
from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
CONFIDENCE: Final = 0.95
"""Confidence level of every interval."""
_RESAMPLES: Final = 2000
"""Bootstrap resamples of a mean."""
Reason = Literal[
    "", "hit", "clash", "left the field", "not back at maai", "no opening", "not kept", "lost", "time over"
]
"""Why an episode failed; empty for a success."""


@dataclass(frozen=True)
class Episode:
    """The metrics of one episode; None where a metric is not defined."""

    seed: int
    success: bool
    reason: Reason
    technique: str
    """Technique of the opponent's first strike, drawn even if it never comes; empty in tracking."""
    warning_s: float | None
    """Time from the first visible motion of that strike to its hit [s]."""
    duration_s: float
    total_reward: float
    """The return: undiscounted sum of rewards."""
    distance_error_m: float | None
    """RMS of distance - maai [m]: in the dodge from settling until the sword first rises, in tracking from
    `Rules.track_settle_s` on."""
    bearing_error_rad: float | None
    """RMS of the bearing over the same time [rad]."""
    speed_error_m_s: float
    """RMS of the commanded minus the actual velocity (ahead, left) at the end of each command [m/s]."""
    settling_s: float | None
    """Time until the robot is at maai and facing, and stays so until the sword first rises [s]."""
    overshoot: float | None
    """How far the distance fell below maai before the sword first rose, relative to the distance to cover."""
    saturated_share: float
    """Share of the commands that ask a wheel for its maximum speed or more."""
    command_time_s: float | None = field(compare=False)
    """Mean processor time of the controller per command [s]; ignored by `==`."""


@dataclass(frozen=True)
class Recording:
    """A recorded episode: how it ended, and n + 1 samples, at its start and at the end of each command."""

    seed: int
    success: bool
    reason: Reason
    technique: str
    warning_s: float | None
    command_times_s: tuple[float, ...]
    """Processor times of the commands that were timed [s]."""
    time_s: FloatArray
    """Time since the start [s], shape (n + 1,)."""
    distance_m: FloatArray
    """Distance between the centres [m], shape (n + 1,)."""
    bearing_rad: FloatArray
    """Bearing of the opponent [rad], shape (n + 1,)."""
    commands: FloatArray
    """V [rpm], theta [deg], VC [rpm] held until the sample, shape (n + 1, 3); the first row is 0."""
    actual: FloatArray
    """Body velocity: ahead, left [m/s], turn [rad/s], shape (n + 1, 3)."""
    guarded: FloatArray
    """1 while the opponent's sword is on guard, else 0, shape (n + 1,)."""
    reward: FloatArray
    """Reward of the step that ended at the sample, shape (n + 1,); the first is 0."""


def summarise(recorded: Recording, model: Model, rules: Rules, task: TaskName) -> Episode:
    """Return the metrics of a recorded episode of a task; the model is the one that the controller knows."""
    error = recorded.distance_m - rules.maai_m
    inside = (np.abs(error) <= rules.band_m) & (np.abs(recorded.bearing_rad) <= rules.facing_rad)
    before = slice(0, int(np.sum(np.cumprod(recorded.guarded)))) if task != "track" else slice(None)
    settling = settling_time(recorded.time_s[before], inside[before])
    if task == "track":
        # The rules judge samples strictly after this time.
        counted = recorded.time_s[before] > rules.track_settle_s
    else:
        counted = recorded.time_s[before] >= (np.inf if settling is None else settling)
    v, theta, vc = recorded.commands[1:].T
    wanted = command_to_twist(v, theta, vc, model.robot)
    saturated = is_saturated(
        command_to_wheels(v, theta, vc), model.wheel.saturation_rpm, model.wheel.command_quantum_rpm
    )
    return Episode(
        seed=recorded.seed,
        success=recorded.success,
        reason=recorded.reason,
        technique=recorded.technique,
        warning_s=recorded.warning_s,
        duration_s=float(recorded.time_s[-1]),
        total_reward=float(np.sum(recorded.reward)),
        distance_error_m=rms(error[before][counted]) if counted.any() else None,
        bearing_error_rad=rms(recorded.bearing_rad[before][counted]) if counted.any() else None,
        speed_error_m_s=rms(np.hypot(*(wanted - recorded.actual[1:])[:, :2].T)),
        settling_s=settling,
        overshoot=overshoot(recorded.distance_m[before], rules.maai_m),
        saturated_share=float(np.mean(saturated)),
        command_time_s=float(np.mean(recorded.command_times_s)) if recorded.command_times_s else None,
    )


def settling_time(time_s: FloatArray, inside: BoolArray) -> float | None:
    """Return the time after which a response stays within its band [s]; None if it ends outside.

    `inside` says of each sample whether it is within the band; both arrays have shape (n,).
    """
    if not inside[-1]:
        return None
    outside = np.flatnonzero(~inside)
    return float(time_s[0] if outside.size == 0 else time_s[outside[-1] + 1])


def overshoot(values: FloatArray, target: float) -> float | None:
    """Return how far a response exceeds its target, relative to the whole change; None without a change.

    The values are those of the response from its initial value on, shape (n,).
    """
    change = target - float(values[0])
    return None if change == 0.0 else max(float(np.max((values - target) / change)), 0.0)


def is_saturated(wheels_rpm: FloatArray, limit_rpm: float, quantum_rpm: float) -> BoolArray:
    """Return whether each command, shape (n, 4), asks some wheel for its maximum speed or more, shape (n,).

    Commands are rounded to the quantum: a speed this close to the limit counts as saturated.
    """
    return np.asarray(np.max(np.abs(wheels_rpm), axis=-1) >= limit_rpm - quantum_rpm)


@dataclass(frozen=True)
class Share:
    """Number of successes in some trials, with Wilson's interval of the probability of success."""

    successes: int
    trials: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """Successes divided by trials."""
        return self.successes / self.trials


@dataclass(frozen=True)
class Mean:
    """A mean over episodes with its bootstrap interval."""

    value: float
    low: float
    high: float
    count: int
    """Number of episodes in which the metric is defined."""


def share(successes: int, trials: int) -> Share:
    """Return the share of successes among trials with Wilson's 95 % interval.

    Raises:
        InputError: there are no trials.
    """
    if trials < 1:
        raise InputError("a share of 0 trials is undefined; play at least one episode")
    return Share(successes, trials, *wilson_interval(successes, trials, CONFIDENCE))


def success_of(episodes: Sequence[Episode]) -> Share:
    """Return the share of successes of episodes."""
    return share(sum(episode.success for episode in episodes), len(episodes))


def mean(values: Sequence[float | None]) -> Mean | None:
    """Return the mean of the values that are not None with its 95 % bootstrap interval; None without any.

    The values are of one episode each. The resampling is the same at every call.
    """
    known = np.array([value for value in values if value is not None], float)
    if known.size == 0:
        return None
    drawn = np.random.default_rng(0).integers(0, known.size, (_RESAMPLES, known.size))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(known[drawn].mean(axis=1), [tail, 100.0 - tail])
    return Mean(float(known.mean()), float(low), float(high), int(known.size))
