"""The terms that a custom effect may be made of: formulas and tables with free numbers, to be fitted."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import CustomEffect, CustomTable, Model
from mecanum_env.units import FloatArray

SOURCE: Final = "gap"
"""What a proposed effect states as its source."""
HARMONICS: Final = tuple(range(1, 13))
"""Harmonics of the wheel angle: the first is an uneven wheel or encoder, the tenth the ten rollers."""
_WIDTHS: Final = (0.05, 0.2)
"""Widths of what happens near rest, in shares of the top speed."""
_DECAYS: Final = (0.1, 0.5)
"""Time constants of what fades, in shares of the longest run."""
_SHAPE_RANGE: Final = 5.0
"""Factor by which a fit may change a width or a time constant."""
_LARGEST: Final = 0.5
"""Largest value of a term, in shares of the top speed."""
_KNOTS: Final = 6
"""Knots of a table."""


@dataclass(frozen=True)
class Term:
    """A summand of a formula without its size; of a wave, sine and cosine belong together."""

    text: str
    """As in a formula; "{}" stands for a width or time constant, "wave" for a sine of angle and phase."""
    size: float
    """About its largest value in the logs."""
    harmonic: int = 0
    """Multiple of the angle of a wave; 0: no wave."""
    shape: float = 0.0
    """Width [rpm] or time constant [s] at which the term is tried; 0: it has none."""

    @property
    def count(self) -> int:
        """Number of its coefficients."""
        return 2 if self.harmonic else 1

    def written(self, coefficients: Sequence[float], shape: float, digits: int) -> str:
        """Return the term with its coefficients, each in so many `digits`; `shape` replaces its own."""
        body = self.text.replace("{}", f"{shape:.{digits}g}")
        size = coefficients[0]
        if self.harmonic:
            size, phase = _wave(*coefficients)
            turned = f"{round(phase, digits - 1):.{digits}g}"  # as exact as the amplitude
            angle = "angle" if self.harmonic == 1 else f"{self.harmonic} * angle"
            inside = angle if float(turned) == 0.0 else f"{angle} + {turned}".replace("+ -", "- ")
            body = body.replace("wave", f"sin({inside})")
        return f"{size:.{digits}g}" if body == "1" else f"{size:.{digits}g} * {body}"


def _wave(sine: float, cosine: float) -> tuple[float, float]:
    """Return amplitude and phase [rad] within +-pi/2 of a sum of sine and cosine."""
    amplitude, phase = math.hypot(sine, cosine), math.atan2(cosine, sine)
    if abs(phase) > math.pi / 2:
        amplitude, phase = -amplitude, phase - math.copysign(math.pi, phase)
    return amplitude, phase


@dataclass(frozen=True)
class Extent:
    """What the logs cover."""

    top_rpm: float
    """Largest speed or command."""
    longest_s: float
    """Duration of the longest run."""
    ranges: tuple[tuple[str, float, float], ...]
    """Input with its unit, such as "speed_rpm", and its lowest and highest value."""
    whole: bool = True
    """Whether no run is a piece of a longer one, in which time and angle since the start are not known."""

    def of(self, name: str) -> tuple[float, float]:
        """Return the lowest and highest value of an input by its `name`, such as "speed"."""
        return next((low, high) for key, low, high in self.ranges if key.split("_")[0] == name)


def terms_at(station: str, extent: Extent) -> tuple[Term, ...]:
    """Return the terms tried at a station: over the command in front of the law, else over the speed.

    Those over time and angle need runs of a whole `extent`.
    """
    name = "command" if station in ("command", "set_point") else "speed"
    found = tuple(_static(name, extent))
    if extent.whole:
        found = (*found, *_fading(name, extent), *(_waves(extent) if name == "speed" else ()))
    return found


def _static(x: str, extent: Extent) -> Iterator[Term]:
    top = extent.top_rpm
    yield Term("1", 1.0)
    yield Term(f"sign({x})", 1.0)
    yield Term(x, top)
    yield Term(f"abs({x})", top)
    yield Term(f"{x} * abs({x})", top**2)
    for width in _WIDTHS:
        yield Term(f"sign({x}) * exp(-abs({x}) / {{}})", 1.0, shape=width * top)


def _fading(x: str, extent: Extent) -> Iterator[Term]:
    yield Term("time", extent.longest_s)
    yield Term(f"{x} * time", extent.top_rpm * extent.longest_s)
    for decay in _DECAYS:
        seconds = decay * extent.longest_s
        yield Term("exp(-time / {})", 1.0, shape=seconds)
        yield Term(f"{x} * exp(-time / {{}})", extent.top_rpm, shape=seconds)


def _waves(extent: Extent) -> Iterator[Term]:
    for harmonic in HARMONICS:
        yield Term("wave", 1.0, harmonic)
        yield Term("speed * wave", extent.top_rpm, harmonic)


class _Nameless(ABC):
    """What formulas and tables have in common as candidates of `sysid.compare.least_squares.fitted.fit`.

    Each free number lies between ends at the places 0 and 1.
    """

    station: str

    @property
    def names(self) -> tuple[str, ...]:
        """What is fitted."""
        return ("custom",)

    @property
    @abstractmethod
    def ends(self) -> FloatArray:
        """Lowest and highest value of each free number, shape (p, 2)."""

    @abstractmethod
    def effect(self, numbers: Sequence[float], digits: int = 12) -> CustomEffect:
        """Return the effect with these `numbers` (p,), each in so many `digits`."""

    @property
    def parameter_count(self) -> int:
        """Number of free numbers p."""
        return len(self.ends)

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which responses are discontinuous: none."""
        return (False,) * self.parameter_count

    @property
    def owners(self) -> tuple[str, ...]:
        """The effects that the numbers belong to: none that has a name."""
        return ("",) * self.parameter_count

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the `base` model with the effect at a place `unit`, (p,)."""
        return base.with_custom(self.effect(self.numbers(unit).tolist()))

    def numbers(self, unit: FloatArray) -> FloatArray:
        """Return the free numbers at a place `unit`, (p,)."""
        low, high = self.ends.T
        return np.asarray(low + np.asarray(unit, float) * (high - low))

    def place(self, numbers: FloatArray) -> FloatArray:
        """Return the place of free `numbers`, clipped to the ends, (p,)."""
        low, high = self.ends.T
        return np.asarray(np.clip((np.asarray(numbers, float) - low) / (high - low), 0.0, 1.0))

    def start(self) -> FloatArray:
        """Return the place at which the effect is nothing, (p,)."""
        return np.full(self.parameter_count, 0.5)


@dataclass(frozen=True)
class Formula(_Nameless):
    """A sum of terms; its free numbers are all coefficients, followed by the shapes."""

    station: str
    terms: tuple[Term, ...]
    top_rpm: float

    @property
    def ends(self) -> FloatArray:
        """Lowest and highest value of each free number, shape (p, 2)."""
        most = [_LARGEST * self.top_rpm / term.size for term in self.terms for _ in range(term.count)]
        shapes = [(s / _SHAPE_RANGE, s * _SHAPE_RANGE) for term in self.terms if (s := term.shape)]
        return np.array([*((-m, m) for m in most), *shapes])

    def effect(self, numbers: Sequence[float], digits: int = 12) -> CustomEffect:
        """Return the effect with these `numbers` (p,), each in so many `digits`."""
        counts = [term.count for term in self.terms]
        coefficients, shapes = iter(numbers[: sum(counts)]), iter(numbers[sum(counts) :])
        parts = []
        for term in self.terms:
            own = [next(coefficients) for _ in range(term.count)]
            parts.append(term.written(own, next(shapes) if term.shape else 0.0, digits))
        return CustomEffect(self.station, " + ".join(parts).replace("+ -", "- "), source=SOURCE)

    def start_of(self, coefficients: Sequence[float]) -> FloatArray:
        """Return the place with the `coefficients` and the terms' own shapes, (p,)."""
        return self.place(np.array([*coefficients, *(term.shape for term in self.terms if term.shape)]))


