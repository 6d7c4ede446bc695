"""What can be fitted to logs: free parameters on a scale from 0 to 1, and the model at each place of them."""

from __future__ import annotations

from typing import Protocol

from mecanum_env.model import Model
from mecanum_env.units import FloatArray


class Candidate(Protocol):
    """What can be fitted: a set of effects, or the wheel law.

    A place (p,) holds its free parameters, each scaled to 0..1.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, or of what is fitted instead."""

    @property
    def parameter_count(self) -> int:
        """Number p of free parameters."""

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which free parameters have a discontinuous response, (p,)."""

    @property
    def owners(self) -> tuple[str, ...]:
        """The effect that each free parameter belongs to, "" for none, (p,)."""

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the model at a place (p,)."""

    def start(self) -> FloatArray:
        """Return the place nearest to the base model, (p,)."""
