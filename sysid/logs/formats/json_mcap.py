"""MCAP files with JSON messages, as Foxglove and PlotJuggler read them: written, and read back."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, install_command
from mecanum_env.files import atomic_path
from mecanum_env.kinematics import POSE
from mecanum_env.version import __version__
from sysid.logs.formats.foreign import ForeignRun, Part
from sysid.logs.runs import TIME, UNITS, Run

_JSON: Final = "json"
_EXTRA: Final = "mcap"
COMMAND_TOPIC: Final = "/command"
MEASURED_TOPIC: Final = "/measured"
POSE_TOPIC: Final = "/pose"
"""The pose as `foxglove.PoseInFrame`, which its 3D panel draws; it is also among what is measured."""
_POSE_SCHEMA: Final = "foxglove.PoseInFrame"


def message_encodings(path: Path) -> frozenset[str]:
    """Return how the messages of an MCAP file are encoded, such as json, cdr or protobuf.

    Raises:
        InputError: the file cannot be read, or `mcap` is not installed.
    """
    return frozenset(channel.message_encoding for _, channel, _ in _messages(path))


def read_mcap(path: Path) -> ForeignRun:
    """Read every number of every JSON message: columns are ``/topic.field.field``, stamped by receipt.

    Raises:
        InputError: the file cannot be read, holds no JSON messages, or `mcap` is not installed.
    """
    stamps: dict[str, list[int]] = {}
    rows: dict[str, list[dict[str, float]]] = {}
    for schema, channel, message in _messages(path):
        # The same numbers are among the measured ones.
        if channel.message_encoding == _JSON and not (schema and schema.name == _POSE_SCHEMA):
            stamps.setdefault(channel.topic, []).append(message.log_time)
            rows.setdefault(channel.topic, []).append(dict(_leaves(channel.topic, json.loads(message.data))))
    if not stamps:
        raise InputError(f"{path}: no JSON messages; a ROS 2 bag is imported by its folder")
    parts = []
    for topic, found in rows.items():
        names = dict.fromkeys(name for row in found for name in row)
        columns = {name: np.array([row.get(name, np.nan) for row in found], float) for name in names}
        parts.append(Part(columns, np.array(stamps[topic], np.int64)))
    return ForeignRun(path.stem, str(path), parts)


def write_mcap(run: Run, path: Path) -> None:
    """Write a run as an MCAP file: one message of command and one of measured numbers per row, and the pose.

    Stamps are those of the log, in nanoseconds.

    Raises:
        InputError: `mcap` is not installed, or the folder cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise InputError(f"{path}: MCAP needs mcap: {install_command(_EXTRA)}") from error
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start(profile="", library=f"mecanum-tankendo {__version__}")
    groups = {COMMAND_TOPIC: run.command.columns(), MEASURED_TOPIC: dict(run.channels)}
    channels = {
        topic: _channel(writer, topic, f"mecanum.{topic[1:].title()}", _schema(tuple(columns)))
        for topic, columns in groups.items()
    }
    posed = all(name in run.channels for name in POSE)
    pose = _channel(writer, POSE_TOPIC, _POSE_SCHEMA, _POSE_JSON) if posed else None
    times = np.asarray(np.rint((run.time_s + run.start_s) * 1e9), np.int64)
    for row, at in enumerate(times.tolist()):
        for topic, columns in groups.items():
            cells = {name: float(values[row]) for name, values in columns.items()}
            finite = {name: value for name, value in cells.items() if math.isfinite(value)}
            if finite:
                writer.add_message(channels[topic], at, json.dumps(finite).encode(), at)
        if pose is not None and all(math.isfinite(run.channels[name][row]) for name in POSE):
            writer.add_message(pose, at, json.dumps(_pose(run, row, at)).encode(), at)
    writer.finish()
    with atomic_path(path) as temporary:
        temporary.write_bytes(stream.getvalue())


def _messages(path: Path) -> Iterator[tuple[Any, Any, Any]]:
    """Yield schema, channel and message in the order of receipt."""
    try:
        from mcap.reader import make_reader
    except ImportError as error:
        raise InputError(f"{path}: MCAP needs mcap: {install_command(_EXTRA)}") from error
    try:
        with path.open("rb") as stream:
            yield from make_reader(stream).iter_messages()
    except Exception as error:
        # A damaged file can make the parser raise anything; all of it means the same to the user.
        raise InputError(f"{path}: cannot be read as MCAP ({type(error).__name__}: {error})") from error


def _leaves(name: str, value: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _leaves(f"{name}.{key}", entry)
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from _leaves(f"{name}.{index}", entry)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)


def _channel(writer: Any, topic: str, name: str, schema: Mapping[str, Any]) -> int:
    schema_id = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return int(writer.register_channel(schema_id=schema_id, topic=topic, message_encoding=_JSON))


def _schema(names: tuple[str, ...]) -> dict[str, Any]:
    def described(name: str) -> dict[str, str]:
        return {"type": "number", "description": UNITS.get(name, name.rsplit("_", 1)[-1])}

    return {"type": "object", "properties": {name: described(name) for name in names if name != TIME}}


def _pose(run: Run, row: int, at: int) -> dict[str, Any]:
    x, y, yaw = (float(run.channels[name][row]) for name in POSE)
    return {
        "timestamp": {"sec": at // 10**9, "nsec": at % 10**9},
        "frame_id": "world",
        "pose": {
            "position": {"x": x, "y": y, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
        },
    }


def _numbers(*names: str) -> dict[str, Any]:
    return {"type": "object", "properties": {name: {"type": "number"} for name in names}}


_POSE_JSON: Final = {
    "title": _POSE_SCHEMA,
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "frame_id": {"type": "string"},
        "pose": {
            "type": "object",
            "properties": {"position": _numbers("x", "y", "z"), "orientation": _numbers("x", "y", "z", "w")},
        },
    },
}
