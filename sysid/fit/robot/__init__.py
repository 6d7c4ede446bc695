"""What of a robot no ruler can measure: servo stiffness, yaw inertia and grip, and its effects."""

from sysid.fit.robot.effects import find_robot_effects
from sysid.fit.robot.parameters import RobotFit, grip_beside, on_rollers, robot_of, wheels_at_rest

__all__ = [
    "RobotFit",
    "find_robot_effects",
    "grip_beside",
    "on_rollers",
    "robot_of",
    "wheels_at_rest",
]
