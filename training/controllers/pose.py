"""Following a pose: feed-forward of the wanted twist, proportional correction of the pose error."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mecanum_env.kinematics import scale_wheels, twist_to_wheels, wheels_to_command
from mecanum_env.model import Robot, Wheel
from mecanum_env.units import FloatArray


@dataclass(frozen=True)
class PoseController:
    """Twist asked for = wanted twist + gain * pose error, in the body frame.

    The gain must stay well below 1 / (command period + rise time), 4 1/s for the paper's robot: beyond, the
    correction arrives too late and the robot oscillates.
    """

    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    gain_per_s: float = 2.0
    """Correction of position and heading errors [1/s]."""
    limit_rpm: float = Wheel.saturation_rpm
    """No wheel is asked for more [rpm]; the direction of motion is kept."""

    def command(
        self, pose: FloatArray, wanted_pose: FloatArray, wanted_twist: FloatArray
    ) -> tuple[int, int, int]:
        """Return V [rpm], theta [deg], VC [rpm] as the whole numbers that the robot takes.

        Args:
            pose: measured x [m], y [m], yaw [rad] in the world, shape (3,).
            wanted_pose: where the robot should be now, shape (3,).
            wanted_twist: how the wanted pose moves, in the world frame: vx, vy [m/s], yaw rate [rad/s], (3,).
        """
        error = np.asarray(wanted_pose, float) - pose
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        world = np.asarray(wanted_twist, float) + self.gain_per_s * error
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        body = np.array([cos * world[0] + sin * world[1], cos * world[1] - sin * world[0], world[2]])
        wheels = scale_wheels(twist_to_wheels(body, self.robot), self.limit_rpm)
        v, theta, vc = wheels_to_command(wheels)
        return round(float(v)), round(float(theta)), round(float(vc))
