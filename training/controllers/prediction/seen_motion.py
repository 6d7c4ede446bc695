"""What a late observation tells of the opponent now: the robot's own motion and the other's added."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.model import Model
from mecanum_env.tankendo import Observed, Sensors
from mecanum_env.units import FloatArray
from training.controllers.interface import Command
from training.controllers.prediction.own_motion import OwnMotion


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
