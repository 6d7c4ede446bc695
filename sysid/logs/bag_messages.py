"""From ROS messages to log columns, one function a role."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS, Geometry, twist_to_command
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.bag_topics import match_joints
from sysid.logs.runs import BODY_COMMAND, WHEEL_COMMAND, WHEEL_SPEEDS

Unit: TypeAlias = Literal["rpm", "rad_s"]
Columns: TypeAlias = dict[str, FloatArray]


@dataclass(frozen=True)
class Context:
    """What a conversion may need besides the messages."""

    where: str
    """Bag and topic, for messages."""
    geometry: Geometry
    joints: Mapping[str, str]
    unit: Unit | None
    """Of std_msgs numbers."""

    @property
    def rpm_per_number(self) -> float:
        """Factor from std_msgs numbers to rpm.

        Raises:
            InputError: the user has not said which unit they have.
        """
        if self.unit is None:
            raise InputError(f"{self.where}: std_msgs numbers carry no unit; give --unit rpm or --unit rad_s")
        return 1.0 if self.unit == "rpm" else 1.0 / RAD_S_PER_RPM


def body_command(messages: Sequence[Any], context: Context) -> Columns:
    """Turn Twist or TwistStamped messages [m/s, rad/s] into V, theta, VC by the robot's geometry."""
    twists = [getattr(message, "twist", message) for message in messages]
    values = np.array([(t.linear.x, t.linear.y, t.angular.z) for t in twists], float)
    command = twist_to_command(values, context.geometry)
    return dict(zip(BODY_COMMAND, command, strict=True))


def wheel_commands(messages: Sequence[Any], context: Context) -> Columns:
    """Turn messages of four numbers in the order fl, fr, rl, rr into wheel commands."""
    return dict(zip(WHEEL_COMMAND, _arrays(messages, context).T, strict=True))


def wheel_speeds(messages: Sequence[Any], context: Context) -> Columns:
    """Turn messages of joint velocities [rad/s], or of four numbers, into wheel speeds."""
    if hasattr(messages[0], "data"):
        return dict(zip(WHEEL_SPEEDS, _arrays(messages, context).T, strict=True))
    # A topic may carry the arm's joints in messages of their own: they say nothing of the wheels.
    indices: dict[tuple[str, ...], dict[str, int] | None] = {}
    refused: InputError | None = None
    for names in dict.fromkeys(tuple(message.name) for message in messages):
        try:
            indices[names] = match_joints(context.where, names, context.joints)
        except InputError as error:
            indices[names], refused = None, error
    if refused is not None and not any(indices.values()):
        raise refused
    speeds = np.full((len(messages), 4), np.nan)
    for row, message in enumerate(messages):
        index = indices[tuple(message.name)]
        if index is not None:
            speeds[row] = [_velocity(message, index[wheel], context) for wheel in WHEELS]
    return dict(zip(WHEEL_SPEEDS, speeds.T / RAD_S_PER_RPM, strict=True))


def odometry(messages: Sequence[Any], context: Context) -> Columns:
    """Turn Odometry messages into the body twist (in its child frame, as ROS has it) and the pose."""
    twists = [message.twist.twist for message in messages]
    poses = [message.pose.pose for message in messages]
    return {
        "vx_m_s": np.array([t.linear.x for t in twists], float),
        "vy_m_s": np.array([t.linear.y for t in twists], float),
        "yaw_rate_rad_s": np.array([t.angular.z for t in twists], float),
        "x_m": np.array([p.position.x for p in poses], float),
        "y_m": np.array([p.position.y for p in poses], float),
        "yaw_rad": np.unwrap([_yaw(p.orientation) for p in poses]),
    }


def imu(messages: Sequence[Any], context: Context) -> Columns:
    """Turn Imu messages into the yaw rate; the sensor's z axis must point up."""
    return {"yaw_rate_rad_s": np.array([m.angular_velocity.z for m in messages], float)}


def battery(messages: Sequence[Any], context: Context) -> Columns:
    """Turn BatteryState messages into the supply voltage."""
    return {"battery_v": np.array([m.voltage for m in messages], float)}


def bench_command(messages: Sequence[Any], context: Context) -> Columns:
    """Turn messages of one number into the commanded wheel speed."""
    return {"command_rpm": np.array([m.data for m in messages], float) * context.rpm_per_number}


def bench_speed(messages: Sequence[Any], context: Context) -> Columns:
    """Turn messages of one number, or of a joint's velocity [rad/s], into the measured wheel speed."""
    if hasattr(messages[0], "data"):
        return {"speed_rpm": np.array([m.data for m in messages], float) * context.rpm_per_number}
    names = list(messages[0].name)
    wanted = context.joints.get("joint", names[0] if len(names) == 1 else "")
    if wanted not in names:
        raise InputError(f"{context.where}: which joint? give --map joint=NAME; joints: {', '.join(names)}")
    speeds = [_velocity(m, list(m.name).index(wanted), context) for m in messages]
    return {"speed_rpm": np.array(speeds) / RAD_S_PER_RPM}


CONVERSIONS: Final[Mapping[str, Callable[[Sequence[Any], Context], Columns]]] = {
    "command": body_command,
    "wheel_commands": wheel_commands,
    "wheel_speeds": wheel_speeds,
    "odometry": odometry,
    "imu": imu,
    "battery": battery,
    "command_rpm": bench_command,
    "speed_rpm": bench_speed,
}
"""By role of `bag_topics.ROLES`."""


def _arrays(messages: Sequence[Any], context: Context) -> FloatArray:
    for message in messages:
        if len(message.data) != 4:
            raise InputError(
                f"{context.where}: {len(message.data)} numbers in a message, must be 4: fl, fr, rl, rr"
            )
    return np.array([m.data for m in messages], float) * context.rpm_per_number


def _velocity(message: Any, index: int, context: Context) -> float:
    if len(message.velocity) != len(message.name):
        raise InputError(
            f"{context.where}: {len(message.name)} joints and {len(message.velocity)} velocities; "
            "the driver must publish velocities"
        )
    return float(message.velocity[index])


def _yaw(q: Any) -> float:
    """Return the rotation about z [rad] of a quaternion."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
