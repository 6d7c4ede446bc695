"""What a user may choose about the online estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from mecanum_env.errors import InputError


@dataclass(frozen=True)
class OnlineOptions:
    """Settings of `OnlineEstimator`; the defaults suit 120 samples a second with 1 rpm rounding.

    Lengths are counted in samples, since it is samples that carry information.

    Raises:
        InputError: a value out of range; the message names it.
    """

    memory_samples: float = 180.0
    """Memory while the law is steady: a sample this old has lost 63 % of its weight."""
    shortest_memory_samples: float = 4.0
    """Memory while the innovations say that the law has changed."""
    noise_rpm: float = 0.6
    """Rough standard deviation of the measured speed [rpm]: scales the prior; the noise is estimated."""
    quantum_rpm: float = 1.0
    """Resolution of the measured speed [rpm]: the noise is never taken below what rounding makes."""
    prior_deviation: float = 0.5
    """How far a coefficient may lie from the initial law as long as the data do not tell [1]."""
    largest_pole: float = 0.99
    """No published law has a pole above this magnitude; below 1."""
    largest_numerator: float = 2.0
    """No published law has D, E or F beyond +- this."""
    largest_step: float = 0.5
    """No coefficient moves by more than this in one sample, before projection."""
    outlier_deviations: float = 6.0
    """Innovations are clipped at this many standard deviations (Huber)."""
    change_ratio: float = 1.5
    """Memory shortens when recent innovation power exceeds the usual by more than this factor."""
    recent_samples: float = 24.0
    """Over this many samples "recent" power is averaged."""
    usual_samples: float = 480.0
    """Over this many samples "usual" power is averaged."""
    saturation_rpm: float = math.inf
    """Commands are clipped to +- this [rpm] before the law; infinite: no known ceiling."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if math.isnan(value) or value < 0.0 or (math.isinf(value) and field.name != "saturation_rpm"):
                raise InputError(f"online options: {field.name} = {value}, must be a number of at least 0")
            if value == 0.0 and field.name != "quantum_rpm":
                raise InputError(f"online options: {field.name} = 0, must be above 0")
        if self.largest_pole >= 1.0:
            raise InputError(f"online options: largest_pole = {self.largest_pole}, must be below 1")
        for name in ("shortest_memory_samples", "recent_samples", "usual_samples"):
            if getattr(self, name) < 2.0:
                raise InputError(f"online options: {name} = {getattr(self, name)}, must be at least 2")
        if self.shortest_memory_samples > self.memory_samples:
            raise InputError(
                f"online options: shortest_memory_samples = {self.shortest_memory_samples:g}, "
                f"must be at most memory_samples = {self.memory_samples:g}"
            )
        for name in ("outlier_deviations", "change_ratio"):
            if getattr(self, name) < 1.0:
                raise InputError(f"online options: {name} = {getattr(self, name)}, must be at least 1")
