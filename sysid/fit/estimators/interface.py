"""What an estimator is given: one wheel in one run, on the clock of the wheel law.

What every estimator takes and gives back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray

CommandSource = Callable[[float, float], npt.ArrayLike]
"""``source(delay_s, saturation_rpm) -> r``: r(0..K-1) [rpm], shape (K,), rebuilt from the log."""


@dataclass(frozen=True, eq=False)
class WheelRun:
    """One wheel in one run: what it was told at every tick of the law, and what was measured.

    Raises:
        InputError: shapes that disagree, a value that is not finite, a sigma that is not positive or a sample
            outside the run; the message names the run, the field and the place.
    """

    command_rpm: FloatArray
    """Commands r(0..K-1) at the law's ticks [rpm], shape (K,), after latch, rounding and known limits."""
    sample_tick: FloatArray
    """When each speed was measured [ticks], 0 to K, whole or fractional, shape (N,)."""
    speed_rpm: FloatArray
    """Measured wheel speed [rpm], shape (N,)."""
    sigma_rpm: FloatArray
    """Standard deviation of each measurement's noise, rounding included [rpm], shape (N,)."""
    initial_rpm: float
    """Speed before tick 0 [rpm]: the wheel had followed a constant command for long."""
    sample_period_s: float
    """Period of the law's ticks [s]."""
    name: str = "run"
    """Shown in messages: the log file and, for robot logs, the wheel."""
    source: CommandSource | None = None
    """Rebuilds the command for another delay and saturation; None: `command_rpm` is shifted and clipped."""

    def __post_init__(self) -> None:
        for field in ("command_rpm", "sample_tick", "speed_rpm", "sigma_rpm"):
            value = np.asarray(getattr(self, field), float)
            if field == "sigma_rpm" and value.ndim == 0:
                value = np.full(np.shape(self.speed_rpm), float(value))
            if value.ndim != 1 or value.size == 0:
                raise InputError(
                    f"{self.name}: {field} has shape {value.shape}, must be one row of one or more numbers"
                )
            if not np.all(np.isfinite(value)):
                bad = int(np.argmin(np.isfinite(value)))
                raise InputError(
                    f"{self.name}: {field}[{bad}] = {value[bad]}, must be finite; drop missing samples"
                )
            object.__setattr__(self, field, value)
        for field in ("initial_rpm", "sample_period_s"):
            if not np.isfinite(getattr(self, field)):
                raise InputError(f"{self.name}: {field} = {getattr(self, field)}, must be a finite number")
        if self.sample_period_s <= 0.0:
            raise InputError(f"{self.name}: sample_period_s = {self.sample_period_s}, must be above 0")
        if not len(self.sample_tick) == len(self.speed_rpm) == len(self.sigma_rpm):
            raise InputError(
                f"{self.name}: {len(self.sample_tick)} sample_tick, {len(self.speed_rpm)} speed_rpm and "
                f"{len(self.sigma_rpm)} sigma_rpm values, must be equally many"
            )
        if np.min(self.sigma_rpm) <= 0.0:
            raise InputError(f"{self.name}: sigma_rpm = {np.min(self.sigma_rpm)}, must be above 0 everywhere")
        low, high = float(np.min(self.sample_tick)), float(np.max(self.sample_tick))
        if low < 0.0 or high > len(self.command_rpm):
            raise InputError(
                f"{self.name}: samples from tick {low:g} to {high:g}, must lie within the "
                f"{len(self.command_rpm)} ticks that have a command"
            )

    def command(self, delay_s: float = 0.0, saturation_rpm: float = np.inf) -> FloatArray:
        """Return r(0..K-1) [rpm], shape (K,), with a further transport delay and a limit on the command.

        Without a `source` the delay is fractional, the mean of the delayed zero-order hold over each tick,
        and before the run the wheel was commanded its initial speed.

        Raises:
            InputError: the source gave something that is not K finite numbers.
        """
        if self.source is None:
            return shifted_command(
                np.clip(self.command_rpm, -saturation_rpm, saturation_rpm),
                delay_s / self.sample_period_s,
                self.initial_rpm,
            )
        command = np.asarray(self.source(delay_s, saturation_rpm), float)
        if command.shape != self.command_rpm.shape or not np.all(np.isfinite(command)):
            raise InputError(
                f"{self.name}: the command source gave shape {command.shape} for a delay of {delay_s:g} s, "
                f"must be {self.command_rpm.shape} finite numbers"
            )
        return command


def shifted_command(command_rpm: FloatArray, delay_ticks: float, before_rpm: float) -> FloatArray:
    """Return `command_rpm` later by `delay_ticks` >= 0, a real number, with `before_rpm` ahead of it.

    The command is held between ticks, so the mean over a tick of the shifted hold mixes two neighbours.
    """
    if delay_ticks <= 0.0:
        return command_rpm
    whole = int(delay_ticks)
    fraction = delay_ticks - whole
    padded = np.concatenate([np.full(whole + 1, before_rpm), command_rpm])
    n = len(command_rpm)
    return np.asarray((1.0 - fraction) * padded[1 : n + 1] + fraction * padded[:n])


def require_same_period(runs: Sequence[WheelRun]) -> float:
    """Return the law's period [s] that all runs share.

    Raises:
        InputError: no runs at all, or runs on different clocks.
    """
    if not runs:
        raise InputError("no runs to fit; give at least one run with a changing command")
    periods = {run.sample_period_s for run in runs}
    if len(periods) > 1:
        raise InputError(
            f"runs on different clocks (sample_period_s {min(periods):g} to {max(periods):g}); "
            "put all on one law period before fitting"
        )
    return runs[0].sample_period_s


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
