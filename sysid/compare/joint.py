"""The wheel law and a set of effects as one candidate: both are fitted to the same logs at once.

A law that is fitted alone takes up part of what friction, limits and delays do, and they are then missed or
found at a wrong size.
"""

from __future__ import annotations

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


def coefficient_covariance(
    fitted: Fitted[LawWithEffects], base: Model, inflation: float
) -> tuple[list[str], FloatArray]:
    """Return the names A-F and the covariance (6, 6) of the law's coefficients in a fit with effects.

    The effects' parameters are unknown as well. `base` is the model that was fitted, and `inflation` the
    variance of the residual relative to the noise.
    """
    law, place = fitted.candidate.law, fitted.place
    count = law.parameter_count

    def coefficients(at: FloatArray) -> FloatArray:
        return np.asarray(law.model(base, at).wheel.law.coefficients, float)

    rows = [
        (coefficients(place[:count] + step) - coefficients(place[:count] - step)) / (2.0 * _STEP)
        for step in _STEP * np.eye(count)
    ]
    slope = np.array(rows).T
    return list(COEFFICIENTS), np.asarray(slope @ fitted.covariance(inflation)[:count, :count] @ slope.T)
