"""The role of each topic of a ROS bag: by message type or by an explicit map; ambiguity is an error."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS

_TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
_NUMBERS = ("std_msgs/msg/Float32", "std_msgs/msg/Float64")
_ARRAYS = ("std_msgs/msg/Float32MultiArray", "std_msgs/msg/Float64MultiArray")
_JOINTS = ("sensor_msgs/msg/JointState",)

ROLES: Final[Mapping[str, tuple[str, ...]]] = {
    "command": _TWISTS,
    "wheel_commands": _ARRAYS,
    "wheel_speeds": (*_JOINTS, *_ARRAYS),
    "odometry": ("nav_msgs/msg/Odometry",),
    "imu": ("sensor_msgs/msg/Imu",),
    "battery": ("sensor_msgs/msg/BatteryState",),
    "command_rpm": _NUMBERS,
    "speed_rpm": (*_NUMBERS, *_JOINTS),
}
"""Message types that each role accepts; the last two roles make a bench log."""

_AUTOMATIC: Final[Mapping[str, tuple[str, ...]]] = {
    "command": _TWISTS,
    "wheel_speeds": _JOINTS,
    "odometry": ROLES["odometry"],
    "imu": ROLES["imu"],
    "battery": ROLES["battery"],
}
"""Roles that the message type alone decides. Plain numbers do not state their meaning and need a map."""

_BENCH_ROLES: Final = ("command_rpm", "speed_rpm")
_NONE: Final = "none"


@dataclass(frozen=True)
class TopicChoice:
    """The chosen topics and joints."""

    topics: Mapping[str, str]
    """Topic by role."""
    joints: Mapping[str, str]
    """Joint name by wheel (`fl` ... `rr`, or `joint` on the bench), where the user gave one."""


def _parse_map(items: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return topics by role and joints by wheel from items such as ``command=/cmd_vel`` or ``fl=front_left``.

    Raises:
        InputError: an item without "=", or with an unknown name before it.
    """
    joints = (*WHEELS, "joint")
    topics, names = {}, {}
    for item in items:
        key, equals, value = item.partition("=")
        if not equals or not value:
            raise InputError(f"--map {item!r}: must be ROLE=TOPIC, such as command=/cmd_vel")
        if key in ROLES:
            topics[key] = value
        elif key in joints:
            names[key] = value
        else:
            known = (*ROLES, *joints)
            raise InputError(f"--map {item!r}: unknown{did_you_mean(key, known)}; known: {', '.join(known)}")
    return topics, names


def choose_topics(bag: str, types: Mapping[str, str], items: Sequence[str]) -> TopicChoice:
    """Return the topic chosen for each role, from the message `types` by topic and the `items` of a map.

    ``ROLE=none`` leaves a role out. Error messages name the `bag`.

    Raises:
        InputError: no topic or several for a role that is needed, or a mapped topic that is absent or of
            another type; the message lists the topics with their types.
    """
    listing = "; topics: " + (", ".join(f"{t} ({types[t]})" for t in sorted(types)) or "none")
    mapped, joints = _parse_map(items)
    chosen = {}
    for role, topic in mapped.items():
        if topic == _NONE:
            continue
        if topic not in types:
            raise InputError(f"{bag}: no topic {topic}{did_you_mean(topic, types)}{listing}")
        if types[topic] not in ROLES[role]:
            wanted = " or ".join(ROLES[role])
            raise InputError(f"{bag}: {topic} is {types[topic]}, but {role} must be {wanted}{listing}")
        chosen[role] = topic
    bench = any(role in chosen for role in _BENCH_ROLES)
    for role, wanted_types in _AUTOMATIC.items():
        no_body_command = role == "command" and "wheel_commands" in chosen
        if role in mapped or (bench and role != "battery") or no_body_command:
            continue
        found = sorted(topic for topic, kind in types.items() if kind in wanted_types)
        if len(found) > 1:
            raise InputError(
                f"{bag}: {len(found)} topics could be {role}; choose with --map {role}={found[0]} "
                f"(or {role}={_NONE}){listing}"
            )
        if found:
            chosen[role] = found[0]
    _require_complete(bag, chosen, bench, listing)
    return TopicChoice(chosen, joints)


def _require_complete(bag: str, chosen: Mapping[str, str], bench: bool, listing: str) -> None:
    if bench:
        missing = [role for role in _BENCH_ROLES if role not in chosen]
        if missing:
            raise InputError(
                f"{bag}: a bench log needs {missing[0]} too; give --map {missing[0]}=TOPIC{listing}"
            )
        return
    both = [role for role in ("command", "wheel_commands") if role in chosen]
    if len(both) > 1:
        raise InputError(f"{bag}: both command and wheel_commands are mapped; keep one{listing}")
    if not both:
        raise InputError(
            f"{bag}: no command found; give --map command=TOPIC (Twist), wheel_commands=TOPIC (four "
            f"numbers) or, for the bench, command_rpm=TOPIC and speed_rpm=TOPIC{listing}"
        )
    if not any(role in chosen for role in ("wheel_speeds", "odometry", "imu")):
        raise InputError(f"{bag}: nothing measured found (JointState, Odometry or Imu){listing}")


def match_joints(where: str, names: Sequence[str], stated: Mapping[str, str]) -> dict[str, int]:
    """Return the index of each wheel's joint by its name, such as front_left_wheel, wheel_fl or lf_joint.

    `names` are all joints of the topic, and `stated` those that the user gave by wheel.

    Raises:
        InputError: no joint or several match a wheel; the message says `where`, and lists the names.
    """
    found = {}
    for wheel in WHEELS:
        given = stated.get(wheel)
        hits = [i for i, name in enumerate(names) if (name == given if given else _wheel_of(name) == wheel)]
        if len(hits) != 1:
            count = f"{len(hits)} joints" if hits else "no joint"
            raise InputError(
                f"{where}: {count} for wheel {wheel}; give --map {wheel}=JOINT; joints: {', '.join(names)}"
            )
        found[wheel] = hits[0]
    return found


_ABBREVIATIONS: Final = {"lf": "fl", "rf": "fr", "lr": "rl", "bl": "rl", "lb": "rl", "br": "rr", "rb": "rr"}


def _wheel_of(name: str) -> str | None:
    text = name.lower()
    front, rear = "front" in text or "fore" in text, "rear" in text or "back" in text
    left, right = "left" in text, "right" in text
    if front != rear and left != right:
        return ("f" if front else "r") + ("l" if left else "r")
    for token in re.split(r"[^a-z]+", text):
        wheel = _ABBREVIATIONS.get(token, token)
        if wheel in WHEELS:
            return wheel
    return None
