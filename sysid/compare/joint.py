"""The wheel law and a set of effects as one candidate: both are fitted to the same logs at once.

A law that is fitted alone takes up part of what friction, limits and delays do, and they are then missed or
found at a wrong size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.coordinates import EffectSet
from sysid.compare.fitted import Fitted, RefittedLaw

_STEP = 1e-5  # of a finite difference of the coefficients, which are smooth functions of the place


@dataclass(frozen=True)
class LawWithEffects:
    """The wheel law with five free parameters (its DC gain is kept), and effects with theirs."""

    law: RefittedLaw
    effects: EffectSet

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.effects.names

    @property
    def parameter_count(self) -> int:
        """Number of free parameters, those of the law first."""
        return self.law.parameter_count + self.effects.parameter_count

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which free parameters have a discontinuous response."""
        return (*self.law.stepwise, *self.effects.stepwise)

    @property
    def owners(self) -> tuple[str, ...]:
        """The effect that each free parameter belongs to, "" for the law's."""
        return (*self.law.owners, *self.effects.owners)

    def start(self) -> FloatArray:
        """Return the place of the unchanged law with neutral effects, (p,)."""
        return np.concatenate([self.law.start(), self.effects.start()])

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the `base` model with the law and the effects at a place `unit`, (p,)."""
        count = self.law.parameter_count
        return self.effects.model(self.law.model(base, unit[:count]), unit[count:])


def joint_covariance(
    fitted: Fitted[LawWithEffects], base: Model, inflation: float
) -> tuple[list[str], FloatArray]:
    """Return the names and the covariance (n, n) of all that was fitted together, in the model's own units.

    The names are A-F and then "EFFECT.PARAMETER" of each free parameter that has a finite value. `base` is
    the model that was fitted, and `inflation` the variance of the residual relative to the noise. As five
    numbers give A-F (the law's DC gain is kept), the matrix is singular.
    """
    candidate, place = fitted.candidate, fitted.place
    count = candidate.law.parameter_count

    def coefficients(at: FloatArray) -> FloatArray:
        return np.asarray(candidate.law.model(base, at).wheel.law.coefficients, float)

    slope = np.zeros((len(COEFFICIENTS) + candidate.effects.parameter_count, place.size))
    for index, step in enumerate(_STEP * np.eye(count)):
        change = coefficients(place[:count] + step) - coefficients(place[:count] - step)
        slope[: len(COEFFICIENTS), index] = change / (2.0 * _STEP)
    names, rows = list(COEFFICIENTS), list(range(len(COEFFICIENTS)))
    for index, one in enumerate(candidate.effects.coordinates):
        at = float(place[count + index])
        # One-sided at a bound, beyond which a place has no value.
        low, high = max(0.0, at - _STEP), min(1.0, at + _STEP)
        moved = one.value(high) - one.value(low)
        if one.effect and math.isfinite(one.value(at)) and math.isfinite(moved):
            names.append(f"{one.effect}.{one.parameter}")
            rows.append(len(COEFFICIENTS) + index)
            slope[rows[-1], count + index] = moved / (high - low)
    slope = slope[rows]
    return names, np.asarray(slope @ fitted.covariance(inflation) @ slope.T)
