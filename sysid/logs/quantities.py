"""Refusals of columns that are not what their place says: positions instead of speeds, and other units.

A drive that takes positions is another machine than the wheel law describes, and a factor of 9.55 or 1000
makes any fit nonsense, so a sentence says what to convert, before anything is fitted.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.kinematics import WHEEL_SPEEDS, WHEELS
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.findings import Finding
from sysid.logs.runs import KNOWN, BodyCommand, Dataset, Run

_FACTORS: Final[Mapping[str, Mapping[str, float]]] = {
    "rpm": {"rad_s": 1.0 / RAD_S_PER_RPM, "deg_s": 1.0 / 6.0, "turns_s": 60.0, "rev_s": 60.0, "rps": 60.0},
    "s": {"ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "m_s": {"mm_s": 1e-3, "cm_s": 1e-2, "km_h": 1.0 / 3.6},
    "m": {"mm": 1e-3, "cm": 1e-2},
    "rad_s": {"deg_s": np.pi / 180.0, "rpm": RAD_S_PER_RPM},
    "rad": {"deg": np.pi / 180.0},
    "deg": {"rad": 180.0 / np.pi},
    "v": {"mv": 1e-3},
}
"""Factors to a unit of ours, as it ends the name of a column, from others."""
_ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "time": ("t", "stamp", "timestamp"),
    "speed": ("omega", "velocity"),
}
"""What files also call a quantity of ours."""

_COMMAND_WORDS: Final = frozenset(
    ("command", "cmd", "goal", "target", "desired", "setpoint", "reference", "ref")
)
_SPEED_WORDS: Final = frozenset(("speed", "velocity", "vel", "rate", "omega", "rpm"))
_BODY_WORDS: Final = frozenset(("theta", "yaw", "heading", "roll", "pitch", "x", "y"))
_POSITION_WORDS: Final = frozenset(("position", "pos", "angle"))
_ANGLES: Final[Mapping[str, tuple[str, str, float]]] = {
    **dict.fromkeys(("deg", "degree", "degrees"), ("degrees", "deg/s", 1.0 / 6.0)),
    **dict.fromkeys(("rad", "radian", "radians"), ("rad", "rad/s", 1.0 / RAD_S_PER_RPM)),
    **dict.fromkeys(("turn", "turns", "rev", "revs"), ("turns", "turns/s", 60.0)),
    **dict.fromkeys(("tick", "ticks", "count", "counts"), ("counts", "counts/s", 60.0)),
}
"""Units of an angle as they end the name of a column: in words, per second, and rpm of that."""

_FOLLOWS: Final = 0.8
"""Share of the turned angle's variance that a position command explains at least ..."""
_UNLIKE: Final = 0.25
"""... while it explains at most this share of the speed's."""
_LARGEST: Final = 1e9
"""Size that no quantity of a robot reaches in its unit; beside a larger one a fit loses all others."""
_CHANGES: Final = 5
"""Least number of changes of the command that tell the two apart."""


def refuse_position(header: str, column: str) -> None:
    """Refuse a `column` of a file whose name says that it is the position of a wheel or servo.

    Raises:
        InputError: it is one; the message begins with `header`, the place of the column's name.
    """
    words = _words(column)
    if words & (_SPEED_WORDS | _BODY_WORDS):
        return
    unit = next((_ANGLES[word] for word in _ANGLES if column.lower().endswith(f"_{word}")), None)
    if unit is None and not words & _POSITION_WORDS:
        return
    ours = "command_rpm" if words & _COMMAND_WORDS else "speed_rpm"
    kind, change, convert = "a position", "", "its change per second in revolutions per minute"
    if unit is not None:
        kind, change = f"a position in {unit[0]}", f" [{unit[1]}]"
        per_turn = " over the counts of a turn" if unit[0] == "counts" else ""
        convert = f"its change per second{change}{per_turn} times {unit[2]:.9g}"
    raise InputError(
        f"{header}: column {column!r} is {kind}, and a wheel law follows speeds; {convert} is {ours} "
        "(of a command only where it moves steadily: a step of position is no speed, so record such a "
        "drive in its speed mode); where the file has speeds too, list the column in ignore_columns under "
        "[dataset]"
    )


def refuse_other_wheel(header: str, column: str) -> None:
    """Refuse a `column` of a file whose name is that of a wheel which is not one of the four Mecanum wheels.

    Raises:
        InputError: it is one; the message begins with `header` and names the program that reads such logs.
    """
    wheel = re.fullmatch(r"(command|speed)_(\d+|w\d+|m\d+|wheel_?\d+|motor_?\d+)_rpm", column)
    if wheel:
        raise InputError(
            f"{header}: column {column!r} is of a robot on other wheels: python -m sysid.logs body LOGS "
            f"--robot robot.json reads it (docs/robot.md); here wheels are {', '.join(WHEELS)}"
        )


