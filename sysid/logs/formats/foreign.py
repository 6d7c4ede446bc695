"""Runs of other programs, before their columns are ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mecanum_env.errors import InputError
from mecanum_env.kinematics import Geometry
from sysid.logs.formats.column_map import Numbers, chosen, our_columns, parse_map, stamps_of
from sysid.logs.formats.stamps import Columns, Stamps, on_all_stamps
from sysid.logs.runs import KNOWN, TIME


@dataclass(frozen=True, eq=False)
class Part:
    """Columns that were sampled together."""

    columns: Mapping[str, Numbers]
    """Their names and numbers, each of shape (n,)."""
    stamps: Stamps | None = None
    """Shape (n,); None where one of the columns is the time."""


@dataclass(frozen=True, eq=False)
class ForeignRun:
    """One recording."""

    name: str
    """What the log's file will be called, without suffix."""
    where: str
    """File, for messages."""
    parts: Sequence[Part]


@dataclass(frozen=True, eq=False)
class Imported:
    """One recording as a log."""

    name: str
    columns: Columns
    said: str
    """What was taken from where, in words."""


def imported(run: ForeignRun, items: Sequence[str], geometry: Geometry | None) -> Imported:
    """Return a run as a log.

    Args:
        run: the recording.
        items: of ``--map``, see `sysid.logs.formats.column_map`.
        geometry: dimensions of the robot, which a commanded Twist needs.

    Raises:
        InputError: as for `column_map`, or no column is one of ours, or none is the time.
    """
    rules = chosen(run.where, [name for part in run.parts for name in part.columns], parse_map(items))
    parts = []
    for part in run.parts:
        own = {ours: rule for ours, rule in rules.items() if rule.theirs in part.columns}
        if part.stamps is not None:
            stamps = part.stamps
        elif TIME in own:
            stamps = stamps_of(run.where, part.columns[own[TIME].theirs], own[TIME].unit)
        else:
            raise InputError(
                f"{run.where}: which column is the time? give --map {TIME}=NAME (or {TIME}=NAME:ns); "
                f"there are {', '.join(part.columns)}"
            )
        if columns := our_columns(run.where, part.columns, own, geometry):
            parts.append((stamps, columns))
    if not parts:
        theirs = ", ".join(name for part in run.parts for name in part.columns)
        raise InputError(
            f"{run.where}: no column is one of ours; give --map OURS=THEIRS for each; theirs: {theirs}; "
            f"ours: {', '.join(KNOWN)}"
        )
    said = ", ".join(f"{ours} = {rule.theirs}" for ours, rule in rules.items() if ours != rule.theirs)
    taken = {rule.theirs for rule in rules.values()}
    left = [name for part in run.parts for name in part.columns if name not in taken]
    out = f"left out: {', '.join(left)}" if left else ""
    return Imported(run.name, on_all_stamps(parts), "; ".join(filter(None, (said, out))) or "all columns")
