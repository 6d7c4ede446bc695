"""Columns of other programs as those of a log: by name, or by ``--map OURS=THEIRS:UNIT``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import BODY_COMMAND, Geometry, twist_to_command
from sysid.logs.formats.stamps import Columns, Stamps
from sysid.logs.quantities import factor_to
from sysid.logs.runs import KNOWN, TIME

TWIST: Final = ("command_vx_m_s", "command_vy_m_s", "command_yaw_rate_rad_s")
"""A commanded motion of the body, which a log holds as V, theta, VC."""
DIMENSIONS: Final = ("wheel_radius_m", "half_wheelbase_m", "half_track_m")
"""What turns a Twist into wheel speeds, as robot.json names it."""
NEEDS_DIMENSIONS: Final = (
    "a Twist becomes wheel speeds by the robot's dimensions; give --robot FILE, a JSON with "
    f"{', '.join(DIMENSIONS)}"
)
_NAMES: Final = (*KNOWN, *TWIST)
_NONE: Final = "none"
_NS: Final = 1_000_000_000

Numbers = npt.NDArray[Any]
"""Integers or floats, shape (n,)."""


@dataclass(frozen=True)
class Rule:
    """Where a column comes from."""

    theirs: str
    """Their name; "none" to leave the column out."""
    unit: str | None
    """Their unit; None: ours."""


def parse_map(items: Sequence[str]) -> dict[str, Rule]:
    """Return the rules that `items`, such as ``speed_rpm=omega:rad_s``, state, by our names.

    Raises:
        InputError: an item of another form, or an unknown name of ours or unit.
    """
    rules = {}
    for item in items:
        ours, equals, source = item.partition("=")
        if not equals or not source:
            raise InputError(
                f"--map {item!r}: must be OURS=THEIRS or OURS=THEIRS:UNIT, as speed_rpm=omega:rad_s"
            )
        if ours not in _NAMES:
            raise InputError(
                f"--map {item!r}: unknown{did_you_mean(ours, _NAMES)}; known: {', '.join(_NAMES)}"
            )
        theirs, colon, unit = source.rpartition(":")
        if colon:
            factor_to(ours, unit)
        rules[ours] = Rule(theirs, unit) if colon else Rule(source, None)
    return rules


def chosen(where: str, theirs: Sequence[str], rules: Mapping[str, Rule]) -> dict[str, Rule]:
    """Return which of `theirs` each column of ours is: by rule, else where the last part of a name is ours.

    A name has parts with dots between them, as in ``/wheels.speed_fl_rpm``. Messages name the file, `where`.

    Raises:
        InputError: a rule names what is not there, or two of theirs have one name of ours.
    """
    found: dict[str, Rule] = {}
    for ours, rule in rules.items():
        if rule.theirs != _NONE and rule.theirs not in theirs:
            raise InputError(
                f"{where}: --map {ours}={rule.theirs}: no such column{did_you_mean(rule.theirs, theirs)}; "
                f"there are {', '.join(theirs)}"
            )
        if rule.theirs != _NONE:
            found[ours] = rule
    taken = {rule.theirs for rule in found.values()}
    for name in theirs:
        ours = name.rsplit(".", 1)[-1]
        if ours not in _NAMES or ours in rules or name in taken:
            continue
        if ours in found:
            raise InputError(
                f"{where}: both {found[ours].theirs} and {name} are {ours}; choose with --map {ours}={name}"
            )
        found[ours] = Rule(name, None)
    return found


def stamps_of(where: str, values: Numbers, unit: str | None) -> Stamps:
    """Return stamps in nanoseconds from the values of a column of time; integers stay exact.

    `unit` is that of the numbers, seconds by default. Messages name the file, `where`.

    Raises:
        InputError: a stamp is missing, or none is there.
    """
    if values.size == 0 or not np.all(np.isfinite(values)):
        raise InputError(f"{where}: a row has no stamp; every row needs one")
    factor = factor_to(TIME, unit or "s")
    if np.issubdtype(values.dtype, np.integer):
        # All factors are powers of ten down to 1e-9.
        return np.asarray(values, np.int64) * round(factor * _NS)
    # From the first on, so that rounding does not grow with the date.
    return np.asarray(np.rint((values - values[0]) * factor * _NS), np.int64)


def our_columns(
    where: str, theirs: Mapping[str, Numbers], rules: Mapping[str, Rule], geometry: Geometry | None
) -> Columns:
    """Return the columns that the rules of `chosen` make of theirs, in our units; all but `time_s`, (n,).

    A commanded Twist becomes V, theta, VC by the `geometry`. Messages name the file, `where`.

    Raises:
        InputError: a Twist without geometry, or one of its three parts is missing.
    """
    columns: Columns = {}
    for ours, rule in rules.items():
        if ours != TIME:
            factor = 1.0 if rule.unit is None else factor_to(ours, rule.unit)
            columns[ours] = np.asarray(theirs[rule.theirs], float) * factor
    twist = [columns.pop(name) for name in TWIST if name in columns]
    if not twist:
        return columns
    if len(twist) < len(TWIST):
        raise InputError(f"{where}: a commanded Twist needs all of {', '.join(TWIST)}; map each")
    if geometry is None:
        raise InputError(f"{where}: {NEEDS_DIMENSIONS}")
    return {
        **dict(zip(BODY_COMMAND, twist_to_command(np.column_stack(twist), geometry), strict=True)),
        **columns,
    }
