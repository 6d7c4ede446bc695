"""Options of the online estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mecanum_env.errors import InputError


@dataclass(frozen=True)
class OnlineOptions:
    """Settings of `OnlineEstimator`; the defaults suit 120 samples a second with 1 rpm rounding.

    Spans are counted in samples, since samples carry the information.

    Raises:
        InputError: a value out of range; the message names it.
    """

    memory_samples: float = 180.0
    """Memory while the law is steady: a sample this old has lost 63 % of its weight."""
    shortest_memory_samples: float = 4.0
    """Memory while the innovations say that the law has changed."""
    noise_rpm: float = 0.6
    """Rough standard deviation of the measured speed [rpm]. It scales the prior; the noise is estimated."""
    quantum_rpm: float = 1.0
    """Resolution of the measured speed [rpm]. The estimated noise is at least that of rounding to it."""
    prior_deviation: float = 0.5
    """Standard deviation of a coefficient about the initial law before any data [1]."""
    largest_pole: float = 0.99
    """Largest pole magnitude of a published law; below 1."""
    largest_numerator: float = 2.0
    """Largest magnitude of D, E and F of a published law."""
    largest_step: float = 0.5
    """Largest change of a coefficient in one sample, before projection."""
    outlier_deviations: float = 6.0
    """Innovations are clipped at this many standard deviations (Huber)."""
    change_ratio: float = 1.5
    """Memory shortens when recent innovation power exceeds the usual by more than this factor."""
    recent_samples: float = 24.0
    """Number of samples over which the recent power is averaged."""
    usual_samples: float = 480.0
    """Number of samples over which the usual power is averaged."""
    saturation_rpm: float = math.inf
    """Commands are clipped to +- this [rpm] before the law; infinite: no known ceiling."""

    def __post_init__(self) -> None:
        least = {"quantum_rpm": 0.0, "outlier_deviations": 1.0, "change_ratio": 1.0}
        least |= dict.fromkeys(("shortest_memory_samples", "recent_samples", "usual_samples"), 2.0)
        for name, value in vars(self).items():
            if math.isnan(value) or (math.isinf(value) and name != "saturation_rpm"):
                raise InputError(f"online options: {name} = {value}, must be a finite number")
            if name in least and value < least[name]:
                raise InputError(f"online options: {name} = {value:g}, must be at least {least[name]:g}")
            if name not in least and value <= 0.0:
                raise InputError(f"online options: {name} = {value:g}, must be above 0")
        if self.largest_pole >= 1.0:
            raise InputError(f"online options: largest_pole = {self.largest_pole}, must be below 1")
        if self.shortest_memory_samples > self.memory_samples:
            raise InputError(
                f"online options: shortest_memory_samples = {self.shortest_memory_samples:g}, "
                f"must be at most memory_samples = {self.memory_samples:g}"
            )
