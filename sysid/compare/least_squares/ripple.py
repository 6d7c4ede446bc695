"""The ripple of rollers that meet the floor at other times, since a log does not show its wheels' angles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error import Whitener
from sysid.compare.predicted import Simulator, Simulators

_ANGLE_STEP: Final = 0.1  # least increase of the uncertainty that is taken over
_INFLATION: Final = 1.5
"""Factor on the ripple's variance: over few wheels and runs it varies by about a third between draws."""


class WheelAngleRipple:
    """What unknown initial wheel angles change in the residual of a model.

    A log does not say at which angles its wheels started, so when each roller touches the floor is unknown,
    too. The ripple that this causes is simulated with other initial angles than those of the nominal
    simulator, recognised in the residual, and then counted as noise.
    """

    def __init__(
        self,
        simulators: Simulators,
        whitener: Whitener,
        residual: Callable[[Simulator, Model], FloatArray | None],
        marginal: Callable[[FloatArray], FloatArray],
    ) -> None:
        self._nominal, self._others, self._whitener = simulators.full, simulators.turned, whitener
        self._residual, self._marginal = residual, marginal
        self.uncertainty = 0.0
        """How unknown the initial angles are: 0 as in the simulation .. 1 entirely."""

    def update(self, model: Model, residual: FloatArray) -> bool:
        """Estimate from a residual how unknown the initial angles are; return whether it is more than before.

        Let d be the change of the residual when the wheels start at other angles. The residual of a right
        model is uncorrelated with d if the logs' angles are the simulated ones, and contains -d / 2 on
        average if they are any others. `residual` is the marginal one of the model, (N,).
        """
        ripple, rest = self._second_differences(self._changes(model)), self._second_differences(residual)
        power = float(np.sum(ripple**2))
        unknown = min(1.0, -2.0 * float(np.sum(ripple * rest[:, None])) / power) if power > 0.0 else 0.0
        if unknown < max(_ANGLE_STEP, self.uncertainty + _ANGLE_STEP):
            return False
        self.uncertainty = unknown
        return True

    def columns(self, model: Model) -> FloatArray:
        """Return what unknown angles may add to a right model's marginal residual: columns (N, k)."""
        blocks = self._nominal.observations.blocks
        repeats = np.concatenate([np.full(block.value.size, float(block.repeats)) for block in blocks])
        # Two draws differ by twice the variance of one. Measured is the mean of the repeats; simulated, one.
        variance = self.uncertainty * 0.5 * (1.0 + 1.0 / repeats) * _INFLATION
        changes = self._changes(model)
        return np.asarray(changes * np.sqrt(variance)[:, None] / math.sqrt(max(1, changes.shape[1])))

    def _changes(self, model: Model) -> FloatArray:
        """Return how the marginal residual changes when the wheels start at other angles, (N, k)."""
        nominal = self._residual(self._nominal, model)
        others = self._nominal.settings.map(lambda simulator: self._residual(simulator, model), self._others)
        found = [self._marginal(one - nominal) for one in others if one is not None and nominal is not None]
        return np.stack(found, axis=1) if found else np.zeros((self._whitener.size, 0))

    def _second_differences(self, values: FloatArray) -> FloatArray:
        """Return the second differences within each block, which keep the ripple and remove slow changes."""
        return np.concatenate([np.diff(values[rows], 2, axis=0) for rows in self._whitener.slices])