def refuse_other_unit(header: str, column: str) -> None:
    """Refuse a `column` of a file whose name is one of ours in another unit.

    Raises:
        InputError: it is one; the message begins with `header` and says what to write into dataset.toml.
    """
    for ours in KNOWN:
        unit = next(unit for unit in sorted(_FACTORS, key=len, reverse=True) if ours.endswith(f"_{unit}"))
        base = ours.removesuffix(f"_{unit}")
        for name in (base, *_ALIASES.get(base, ())):
            for other, factor in _FACTORS[unit].items():
                if column.lower() == f"{name}_{other}":
                    line = f'{ours} = {{ from = "{column}", scale = {factor!r} }}'
                    raise InputError(
                        f"{header}: column {column!r} is in {_written(other)}, must be {_written(unit)}: "
                        f"{line} under [columns] in dataset.toml converts it"
                    )


def require_speeds(runs: Sequence[Run]) -> None:
    """Refuse wheel commands of `runs` that are positions: the angle that the wheel turns follows them.

    Raises:
        InputError: the angle follows the command and the speed does not, in all that the runs show.
    """
    names = ("speed_rpm",) if runs[0].level == "bench" else WHEEL_SPEEDS
    for index, name in enumerate(names):
        used = [run for run in runs if name in run.channels and not isinstance(run.command, BodyCommand)]
        parts = [part for run in used if (part := _about_means(run, name, index)) is not None]
        if sum(np.count_nonzero(np.diff(part[0])) for part in parts) < _CHANGES:
            continue
        command, speed, turns = (np.concatenate([part[i] for part in parts]) for i in range(3))
        if _explained(command, turns) > _FOLLOWS and _explained(command, speed) < _UNLIKE:
            ours = name.replace("speed", "command")
            raise InputError(
                f"{used[0].file}: {ours} looks like a position: the angle that the wheel turns follows it, "
                f"and {name} does not; a wheel law follows speeds, so write the commanded speed of the wheel "
                f"as {ours}, or record the drive in its speed mode"
            )


def require_our_units(dataset: Dataset) -> None:
    """Refuse a dataset whose numbers show another unit, for programs that would make nonsense of it.

    Raises:
        InputError: wheel speeds or commands differ by the factor of another unit or by their sign, stamps
            are not in seconds, or a number is so large that it is none of a robot.
    """
    for run in dataset.runs:
        _require_sizes(run)
    for finding in dataset.findings:
        if _is_certain(finding):
            where = f"{dataset.name}: " if not finding.file else f"{finding.file}: "
            raise InputError(
                f"{where}{finding.message}; give it as the column's scale under [columns] in dataset.toml"
            )


def _require_sizes(run: Run) -> None:
    """Refuse a run with a marker of a missing sample, or another number that would spoil any fit."""
    for name, values in (*run.command.columns().items(), *run.channels.items()):
        wild = np.flatnonzero(np.abs(values) > _LARGEST)
        if wild.size:
            raise InputError(
                f"{run.file}: {name} = {values[wild[0]]:g} at {run.time_s[wild[0]]:g} s after the first row, "
                f"must be at most {_LARGEST:g} in size; leave the cell empty where a sample is missing"
            )


def _is_certain(finding: Finding) -> bool:
    # One row a second may be a slow log in seconds or a fast one in milliseconds; 2 s are no log of a drive.
    slow = finding.variant == "stamps" and finding.value >= 2.0
    certain = finding.variant in ("gain", "whole in rpm")
    # On the floor a wheel may be held, or turned by the others.
    alone = finding.variant in ("sign", "no speed") and finding.channel == "speed_rpm"
    return finding.kind == "units" and (certain or slow or alone)


def factor_to(ours: str, unit: str) -> float:
    """Return the factor from numbers in a `unit`, such as "rad_s", to those of the column `ours`.

    Raises:
        InputError: the column is never in such a unit; the message lists those it may be in.
    """
    own = next(one for one in sorted(_FACTORS, key=len, reverse=True) if ours.endswith(f"_{one}"))
    factors = {own: 1.0, **_FACTORS[own]}
    require_one_of(f"unit of {ours}", unit, factors)
    return factors[unit]


def _words(column: str) -> frozenset[str]:
    return frozenset(re.split(r"[\W_]+", column.lower()))


def _written(unit: str) -> str:
    """Return a unit as one writes it: m/s for m_s."""
    return unit.replace("_", "/").replace("mv", "mV")


def _about_means(run: Run, name: str, index: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return command, speed and turned angle about their means, in any unit; None if the command is held."""
    use = run.finite(name)
    command, speed = _shares(run.command.wheels_rpm[use, index]), _shares(run.channel(name)[use])
    if command.size < 5 or np.all(command == command[0]):
        return None
    steps = np.diff(run.time_s[use]) * 0.5 * (speed[1:] + speed[:-1])
    turns = np.concatenate([[0.0], np.cumsum(steps)])
    return command - command.mean(), speed - speed.mean(), turns - turns.mean()


def _shares(values: FloatArray) -> FloatArray:
    """Return values over the largest of them: only ratios count, and squares of the largest stay finite."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return values / largest if largest > 0.0 else values


def _explained(command: FloatArray, values: FloatArray) -> float:
    """Return the share of the variance of `values` that a positive multiple of the command explains."""
    power = float(command @ command) * float(values @ values)
    product = max(0.0, float(command @ values))
    return product**2 / power if power > 0.0 else 0.0
