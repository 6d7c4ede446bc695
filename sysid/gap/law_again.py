"""The rival of every effect: the wheel law itself, fitted again to these logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.estimators.stability import free_coordinates, stable_abc

NAME: Final = "wheel_law"
_REACH: Final = np.array([1.5, 1.5, 1.5, 0.5, 0.5])
"""Of the search to either side: three stable coordinates of A-C (`sysid.estimators.stability`), D and E."""


@dataclass(frozen=True)
class LawAgain:
    """The law's five free numbers as a vector, each 0 .. 1; F keeps the law's steady gain."""

    base: Model
    names: tuple[str, ...] = field(default=(NAME,))

    @property
    def parameter_count(self) -> int:
        """Free numbers."""
        return len(_REACH)

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """None of them jumps."""
        return (False,) * self.parameter_count

    @property
    def owners(self) -> tuple[str, ...]:
        """None of them belongs to an effect."""
        return ("",) * self.parameter_count

    def start(self) -> FloatArray:
        """Return the place of the law as it is, shape (5,)."""
        return np.full(len(_REACH), 0.5)

    def model(self, base: Model, unit: Sequence[float] | FloatArray) -> Model:
        """Return the base model with the law at a place `unit`, shape (5,)."""
        law = self.base.wheel.law
        c = law.coefficients
        moved = (np.asarray(unit, float) - 0.5) * 2.0 * _REACH
        if not np.any(moved):
            return base
        abc = stable_abc(free_coordinates(c[:3]) + moved[:3])
        gain = float(np.sum(c[3:]) / (1.0 - np.sum(c[:3])))
        d, e = c[3:5] + moved[3:]
        f = gain * (1.0 - float(np.sum(abc))) - d - e
        values = dict(zip(COEFFICIENTS, [*abc.tolist(), float(d), float(e), float(f)], strict=True))
        return replace(base, wheel=replace(base.wheel, law=replace(law, **values)))
