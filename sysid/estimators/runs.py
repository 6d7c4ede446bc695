"""What an estimator is given: one wheel in one run, on the clock of the wheel law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
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
