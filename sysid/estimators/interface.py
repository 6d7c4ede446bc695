"""What every estimator takes and gives back."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray
from sysid.estimators.runs import WheelRun

SUCCESS_RATIO = 1.05
"""A start succeeds when its rms is within 5 % of the best start's."""


@dataclass(frozen=True)
class Options:
    """How to estimate; every method reads what concerns it and ignores the rest.

    Raises:
        InputError: a value out of range.
    """

    starts: int = 10
    """How many starting points."""
    seed: int = 0
    """Of the random starting points."""
    first_starts: Literal["informed", "random"] = "informed"
    """informed: Steiglitz-McBride, then one-step-ahead, then random ones; random: only random ones."""
    initial: tuple[tuple[float, ...], ...] = ()
    """Starting points A-F given by the caller; replaces all others when not empty."""
    unit_gain: bool = True
    """Hold A+B+C+D+E+F = 1, the unit DC gain of a drive with integral action; E is then eliminated."""
    order: Literal["auto", "third"] = "auto"
    """auto: C and F (then B) are 0 where the data are explained as well without; third: never."""
    fit_delay: bool = False
    """Estimate a pure transport delay of the command."""
    max_delay_s: float = 0.25
    """Longest delay tried [s]."""
    fit_saturation: bool = False
    """Estimate a limit on the command where the speeds show a ceiling."""
    loss: Literal["linear", "huber"] = "linear"
    """linear: least squares; huber: outliers beyond 1.345 sigma count linearly."""
    max_iterations: int = 200
    """Evaluations allowed to one start."""

    def __post_init__(self) -> None:
        require_at_least(1, starts=self.starts, max_iterations=self.max_iterations)
        require_at_least(0, seed=self.seed)
        if not (self.max_delay_s >= 0.0 and math.isfinite(self.max_delay_s)):
            raise InputError(f"max_delay_s = {self.max_delay_s}, must be a finite number of at least 0")
        for row in self.initial:
            if len(row) != 6 or not np.all(np.isfinite(row)):
                raise InputError(f"initial start {row}, must be six finite numbers A-F")


@dataclass(frozen=True)
class StartResult:
    """Where one starting point led."""

    kind: str
    """steiglitz-mcbride, one-step, random, given, or for `exhaustive` the speed that was fitted."""
    initial: tuple[float, ...]
    """A-F at the start."""
    coefficients: tuple[float, ...]
    """A-F reached; may be unstable or not finite for methods without a guarantee."""
    rms_rpm: float
    """Of the free-running error; infinite where the result is unstable and diverges."""
    stable: bool
    converged: bool
    iterations: int
    seconds: float


@dataclass(frozen=True)
class Estimate:
    """The law that a method found, and how it found it."""

    method: str
    law: WheelLaw
    rms_rpm: float
    """Root mean square of measured minus predicted, free-running [rpm]."""
    cost: float
    """Half the square sum of (measured - predicted)/sigma; the negative log likelihood up to a constant."""
    free: tuple[str, ...]
    """Estimated parameters: five or six of A-F, then delay_s and saturation_rpm where fitted."""
    starts: tuple[StartResult, ...]
    seconds: float
    """All starts together, preparation included [s]."""
    delay_s: float = 0.0
    """Transport delay of the command beyond what the runs already contain [s]."""
    saturation_rpm: float = math.inf
    """Limit on the command [rpm]; infinite: no ceiling was seen, or none was looked for."""

    @property
    def success_share(self) -> float:
        """Share of starts within 5 % of the best rms among the stable ones."""
        best = min((s.rms_rpm for s in self.starts if s.stable), default=math.inf)
        return sum(s.stable and s.rms_rpm <= SUCCESS_RATIO * best for s in self.starts) / len(self.starts)

    @property
    def stable_share(self) -> float:
        """Share of starts that ended at a stable law."""
        return sum(s.stable for s in self.starts) / len(self.starts)

    @property
    def coefficients(self) -> FloatArray:
        """A-F, shape (6,)."""
        return self.law.coefficients


Method = Callable[[Sequence[WheelRun], Options], Estimate]
