"""From late observations to the present: the robot's own motion, known from its commands, and the opponent's.

`OwnMotion` predicts the robot's motion from the commands sent. `ObservationPredictor` uses it to bring a late
observation forward to the time at which the answer to it acts.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model
from mecanum_env.tankendo import Observed, Sensors
from mecanum_env.units import FloatArray
from training.controllers.interface import Command
from training.controllers.motion_model import MotionModel, MotionState

_KEPT_S = 1.5
"""Length of the remembered motion [s]; longer than the delays of any sensor and command together."""
_SMOOTHING = 0.75
"""Weight of the newest observation in the opponent's velocity: noise would be fed forward."""
_CORRECTION = 0.2
"""Weight of the newest observation in the correction of the own velocity."""


class OwnMotion:
    """The robot's motion since the start, as the model predicts it from the commands.

    Time is counted in commands sent. A robot whose commands act late does the same that much later.
    """

    def __init__(self, model: Model) -> None:
        self.model = MotionModel(model)
        self._kept = round(_KEPT_S / self.model.tick_s)
        self.reset()

    def reset(self) -> None:
        """Start anew with a robot at rest."""
        self.state: MotionState = self.model.rest()
        self.commands = 0
        """Number of commands sent."""
        self._twists: deque[FloatArray] = deque([np.zeros(3)] * (self._kept + 1), maxlen=self._kept + 1)

    @property
    def time_s(self) -> float:
        """Time since the start [s]."""
        return self.commands * self.model.period_s

    def send(self, command: Command) -> None:
        """Predict the motion during the period of a command that is sent now."""
        wheels = self.model.drives.received(command_to_wheels(*command)[:, None], self.time_s)
        twists, self.state = self.model.play(self.state, wheels, self.model.ticks(self.commands))
        self._twists.extend(twists[:, :, 0])
        self.commands += 1

    def twist(self, ago_s: float) -> FloatArray:
        """Return the twist `ago_s` before now: ahead, left [m/s], turn [rad/s], shape (3,)."""
        return np.asarray(self._past(ago_s)[0], float)

    def twists(self, ago_s: FloatArray) -> FloatArray:
        """Return what `twist` does for k times before now, shape (k, 3)."""
        kept = np.array(self._twists)
        ages = self.model.tick_s * np.arange(len(kept) - 1.0, -1.0, -1.0)
        return np.stack([np.interp(-ago_s, -ages, one) for one in kept.T], axis=1)

    def recent(self, ticks: int) -> FloatArray:
        """Return the twists of the last law ticks until now, oldest first, shape (ticks + 1, 3)."""
        return np.array(list(self._twists)[-1 - ticks :])

    def moved(self, ago_s: float, until_s: float = 0.0) -> FloatArray:
        """Return the pose `until_s` before now in the frame of the pose `ago_s` before now, shape (3,).

        The pose is x, y [m], yaw [rad]; `until_s` must not exceed `ago_s`.
        """
        moved = self._until_now(ago_s)
        if until_s <= 0.0:
            return moved
        rest = self._until_now(until_s)
        cos, sin = np.cos(moved[2] - rest[2]), np.sin(moved[2] - rest[2])
        back = np.array([cos * rest[0] - sin * rest[1], sin * rest[0] + cos * rest[1], rest[2]])
        return np.asarray(moved - back, float)

    def _until_now(self, ago_s: float) -> FloatArray:
        past = self._past(ago_s)
        if len(past) < 2:
            return np.zeros(3)
        steps = np.full(len(past) - 1, self.model.tick_s)
        steps[0] = ago_s - self.model.tick_s * (len(past) - 2)
        return np.asarray(integrated_path(past[:, :, None], steps)[-1, :, 0], float)

    def _past(self, ago_s: float) -> FloatArray:
        """Return the twists from `ago_s` before now until now, (m, 3); the first is interpolated."""
        ticks = min(max(ago_s / self.model.tick_s, 0.0), float(self._kept))
        whole = int(np.ceil(ticks - 1e-9))
        twists = self.recent(whole)
        if whole > 0:
            twists[0] = twists[0] + (whole - ticks) * (twists[1] - twists[0])
        return twists


