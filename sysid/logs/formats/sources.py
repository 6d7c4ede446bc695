"""What may be imported as logs: bags, MCAP, LeRobot datasets, and tables with other columns."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from mecanum_env.errors import InputError
from mecanum_env.kinematics import Geometry
from mecanum_env.model import Robot, read_robot
from mecanum_env.tables import has_table_suffix
from sysid.logs.formats.bags import Clock, Unit, import_bag
from sysid.logs.formats.column_map import DIMENSIONS
from sysid.logs.formats.foreign import Imported, imported
from sysid.logs.formats.json_mcap import message_encodings, read_mcap
from sysid.logs.formats.lerobot import is_lerobot, read_lerobot
from sysid.logs.formats.tables import read_foreign_table


def import_source(
    source: Path,
    geometry: Geometry | None,
    items: Sequence[str] = (),
    *,
    unit: Unit | None = None,
    clock: Clock = "auto",
    progress: bool = False,
) -> list[Imported]:
    """Return every run of a source as a log.

    Args:
        source: a table, a folder of tables, an MCAP file, a LeRobot dataset, or a bag.
        geometry: dimensions of the robot, which a Twist command needs.
        items: of ``--map``: see `column_map`, and `bag_topics` for a bag.
        unit: unit of the plain numbers of a bag.
        clock: what stamps the samples of a bag.
        progress: show a progress bar where it takes long.

    Raises:
        InputError: it cannot be read, or what it holds is ambiguous.
    """
    if source.is_dir() and is_lerobot(source):
        return [imported(run, items, geometry) for run in read_lerobot(source)]
    tables = _tables(source)
    if tables:
        return [imported(read_foreign_table(table), items, geometry) for table in tables]
    if _is_json_mcap(source):
        return [imported(read_mcap(source), items, geometry)]
    bag = import_bag(source, geometry, topic_map=items, unit=unit, clock=clock, progress=progress)
    topics = ", ".join(f"{role} = {topic}" for role, topic in bag.choice.topics.items())
    name = source.stem if source.is_file() else source.resolve().name
    return [Imported(name, dict(bag.columns), f"{topics}; stamped by {bag.clock}")]


def read_dimensions(path: Path) -> Robot:
    """Return the robot of a JSON file that states all dimensions which a Twist command needs.

    Raises:
        InputError: the file cannot be read, or a dimension is missing; none is assumed.
    """
    robot = read_robot(path)
    given = json.loads(path.read_text(encoding="utf-8"))
    missing = [name for name in DIMENSIONS if name not in given]
    if missing and "wheels" not in given:
        raise InputError(f"{path}: {', '.join(missing)} is missing; measure it, since none is assumed")
    return robot


def _tables(source: Path) -> list[Path]:
    if source.is_file():
        return [source] if has_table_suffix(source) else []
    if not source.is_dir() or (source / "metadata.yaml").exists():
        return []
    return sorted(path for path in source.iterdir() if path.is_file() and has_table_suffix(path))


def _is_json_mcap(source: Path) -> bool:
    """Return whether a file is an MCAP that is no part of a bag and has JSON messages."""
    if not source.is_file() or source.suffix != ".mcap" or (source.parent / "metadata.yaml").exists():
        return False
    return "json" in message_encodings(source)
