"""What the robot has done lately, from the commands it was sent: what the sensors show late."""

from __future__ import annotations

from collections import deque

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from training.controllers.interface import Command
from training.controllers.prediction.motion_model import MotionModel, MotionState

_KEPT_S = 1.5  # longer than any sensor's and command's delay together


class OwnMotion:
    """The robot's motion since the start, one command after the other, as the model predicts it.

    Its clock is that of the commands: a robot whose commands act some time after they are sent does the same
    that much later.

    Args:
        model: wheel laws, robot and effects.
    """

    def __init__(self, model: Model) -> None:
        self.model = MotionModel(model)
        self._kept = round(_KEPT_S / self.model.tick_s)
        self.reset()

    def reset(self) -> None:
        """Stand, having stood for long."""
        self.state: MotionState = self.model.rest()
        self._commands = 0
        self._twists: deque[FloatArray] = deque([np.zeros(3)] * (self._kept + 1), maxlen=self._kept + 1)

    @property
    def commands(self) -> int:
        """Commands sent so far."""
        return self._commands

    @property
    def time_s(self) -> float:
        """Time since the start [s]."""
        return self._commands * self.model.period_s

    def send(self, command: Command) -> None:
        """Take note of a command that is sent now, and go on to the end of its period."""
        ticks = self.model.ticks(self._commands)
        wheels = self.model.received(self.model.wheels(command)[:, None], self.time_s)
        twists, self.state = self.model.play(self.state, wheels, ticks)
        self._twists.extend(twists[:, :, 0])
        self._commands += 1

    def twist(self, ago_s: float) -> FloatArray:
        """Return the twist `ago_s` [s] before now: ahead, left [m/s], turn [rad/s], shape (3,)."""
        past = self._past(ago_s)
        return np.asarray(past[0], float)

    def recent(self, ticks: int) -> FloatArray:
        """Return the twists of the last law ticks until now, oldest first, shape (ticks + 1, 3)."""
        return np.array(list(self._twists)[-1 - ticks :])

    def moved(self, ago_s: float, until_s: float = 0.0) -> FloatArray:
        """Return the pose `until_s` [s] before now, seen from that `ago_s` [s] before now.

        Ahead, left [m], turn [rad], shape (3,); `until_s` is not above `ago_s`.
        """
        moved = self._until_now(ago_s)
        if until_s <= 0.0:
            return moved
        # What came after is taken off: first = all * rest^-1.
        rest = self._until_now(until_s)
        turn = moved[2] - rest[2]
        cos, sin = np.cos(turn), np.sin(turn)
        before: FloatArray = moved - np.array(
            [cos * rest[0] - sin * rest[1], sin * rest[0] + cos * rest[1], rest[2]]
        )
        return before

    def _until_now(self, ago_s: float) -> FloatArray:
        past = self._past(ago_s)
        if len(past) < 2:
            return np.zeros(3)
        steps = np.full(len(past) - 1, self.model.tick_s)
        steps[0] = ago_s - self.model.tick_s * (len(past) - 2)
        return integrated(past[:, :, None], steps)[:, 0]

    def _past(self, ago_s: float) -> FloatArray:
        """Return the twists from `ago_s` before now until now, (m, 3); the first lies between two ticks."""
        ticks = min(max(ago_s / self.model.tick_s, 0.0), float(self._kept))
        whole = int(np.ceil(ticks - 1e-9))
        twists = self.recent(whole)
        if whole > 0:
            share = whole - ticks
            twists[0] = twists[0] + share * (twists[1] - twists[0])
        return twists


def seen_from(pose: FloatArray, x_m: float, y_m: float) -> tuple[float, float]:
    """Return a place [m] as seen from a pose: x, y [m], yaw [rad], shape (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = x_m - pose[0], y_m - pose[1]
    return float(cos * dx + sin * dy), float(cos * dy - sin * dx)


def integrated(twists: FloatArray, steps_s: FloatArray) -> FloatArray:
    """Return the last pose of paths that begin at 0 with heading 0, shape (3, n).

    Args:
        twists: at the ends of the steps, the start included, shape (m + 1, 3, n).
        steps_s: between them, shape (m,).
    """
    last: FloatArray = integrated_path(twists, steps_s)[-1]
    return last


def integrated_path(twists: FloatArray, steps_s: FloatArray) -> FloatArray:
    """Return the poses x, y [m], yaw [rad] of paths that begin at 0 with heading 0, shape (m + 1, 3, n).

    The trapezoidal rule, with the heading of the middle of each step.

    Args:
        twists: at the ends of the steps, the start included, shape (m + 1, 3, n).
        steps_s: between them, shape (m,).
    """
    mean = 0.5 * (twists[1:] + twists[:-1]) * steps_s[:, None, None]
    poses = np.zeros_like(twists)
    np.cumsum(mean[:, 2], axis=0, out=poses[1:, 2])
    heading = 0.5 * (poses[1:, 2] + poses[:-1, 2])
    cos, sin = np.cos(heading), np.sin(heading)
    np.cumsum(cos * mean[:, 0] - sin * mean[:, 1], axis=0, out=poses[1:, 0])
    np.cumsum(sin * mean[:, 0] + cos * mean[:, 1], axis=0, out=poses[1:, 1])
    return poses