def seen_from(pose: FloatArray, x_m: float, y_m: float) -> tuple[float, float]:
    """Return a point [m] in the frame of a pose: x, y [m], yaw [rad], shape (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = x_m - pose[0], y_m - pose[1]
    return float(cos * dx + sin * dy), float(cos * dy - sin * dx)


def integrated_path(twists: FloatArray, steps_s: FloatArray) -> FloatArray:
    """Return the poses x, y [m], yaw [rad] of paths that begin at 0 with heading 0, shape (m + 1, 3, n).

    Uses the trapezoidal rule with the heading at the middle of each of the m steps, between the body twists
    at the start and at the ends of the steps, shape (m + 1, 3, n).
    """
    mean = 0.5 * (twists[1:] + twists[:-1]) * steps_s[:, None, None]
    poses = np.zeros_like(twists)
    np.cumsum(mean[:, 2], axis=0, out=poses[1:, 2])
    heading = 0.5 * (poses[1:, 2] + poses[:-1, 2])
    cos, sin = np.cos(heading), np.sin(heading)
    np.cumsum(cos * mean[:, 0] - sin * mean[:, 1], axis=0, out=poses[1:, 0])
    np.cumsum(sin * mean[:, 0] + cos * mean[:, 1], axis=0, out=poses[1:, 1])
    return poses


class ObservationPredictor:
    """Brings observations forward to the time at which the answer to them acts.

    The robot's own motion until then is known: that of the commands under way, by `OwnMotion`, corrected by
    the observed velocity error. The opponent is assumed to keep its smoothed velocity. The horizon is the
    time from what an observation shows until the answer acts; by default the delays of sensors and commands.
    """

    def __init__(self, model: Model, horizon_s: float | None = None) -> None:
        self.command_s = drive_parameters(model).delay_s
        """Time from sending a command until it acts [s]."""
        self.horizon_s = Sensors.delay_s + self.command_s if horizon_s is None else horizon_s
        """Time from what an observation shows until the answer acts [s]."""
        self.share = np.ones(3)
        """Share of the predicted twist that the robot reaches: ahead, left, turn, shape (3,)."""
        self.own = OwnMotion(model)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self.own.reset()
        self._opponent: FloatArray | None = None
        self.velocity_error = np.zeros(3)
        """Smoothed observed minus predicted own twist: ahead, left [m/s], turn [rad/s], shape (3,)."""

    def send(self, command: Command) -> None:
        """Take note of the command that answers the last observation."""
        self.own.send(command)

    def predict(self, seen: Observed) -> Observed:
        """Return the observation as it would be when the answer acts.

        The opponent's place and smoothed velocity are given in the frame of the robot at that time; the sword
        stays as it was `seen`.
        """
        horizon = self.horizon_s
        measured = np.array([float(seen.vx), float(seen.vy), float(seen.yaw_rate)])
        innovation = measured - self.share * self.own.twist(horizon) - self.velocity_error
        self.velocity_error = self.velocity_error + _CORRECTION * innovation
        # The velocity is smoothed in the world frame.
        cos, sin = float(seen.heading_cos), float(seen.heading_sin)
        vx, vy = float(seen.opponent_vx), float(seen.opponent_vy)
        new = np.array([cos * vx - sin * vy, sin * vx + cos * vy])
        old = new if self._opponent is None else self._opponent
        self._opponent = old + _SMOOTHING * (new - old)
        # Back in the robot's frame; a noisy heading is not of length 1.
        size = cos * cos + sin * sin
        vx = (cos * self._opponent[0] + sin * self._opponent[1]) / size
        vy = (cos * self._opponent[1] - sin * self._opponent[0]) / size
        moved = self.share * self.own.moved(horizon) + self.velocity_error * horizon
        x, y = seen_from(moved, float(seen.opponent_x) + vx * horizon, float(seen.opponent_y) + vy * horizon)
        cos, sin = np.cos(moved[2]), np.sin(moved[2])
        return replace(
            seen,
            opponent_x=np.asarray(x),
            opponent_y=np.asarray(y),
            opponent_vx=np.asarray(cos * vx + sin * vy),
            opponent_vy=np.asarray(cos * vy - sin * vx),
        )
