"""Importing ROS 1 bags and ROS 2 bags (MCAP or SQLite) as logs, through `rosbags`; no ROS needed.

Nothing is resampled: there is a row for each stamp at which any chosen topic has a message, with empty cells
elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from tqdm import tqdm

from mecanum_env.errors import InputError, MecanumError, install_command
from mecanum_env.kinematics import (
    BODY_COMMAND,
    WHEEL_COMMAND,
    WHEEL_SPEEDS,
    WHEELS,
    Geometry,
    twist_to_command,
)
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.formats.bag_topics import TopicChoice, choose_topics, match_joints
from sysid.logs.formats.column_map import NEEDS_DIMENSIONS
from sysid.logs.formats.ros_mcap import read_lone_mcap
from sysid.logs.formats.stamps import Columns, Stamps, on_all_stamps

Unit: TypeAlias = Literal["rpm", "rad_s"]
Clock: TypeAlias = Literal["auto", "header", "receive"]
_CLOCKS_AGREE_S: Final = 1.0
"""Header stamps and times of receipt that differ by less than this [s] belong to the same clock."""

_Messages: TypeAlias = Sequence[tuple[int, Any]]
"""Time of receipt [ns] and message."""


@dataclass(frozen=True, eq=False)
class ImportedBag:
    """One bag as a log."""

    columns: Mapping[str, FloatArray]
    """Log columns in the order of `runs.KNOWN`, `time_s` first and from 0, shape (n,); NaN: no sample."""
    choice: TopicChoice
    clock: Literal["header", "receive"]


def import_bag(
    bag: Path,
    geometry: Geometry | None,
    *,
    topic_map: Sequence[str] = (),
    unit: Unit | None = None,
    clock: Clock = "auto",
    progress: bool = False,
) -> ImportedBag:
    """Read a bag into log columns.

    Args:
        bag: a .bag file, or the folder of a ROS 2 bag (or the file inside it).
        geometry: dimensions that turn a Twist command into V, theta, VC; needed only for one.
        topic_map: items such as ``command=/cmd_vel``, ``imu=none``, ``fl=left_front``; see `bag_topics`.
        unit: unit of std_msgs numbers, which state none.
        clock: stamp samples by the message's header or by the time of receipt; ``auto`` uses the headers
            unless their clock differs from that of the receipt, by which a Twist is always stamped.
        progress: show a progress bar.

    Raises:
        InputError: the bag cannot be read, `rosbags` is not installed, topics are missing or ambiguous, or
            messages are missing or lack what is needed.
    """
    types, messages = _read_messages(bag, topic_map, progress)
    choice = choose_topics(str(bag), types, topic_map)
    if "command" in choice.topics and geometry is None:
        raise InputError(f"{bag}, {choice.topics['command']}: {NEEDS_DIMENSIONS}")
    by_header = clock == "header" or (clock == "auto" and _clocks_agree(messages))
    used: Literal["header", "receive"] = "header" if by_header else "receive"
    parts = []
    for role, topic in choice.topics.items():
        received = messages[topic]
        if not received:
            raise InputError(
                f"{bag}: topic {topic} ({role}) has no messages; leave it out with --map {role}=none"
            )
        context = _Context(f"{bag}, {topic}", geometry, choice.joints, unit)
        columns = _CONVERSIONS[role]([message for _, message in received], context)
        if role == "odometry" and "imu" in choice.topics:
            del columns["yaw_rate_rad_s"]  # the gyroscope measures it; odometry only infers it
        parts.append((_stamps(received, used), columns))
    return ImportedBag(on_all_stamps(parts), choice, used)


def _read_messages(
    bag: Path, topic_map: Sequence[str], progress: bool
) -> tuple[dict[str, str], dict[str, list[tuple[int, Any]]]]:
    """Return the type of every topic, and the messages of the chosen topics."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(
            f"{bag}: importing bags needs rosbags; install it with {install_command('bag')}"
        ) from error
    alone = bag.is_file() and bag.suffix == ".mcap" and not (bag.parent / "metadata.yaml").exists()
    if bag.is_file() and bag.suffix in (".mcap", ".db3") and not alone:
        bag = bag.parent
    if not bag.exists():
        raise InputError(f"{bag}: no such bag; give a .bag file or the folder of a ROS 2 bag")
    if bag.is_dir() and not (bag / "metadata.yaml").exists():
        raise InputError(f"{bag}: no metadata.yaml, so no ROS 2 bag; `ros2 bag reindex` writes one")
    try:
        if alone:
            return read_lone_mcap(
                bag, lambda types: set(choose_topics(str(bag), types, topic_map).topics.values())
            )
        with AnyReader([bag], default_typestore=get_typestore(Stores.LATEST)) as reader:
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            wanted = set(choose_topics(str(bag), types, topic_map).topics.values())
            connections = [c for c in reader.connections if c.topic in wanted]
            messages: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in wanted}
            total = sum(reader.topics[topic].msgcount for topic in wanted)
            stream = reader.messages(connections=connections)
            for connection, stamp, data in tqdm(stream, total=total, desc=bag.name, disable=not progress):
                messages[connection.topic].append((stamp, reader.deserialize(data, connection.msgtype)))
    except MecanumError:
        raise
    except Exception as error:
        # A damaged bag can make the parsers raise anything; all of it means the same to the user.
        raise InputError(f"{bag}: cannot be read as a ROS bag ({type(error).__name__}: {error})") from error
    return types, messages


