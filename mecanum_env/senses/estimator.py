"""The estimator: from the readings of the sensors to places and velocities of opponent, tip and robot.

Three Kalman filters (`filters.MotionFilter`) work in the field's frame: the robot itself, from odometry and
localisation; the opponent's body and the tip of its sword, from the camera. A frame is turned into the field
with the robot's pose at the time of the frame, and back into the body's frame with the pose at the time of
the estimate, so that errors of the own place cancel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.senses.filters import MotionFilter
from mecanum_env.senses.readings import CameraFrame, OwnReading, Senses
from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
_OWN: Final = (2.0, 8.0)
_BODY: Final = (1.0, 6.0)
_TIP: Final = (2.0, 25.0)
"""Acceleration of the quiet and the agile model, in m/s^2 per root hertz (of the own heading in radians): an
opponent walks with up to 3 m/s^2 and steps with 30, a tip is drawn back with 25 and thrust with 150."""
_OPPONENT_M: Final = (2.5, 0.0)
_TIP_M: Final = (1.65, 0.0, 0.6)
"""Where opponent and tip are assumed before the first frame that shows them: ahead, left, height [m]."""
_FAR_M, _MOVING_M_S = 1.0, 0.3
"""Standard deviations of place and velocity before the first reading [m], [m/s]."""
_NEVER_S: Final = -1.0
"""The clock of a filter before its first reading [s]."""


@dataclass(frozen=True)
class Estimate:
    """What n robots know at one time; vectors are along the robot's axes unless said otherwise."""

    opponent_m: FloatArray
    """The opponent's centre ahead and to the left, shape (2, n) [m]."""
    opponent_m_s: FloatArray
    """Its velocity over the floor, shape (2, n) [m/s]."""
    tip_m: FloatArray
    """The tip ahead, to the left and its height, shape (3, n) [m]."""
    tip_m_s: FloatArray
    """Its velocity over the floor and upwards, shape (3, n) [m/s]."""
    own_velocity: FloatArray
    """The robot's velocity ahead and to the left [m/s] and its yaw rate [rad/s], shape (3, n)."""
    own_pose: FloatArray
    """Its place x, y [m] in the field and its heading [rad], shape (3, n)."""


class Estimator:
    """Estimates for n robots; a robot of its own has n = 1.

    `senses` are those that it expects, `age_s` the age of what it returns [s]: 0 for the present, or the age
    that a controller expects of its observations.
    """

    def __init__(self, n: int = 1, senses: Senses | None = None, age_s: float = 0.0) -> None:
        self._senses = Senses() if senses is None else senses
        self._age_s = age_s
        self._own = MotionFilter(3, n, *_OWN)
        self._body = MotionFilter(2, n, *_BODY)
        self._tip = MotionFilter(3, n, *_TIP)
        for row in range(n):
            self.restart(row)

    def restart(self, row: int = 0) -> None:
        """Forget what is known in a row; its clock starts at 0."""
        self._own.restart(row, np.zeros(3), 10.0, _MOVING_M_S)
        self._body.restart(row, np.array(_OPPONENT_M), _FAR_M, _MOVING_M_S)
        self._tip.restart(row, np.array(_TIP_M), _FAR_M, _MOVING_M_S)
        self._own.time_s[row] = self._body.time_s[row] = self._tip.time_s[row] = _NEVER_S

    def update(
        self,
        now_s: FloatArray,
        own: OwnReading,
        frames: Sequence[CameraFrame],
        rows: BoolArray | None = None,
    ) -> Estimate:
        """Take in what has arrived since the last call; return the estimate for `now_s` (n,) minus its age.

        Args:
            now_s: the present, shape (n,) [s]; 0 at the start of an episode.
            own: the robots' reading of themselves.
            frames: the camera's frames, oldest first.
            rows: robots for which readings have arrived, (n,) of bool; all if None.
        """
        rows = np.ones(len(now_s), bool) if rows is None else rows
        self._take_own(own, rows)
        for frame in frames:
            self._take_frame(frame, rows)
        return self._estimate(now_s - self._age_s)

    def _take_own(self, own: OwnReading, rows: BoolArray) -> None:
        expected, _ = self._own.at(own.time_s)
        # The heading is continued past half a turn.
        error = (own.pose[2] - expected[2] + np.pi) % (2.0 * np.pi) - np.pi
        known = self._own.time_s > _NEVER_S
        heading = np.where(known, expected[2] + error, own.pose[2])
        pose = np.stack([own.pose[0], own.pose[1], heading])
        velocity = np.stack([*_turned(own.velocity[:2], heading), own.velocity[2]])
        s = self._senses
        self._own.update(own.time_s, pose, s.place_m, rows, velocity, s.own_velocity_m_s)

    def _take_frame(self, frame: CameraFrame, rows: BoolArray) -> None:
        pose, _ = self._own.at(frame.time_s)
        noise = self._senses.position_m
        body = pose[:2] + _turned(frame.opponent_m, pose[2])
        self._body.update(frame.time_s, body, noise, rows)
        tip = np.stack([*(pose[:2] + _turned(frame.tip_m[:2], pose[2])), frame.tip_m[2]])
        self._tip.update(frame.time_s, tip, noise, rows)

    def _estimate(self, time_s: FloatArray) -> Estimate:
        pose, velocity = self._own.at(time_s)
        body, body_velocity = self._body.at(time_s)
        tip, tip_velocity = self._tip.at(time_s)
        back = -pose[2]
        return Estimate(
            opponent_m=_turned(body - pose[:2], back),
            opponent_m_s=_turned(body_velocity, back),
            tip_m=np.stack([*_turned(tip[:2] - pose[:2], back), tip[2]]),
            tip_m_s=np.stack([*_turned(tip_velocity[:2], back), tip_velocity[2]]),
            own_velocity=np.stack([*_turned(velocity[:2], back), velocity[2]]),
            own_pose=pose,
        )


def _turned(vector: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return vectors x, y, shape (2, n), turned counter-clockwise."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.stack([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])