@dataclass(frozen=True)
class FreeTable(_Nameless):
    """A table over one input; its free numbers are the values."""

    station: str
    input: str
    knots: tuple[float, ...]
    top_rpm: float

    @property
    def ends(self) -> FloatArray:
        """Lowest and highest value at each knot, shape (p, 2)."""
        most = _LARGEST * self.top_rpm
        return np.tile([-most, most], (len(self.knots), 1))

    def effect(self, numbers: Sequence[float], digits: int = 12) -> CustomEffect:
        """Return the effect with these `numbers` (p,) as values at the knots, each in so many `digits`."""
        values = tuple(float(f"{number:.{digits}g}") for number in numbers)
        return CustomEffect(self.station, table=CustomTable(self.input, self.knots, values), source=SOURCE)


def tables_at(station: str, extent: Extent) -> Iterator[FreeTable]:
    """Return the tables that are tried at a station, each over one input of which the `extent` is known."""
    moving = "command" if station in ("command", "set_point") else "speed"
    for name in (moving, "time") if extent.whole else (moving,):
        low, high = extent.of(name)
        if high > low:
            knots = tuple(float(f"{knot:.4g}") for knot in np.linspace(low, high, _KNOTS))
            yield FreeTable(station, name, knots, extent.top_rpm)


def with_ranges(effect: CustomEffect, extent: Extent) -> CustomEffect:
    """Return an effect with the ranges of its inputs in the logs; an angle has none."""
    used = effect.inputs - {"angle"}
    ranges = {key: (low, high) for key, low, high in extent.ranges if key.split("_")[0] in used}
    return replace(effect, range=ranges)
