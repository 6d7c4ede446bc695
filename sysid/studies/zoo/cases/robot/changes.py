"""Every name and form of the contract that a robot can have, as changes."""

from __future__ import annotations

from typing import Final

from sysid.studies.zoo.cases.bench.changes import CHANGES
from sysid.studies.zoo.cases.robot.body_changes import BODY_CHANGES
from sysid.studies.zoo.cases.robot.change import RobotChange, of_drives
from sysid.studies.zoo.cases.robot.sensor_changes import SENSOR_CHANGES
from sysid.studies.zoo.robots.robot import Robot

_NOT_OF_DRIVES: Final = ("load_inertia", "sensor_latency", "sensor_lowpass", "sensor_scale")
"""Names for which a robot has changes of its own, or none: its wheels always carry it."""

ROBOT_CHANGES: Final[tuple[RobotChange, ...]] = (
    *BODY_CHANGES,
    *SENSOR_CHANGES,
    *(of_drives(change) for change in CHANGES if change.name not in _NOT_OF_DRIVES),
)

UNSEEN_WHEN_GENTLE: Final = (
    "track_width",
    "roller_friction/torque",
    "roller_friction/damping",
    "sensor_scale/yaw",
    "direction_asymmetry",
    "com_offset",
    "low_grip",
    "body_speed_limit",
    "command_deadband/drop",
)
"""Labels of changes that slow forward driving below half of the top speed may not show."""

_TWINS: Final = {
    "command_latency/fixed": ("sensor_latency",),
    "sensor_latency/all": ("command_latency",),
}
_TWINS_WITHOUT_POSE: Final = {
    "speed_gain": ("sensor_scale",),
    "wheel_radius": ("sensor_scale",),
    "track_width": ("sensor_scale",),
    "sensor_scale/yaw": ("track_width",),
}


MAY_HAVE_TWINS: Final = tuple(_TWINS | _TWINS_WITHOUT_POSE)
"""Labels of the changes that `twins` has names for, at least without a measured path."""


def twins(change: RobotChange, robot: Robot) -> tuple[str, ...]:
    """Return the names that no log of a robot can tell from a change.

    A path that is measured apart from the velocity shows what is only the velocity's scale.
    """
    known = _TWINS if robot.sensors.pose else _TWINS | _TWINS_WITHOUT_POSE
    return known.get(change.label, ())
