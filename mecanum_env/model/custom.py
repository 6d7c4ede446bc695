"""Custom effects: what a log shows and no named effect describes, as a formula or a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean, require_one_of
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.formula import compile_formula
from mecanum_env.wheel_drive.program import (
    INPUTS,
    LARGEST_TABLE,
    UNITS,
    Program,
    evaluate,
    inputs_of,
    joined,
    require_runs,
    table_program,
)

STATIONS: Final = ("command", "set_point", "load", "sensor")
"""Where a custom effect may act: on the command that the drive receives, on the wheel's set-point, as a load
on the wheel, or on the measured wheel speed."""
SENSOR_INPUTS: Final = ("speed", "angle", "time")
"""What a sensor can depend on: it knows neither command nor supply."""
RANGES: Final = tuple(f"{name}_{unit}" for name, unit in UNITS.items())
"""Names in the range of a custom effect: the inputs with their units."""


@dataclass(frozen=True)
class CustomTable:
    """A function of one input: linear between the knots, held outside."""

    input: str
    """One of `mecanum_env.wheel_drive.program.INPUTS`."""
    knots: tuple[float, ...]
    """Increasing, in the input's unit."""
    values: tuple[float, ...]
    """Value at each knot [rpm]."""

    def __post_init__(self) -> None:
        require_one_of("table.input", self.input, INPUTS)
        if not 2 <= len(self.knots) <= LARGEST_TABLE or len(self.knots) != len(self.values):
            raise InputError(
                f"table: {len(self.knots)} knots and {len(self.values)} values, "
                f"must be 2 to {LARGEST_TABLE} of each"
            )
        if not all(map(math.isfinite, (*self.knots, *self.values))):
            raise InputError("table: knots and values must be finite numbers")
        if any(second <= first for first, second in zip(self.knots, self.knots[1:], strict=False)):
            raise InputError(f"table.knots = {list(self.knots)}, must increase")


@dataclass(frozen=True)
class CustomEffect:
    """What is added to the speeds [rpm] at a station, as a formula or as a table.

    Raises:
        InputError: an unknown station, name or function, a formula that is too long or nested too deep, or
            both or neither of formula and table.
    """

    station: str
    """One of `STATIONS`."""
    formula: str | None = None
    """In the language of `mecanum_env.wheel_drive.formula`."""
    table: CustomTable | None = None
    unit: str = "rpm"
    """Unit of the value; there is no other."""
    source: str = ""
    """Where it comes from, such as "gap"."""
    range: Mapping[str, tuple[float, float]] = field(default_factory=dict, hash=False)
    """Input with its unit (`RANGES`) -> lowest and highest value for which it was seen; for readers only."""

    def __post_init__(self) -> None:
        if self.station not in STATIONS:
            raise InputError(
                f"station = {self.station!r}: no such station{did_you_mean(self.station, STATIONS)}; "
                f"known: {', '.join(STATIONS)}"
            )
        if (self.formula is None) == (self.table is None):
            raise InputError("must have a formula or a table, and not both")
        if self.unit != "rpm":
            raise InputError(f"unit = {self.unit!r}, must be 'rpm'")
        for name, (low, high) in self.range.items():
            require_one_of("range", name, RANGES)
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                raise InputError(f"range.{name} = [{low}, {high}], must be two numbers, the lower first")
        unknown = self.inputs - set(SENSOR_INPUTS)
        if self.station == "sensor" and unknown:
            raise InputError(
                f"a sensor does not know {' and '.join(sorted(unknown))}; use {', '.join(SENSOR_INPUTS)}"
            )

    @property
    def program(self) -> Program:
        """What drive and sensors run."""
        if self.table is not None:
            return table_program(self.table.input, self.table.knots, self.table.values)
        try:
            return compile_formula(self.formula or "")
        except InputError as error:
            raise InputError(f"formula = {error}") from error

    def value(self, inputs: Mapping[str, npt.ArrayLike]) -> FloatArray:
        """Return the value [rpm] for `inputs` by name, of the shape to which they broadcast; others are 0."""
        return evaluate(self.program, inputs)

    @property
    def inputs(self) -> frozenset[str]:
        """Names of the inputs that it uses."""
        return inputs_of(self.program)

    @property
    def text(self) -> str:
        """The formula, or the table in one line."""
        if self.table is None:
            return self.formula or ""
        pairs = zip(self.table.knots, self.table.values, strict=True)
        return f"table of {self.table.input}: " + ", ".join(f"{k:.4g}: {v:.4g}" for k, v in pairs)


def program_at(effects: Iterable[CustomEffect], station: str) -> Program:
    """Return the program of all `effects` that act at a station together, () if none does.

    Raises:
        InputError: together they are too long.
    """
    acting = [effect.program for effect in effects if effect.station == station]
    if not acting:
        return ()
    program = joined(acting)
    if len(acting) > 1:
        try:
            require_runs(program)
        except InputError as error:
            raise InputError(f"custom: all effects of the station {station} together: {error}") from error
    return program
