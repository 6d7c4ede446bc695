"""The interface of a Tankendo controller, and the step from a wanted twist to a command."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import scale_wheels, twist_to_wheels, wheels_to_command
from mecanum_env.model import Robot, Wheel
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM

Command = tuple[int, int, int]
"""V [rpm], theta [deg], VC [rpm], the whole numbers that the robot takes."""


class Controller(Protocol):
    """Turns an observation into a command every 0.1 s, on the simulator and on a real robot.

    The observation is that of `mecanum_env.tankendo.observation`, also where a real robot's sensors make it.
    """

    def reset(self) -> None:
        """Forget the episode."""
        ...

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        ...


def twist_command(
    vx_m_s: float, vy_m_s: float, yaw_rate_rad_s: float, robot: Robot, limit_rpm: float = Wheel.saturation_rpm
) -> Command:
    """Return the command for a body twist: velocity ahead, to the left, and counter-clockwise turn.

    A twist that needs a wheel speed beyond the limit, or more than the largest VC, is scaled, turn included.
    """
    wheels = twist_to_wheels([vx_m_s, vy_m_s, yaw_rate_rad_s], robot)
    v, theta, vc = (float(x) for x in wheels_to_command(scale_wheels(wheels, min(limit_rpm, FULL_V_RPM))))
    share = min(1.0, FULL_VC_RPM / max(abs(vc), 1e-9))
    return round(v * share), round(theta), round(vc * share)
