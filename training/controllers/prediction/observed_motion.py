"""What the robot has done lately, from the commands it was sent: what the sensors show late.

What a late observation tells of the opponent now: the robot's own motion and the other's added.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.model import Model
from mecanum_env.tankendo import Observed, Sensors
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


@dataclass(frozen=True)
class Delays:
    """How late the robot sees and acts [s]."""

    seen_s: float = Sensors.delay_s
    """An observation shows what was this long ago."""
    acts_s: float = 0.0
    """A command acts this long after it was sent."""

    @staticmethod
    def of(model: Model) -> Delays:
        """Return the sensors' usual delay and the model's `command_latency`."""
        return Delays(acts_s=drive_parameters(model).delay_s)

    @property
    def total_s(self) -> float:
        """From what an observation shows to where the answer acts [s]."""
        return self.seen_s + self.acts_s


class SeenMotion:
    """Brings observations to the time at which the answer to them acts.

    The robot's part of the way there is known: the commands under way, through the identified law
    (`OwnMotion`), corrected by what the own velocity was seen to differ from that. The opponent is taken to
    go on with its velocity, which is smoothed, as noise would be fed forward.

    Args:
        model: wheel laws and robot.
        delays: how late the robot sees and acts.
        smoothing: share of the new in the opponent's velocity, at each observation.
        correction: share of the new in the own velocity's correction.
    """

    def __init__(
        self, model: Model, delays: Delays, smoothing: float = 0.75, correction: float = 0.2
    ) -> None:
        self.delays, self._smoothing, self._correction = delays, smoothing, correction
        self.own = OwnMotion(model)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self.own.reset()
        self._opponent: FloatArray | None = None
        self._off = np.zeros(3)

    @property
    def off(self) -> FloatArray:
        """Own twist as seen less as predicted, smoothed: ahead, left [m/s], turn [rad/s], shape (3,)."""
        return self._off

    def send(self, command: Command) -> None:
        """Take note of the command that answers the last observation."""
        self.own.send(command)

    def now(self, seen: Observed, further_s: float = 0.0) -> Observed:
        """Return the observation as it would be when the answer acts, and some time `further_s` [s] later.

        The opponent's place is brought there; its velocity is smoothed and, like the place, in the frame of
        the robot then; the sword is left as it was `seen`.
        """
        horizon = self.delays.total_s
        measured = np.array([float(seen.vx), float(seen.vy), float(seen.yaw_rate)])
        self._off = self._off + self._correction * (measured - self.own.twist(horizon) - self._off)
        cos, sin = float(seen.heading_cos), float(seen.heading_sin)
        vx, vy = float(seen.opponent_vx), float(seen.opponent_vy)
        new = np.array([cos * vx - sin * vy, sin * vx + cos * vy])
        old = new if self._opponent is None else self._opponent
        self._opponent = old + self._smoothing * (new - old)
        # Back into the robot's frame, as it was when this was seen.
        vx, vy = (
            cos * self._opponent[0] + sin * self._opponent[1],
            (cos * self._opponent[1] - sin * self._opponent[0]),
        )
        size = cos * cos + sin * sin
        vx, vy = vx / size, vy / size
        moved = self.own.moved(horizon) + self._off * horizon
        if further_s > 0.0:
            moved = _then(moved, (self.own.twist(0.0) + self._off) * further_s)
        total = horizon + further_s
        x, y = float(seen.opponent_x) + vx * total - moved[0], float(seen.opponent_y) + vy * total - moved[1]
        cos, sin = np.cos(moved[2]), np.sin(moved[2])
        return replace(
            seen,
            opponent_x=np.asarray(cos * x + sin * y),
            opponent_y=np.asarray(cos * y - sin * x),
            opponent_vx=np.asarray(cos * vx + sin * vy),
            opponent_vy=np.asarray(cos * vy - sin * vx),
        )


def _then(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the pose after two motions, the second seen from the end of the first, shapes (3,)."""
    cos, sin = np.cos(first[2]), np.sin(first[2])
    after: FloatArray = first + np.array(
        [cos * second[0] - sin * second[1], sin * second[0] + cos * second[1], second[2]]
    )
    return after