def _header_stamp(message: Any) -> int | None:
    header = getattr(message, "header", None)
    if header is None:
        return None
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec) or None


def _clocks_agree(messages: Mapping[str, _Messages]) -> bool:
    for received in messages.values():
        offsets = [abs(stamp - at) for at, m in received if (stamp := _header_stamp(m)) is not None]
        if offsets and np.median(offsets) > _CLOCKS_AGREE_S * 1e9:
            return False
    return True


def _stamps(received: _Messages, clock: Literal["header", "receive"]) -> Stamps:
    stamps = [(_header_stamp(message) if clock == "header" else None) or at for at, message in received]
    return np.array(stamps, np.int64)


@dataclass(frozen=True)
class _Context:
    """What a conversion may need besides the messages."""

    where: str
    """Bag and topic, for error messages."""
    geometry: Geometry | None
    joints: Mapping[str, str]
    """Joint name by wheel, where the user gave one."""
    unit: Unit | None
    """Unit of std_msgs numbers."""

    @property
    def rpm_per_number(self) -> float:
        """Factor from std_msgs numbers to rpm; an `InputError` if the user has not stated their unit."""
        if self.unit is None:
            raise InputError(f"{self.where}: std_msgs numbers carry no unit; give --unit rpm or --unit rad_s")
        return 1.0 if self.unit == "rpm" else 1.0 / RAD_S_PER_RPM


def _body_command(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert Twist or TwistStamped messages [m/s, rad/s] into V, theta, VC."""
    twists = [getattr(message, "twist", message) for message in messages]
    values = np.array([(t.linear.x, t.linear.y, t.angular.z) for t in twists], float)
    assert context.geometry is not None
    return dict(zip(BODY_COMMAND, twist_to_command(values, context.geometry), strict=True))


def _wheel_commands(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert messages of four numbers in the order fl, fr, rl, rr into wheel commands."""
    return dict(zip(WHEEL_COMMAND, _arrays(messages, context).T, strict=True))


def _wheel_speeds(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert messages of joint velocities [rad/s], or of four numbers, into wheel speeds."""
    if hasattr(messages[0], "data"):
        return dict(zip(WHEEL_SPEEDS, _arrays(messages, context).T, strict=True))
    # A topic may carry an arm's joints in separate messages, which say nothing about the wheels.
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


def _odometry(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert Odometry messages into the body twist (in the child frame, as ROS defines it) and the pose."""
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


def _imu(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert Imu messages into the yaw rate; the sensor's z axis must point up."""
    return {"yaw_rate_rad_s": np.array([m.angular_velocity.z for m in messages], float)}


def _battery(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert BatteryState messages into the supply voltage."""
    return {"battery_v": np.array([m.voltage for m in messages], float)}


def _bench_command(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert messages of one number into the commanded wheel speed."""
    return {"command_rpm": np.array([m.data for m in messages], float) * context.rpm_per_number}


def _bench_speed(messages: Sequence[Any], context: _Context) -> Columns:
    """Convert messages of one number, or of a joint's velocity [rad/s], into the measured wheel speed."""
    if hasattr(messages[0], "data"):
        return {"speed_rpm": np.array([m.data for m in messages], float) * context.rpm_per_number}
    names = list(messages[0].name)
    wanted = context.joints.get("joint", names[0] if len(names) == 1 else "")
    if wanted not in names:
        raise InputError(f"{context.where}: which joint? give --map joint=NAME; joints: {', '.join(names)}")
    speeds = [_velocity(m, list(m.name).index(wanted), context) for m in messages]
    return {"speed_rpm": np.array(speeds) / RAD_S_PER_RPM}


_CONVERSIONS: Final[Mapping[str, Callable[[Sequence[Any], _Context], Columns]]] = {
    "command": _body_command,
    "wheel_commands": _wheel_commands,
    "wheel_speeds": _wheel_speeds,
    "odometry": _odometry,
    "imu": _imu,
    "battery": _battery,
    "command_rpm": _bench_command,
    "speed_rpm": _bench_speed,
}
"""From ROS messages to log columns, by role of `bag_topics.ROLES`."""


def _arrays(messages: Sequence[Any], context: _Context) -> FloatArray:
    for message in messages:
        if len(message.data) != 4:
            raise InputError(
                f"{context.where}: {len(message.data)} numbers in a message, must be 4: fl, fr, rl, rr"
            )
    return np.array([m.data for m in messages], float) * context.rpm_per_number


def _velocity(message: Any, index: int, context: _Context) -> float:
    if len(message.velocity) != len(message.name):
        raise InputError(
            f"{context.where}: {len(message.name)} joints and {len(message.velocity)} velocities; "
            "the driver must publish velocities"
        )
    return float(message.velocity[index])


def _yaw(q: Any) -> float:
    """Return the rotation about z [rad] of a quaternion."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
