"""Importing ROS 1 bags and ROS 2 bags (MCAP or SQLite) into the log form, through `rosbags`; no ROS needed.

Nothing is resampled: a row for each stamp at which any chosen topic has a message, empty cells elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

from mecanum_env.errors import InputError, MecanumError, install_command
from mecanum_env.kinematics import Geometry
from mecanum_env.units import FloatArray
from sysid.logs.bag_messages import CONVERSIONS, Columns, Context, Unit
from sysid.logs.bag_topics import Choice, choose_topics
from sysid.logs.runs import KNOWN, TIME

Clock: TypeAlias = Literal["auto", "header", "receive"]
CLOCKS_AGREE_S = 1.0
"""Header stamps this near to the times of receipt are of the same clock."""

_Stamps: TypeAlias = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ImportedBag:
    """One bag in the log form."""

    columns: Mapping[str, FloatArray]
    """Log columns in the order of `columns.KNOWN`, `time_s` first and from 0, shape (n,); NaN: no sample."""
    choice: Choice
    clock: Literal["header", "receive"]


def import_bag(
    bag: Path,
    geometry: Geometry,
    *,
    topic_map: Sequence[str] = (),
    unit: Unit | None = None,
    clock: Clock = "auto",
    progress: bool = False,
) -> ImportedBag:
    """Read a bag into log columns.

    Args:
        bag: A .bag file, or a ROS 2 bag's folder (or the file inside it).
        geometry: Turns a Twist command into V, theta, VC.
        topic_map: Items such as ``command=/cmd_vel``, ``imu=none``, ``fl=left_front``; see `bag_topics`.
        unit: Of std_msgs numbers, which carry none.
        clock: Stamp samples by the message's header or by when it was received; ``auto`` takes the headers
            unless they are of another clock than the times of receipt. Messages without a header (Twist) are
            always stamped when received.
        progress: Show a progress bar.

    Raises:
        InputError: not a bag, `rosbags` not installed, topics missing or ambiguous, messages that lack what
            is needed, or no messages.
    """
    types, messages = _read_messages(bag, topic_map, progress)
    choice = choose_topics(str(bag), types, topic_map)
    used: Literal["header", "receive"] = "receive"
    if clock == "header" or (clock == "auto" and _clocks_agree(messages)):
        used = "header"
    parts = []
    for role, topic in choice.topics.items():
        received = messages[topic]
        if not received:
            raise InputError(
                f"{bag}: topic {topic} ({role}) has no messages; leave it out with --map {role}=none"
            )
        stamps = _stamps(received, used)
        context = Context(f"{bag}, {topic}", geometry, choice.joints, unit)
        columns = CONVERSIONS[role]([message for _, message in received], context)
        if role == "odometry" and "imu" in choice.topics:
            del columns["yaw_rate_rad_s"]  # the gyroscope measures it, odometry infers it
        parts.append((stamps, columns))
    return ImportedBag(_merge(parts), choice, used)


def _read_messages(
    bag: Path, topic_map: Sequence[str], progress: bool
) -> tuple[dict[str, str], dict[str, list[tuple[int, Any]]]]:
    """Return the type of every topic, and (time of receipt [ns], message) of the chosen ones."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(
            f"{bag}: importing bags needs rosbags; install it with {install_command('bag')}"
        ) from error
    if bag.is_file() and bag.suffix in (".mcap", ".db3"):
        bag = bag.parent
    if not bag.exists():
        raise InputError(f"{bag}: no such bag; give a .bag file or the folder of a ROS 2 bag")
    if bag.is_dir() and not (bag / "metadata.yaml").exists():
        raise InputError(f"{bag}: no metadata.yaml, so no ROS 2 bag; `ros2 bag reindex` writes one")
    try:
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
    stamp = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
    return stamp or None


def _clocks_agree(messages: Mapping[str, Sequence[tuple[int, Any]]]) -> bool:
    for received in messages.values():
        apart = [abs(stamp - at) for at, m in received if (stamp := _header_stamp(m)) is not None]
        if apart and np.median(apart) > CLOCKS_AGREE_S * 1e9:
            return False
    return True


def _stamps(received: Sequence[tuple[int, Any]], clock: Literal["header", "receive"]) -> _Stamps:
    return np.array(
        [(_header_stamp(message) if clock == "header" else None) or at for at, message in received], np.int64
    )


def _merge(parts: Sequence[tuple[_Stamps, Columns]]) -> dict[str, FloatArray]:
    """Put all columns on the union of their stamps."""
    everywhere = np.unique(np.concatenate([stamps for stamps, _ in parts]))
    merged: dict[str, FloatArray] = {TIME: (everywhere - everywhere[0]) * 1e-9}
    for stamps, columns in parts:
        rows = np.searchsorted(everywhere, stamps)
        for name, values in columns.items():
            column = np.full(everywhere.size, np.nan)
            column[rows] = values  # of two messages with one stamp, the later
            merged[name] = column
    return {name: merged[name] for name in KNOWN if name in merged}
