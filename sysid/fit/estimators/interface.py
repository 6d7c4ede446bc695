"""What every estimator takes and returns: runs on the clock of the wheel law, options, and an estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.law.coefficients import COEFFICIENTS, WheelLaw
from mecanum_env.units import FloatArray

CommandSource = Callable[[float, float], npt.ArrayLike]
"""``source(delay_s, saturation_rpm) -> r``: r(0..K-1) [rpm], shape (K,), rebuilt from the log."""

SUCCESS_RATIO: Final = 1.05
"""A start succeeds if its rms is at most this multiple of the best start's rms."""


@dataclass(frozen=True, eq=False)
class WheelRun:
    """One wheel in one run: its command at every tick of the law, and its measured speeds.

    Raises:
        InputError: shapes that disagree, a value that is not finite, a sigma that is not positive or a sample
            outside the run; the message names the run, the field and the place.
    """

    command_rpm: FloatArray
    """Commands r(0..K-1) at the law's ticks [rpm], shape (K,), after latch, rounding and known limits."""
    sample_tick: FloatArray
    """Times of the measured speeds [ticks], 0 to K, whole or fractional, shape (N,)."""
    speed_rpm: FloatArray
    """Measured wheel speed [rpm], shape (N,)."""
    sigma_rpm: FloatArray
    """Standard deviation of each measurement's noise, including rounding [rpm], shape (N,)."""
    initial_rpm: float
    """Steady speed and command before tick 0 [rpm]."""
    sample_period_s: float
    """Period of the law's ticks [s]."""
    name: str = "run"
    """Name for messages: the log file and, for robot logs, the wheel."""
    source: CommandSource | None = None
    """Rebuilds the command for a further delay and saturation; None: `command_rpm` is shifted and clipped."""

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
        """Return r(0..K-1) [rpm], shape (K,), with an additional transport delay and a limit on the command.

        Without a `source` the delay may be a fraction of a tick: each value is the mean of the delayed
        zero-order hold over the tick. Before the run the command was the initial speed.

        Raises:
            InputError: the source returned something other than K finite numbers.
        """
        if delay_s == 0.0 and saturation_rpm == np.inf:
            return self.command_rpm
        if self.source is None:
            limited = np.clip(self.command_rpm, -saturation_rpm, saturation_rpm)
            return shifted_command(limited, delay_s / self.sample_period_s, self.initial_rpm)
        command = np.asarray(self.source(delay_s, saturation_rpm), float)
        if command.shape != self.command_rpm.shape or not np.all(np.isfinite(command)):
            raise InputError(
                f"{self.name}: the command source gave shape {command.shape} for a delay of {delay_s:g} s, "
                f"must be {self.command_rpm.shape} finite numbers"
            )
        return command


def shifted_command(command_rpm: FloatArray, delay_ticks: float, before_rpm: float) -> FloatArray:
    """Return `command_rpm` delayed by `delay_ticks` >= 0, a real number, with `before_rpm` ahead of it.

    The command is held between ticks, so the mean of the shifted hold over a tick mixes two neighbours.
    """
    if delay_ticks <= 0.0:
        return command_rpm
    whole = int(delay_ticks)
    fraction = delay_ticks - whole
    padded = np.concatenate([np.full(whole + 1, before_rpm), command_rpm])
    n = len(command_rpm)
    return np.asarray((1.0 - fraction) * padded[1 : n + 1] + fraction * padded[:n])


@dataclass(frozen=True)
class Options:
    """How to estimate; every method reads what concerns it and ignores the rest.

    Raises:
        InputError: a value out of range.
    """

    starts: int = 10
    """Number of starting points."""
    seed: int = 0
    """Seed of the random starting points."""
    first_starts: Literal["informed", "random"] = "informed"
    """informed: Steiglitz-McBride, then one-step-ahead, then random ones; random: only random ones."""
    initial: tuple[tuple[float, ...], ...] = ()
    """Starting points A-F given by the caller; they replace all others unless empty."""
    unit_gain: bool = True
    """Hold A+B+C+D+E+F = 1, the unit DC gain of a drive with integral action; E is then eliminated."""
    order: Literal["auto", "third"] = "auto"
    """auto: C and F (then B) are 0 if the data are explained as well without them; third: never."""
    fit_delay: bool = False
    """Estimate a pure transport delay of the command."""
    max_delay_s: float = 0.25
    """Longest delay tried [s]."""
    fit_saturation: bool = False
    """Estimate a limit on the command if the speeds show a ceiling."""
    loss: Literal["linear", "huber"] = "linear"
    """linear: least squares; huber: outliers beyond 1.345 sigma count linearly."""
    max_iterations: int = 200
    """Largest number of evaluations per start."""

    def __post_init__(self) -> None:
        require_at_least(1, starts=self.starts, max_iterations=self.max_iterations)
        require_at_least(0, seed=self.seed)
        if not (self.max_delay_s >= 0.0 and math.isfinite(self.max_delay_s)):
            raise InputError(f"max_delay_s = {self.max_delay_s}, must be a finite number of at least 0")
        for row in self.initial:
            if len(row) != 6 or not np.all(np.isfinite(row)):
                raise InputError(f"initial start {row}, must be six finite numbers A-F")

    @property
    def free_coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients that are estimated: all, or all but E with unit gain."""
        return tuple(name for name in COEFFICIENTS if name != "E" or not self.unit_gain)


@dataclass(frozen=True)
class StartResult:
    """Result of the search from one starting point."""

    kind: str
    """steiglitz-mcbride, one-step, random, given, or for `exhaustive` the speed that was fitted."""
    initial: tuple[float, ...]
    """A-F at the start."""
    coefficients: tuple[float, ...]
    """A-F reached; may be unstable or not finite for methods without a guarantee."""
    rms_rpm: float
    """Rms of the free-running error [rpm]; infinite if the law is unstable and diverges."""
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
    """Rms of measured minus predicted speed in free run [rpm]."""
    cost: float
    """Half the sum of squares of (measured - predicted)/sigma: minus the log likelihood, plus a constant."""
    free: tuple[str, ...]
    """Estimated parameters: five or six of A-F, then delay_s and saturation_rpm if fitted."""
    starts: tuple[StartResult, ...]
    seconds: float
    """Time for all starts together, including preparation [s]."""
    delay_s: float = 0.0
    """Transport delay of the command beyond what the runs already contain [s]."""
    saturation_rpm: float = math.inf
    """Limit on the command [rpm]; infinite if no ceiling was seen or looked for."""

    @property
    def success_share(self) -> float:
        """Share of starts that are stable and within 5 % of the smallest rms of a stable start."""
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
