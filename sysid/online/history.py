"""History of an online estimate: coefficients, and metrics of the law that the data do determine.

With commands at 10 Hz, many different triples of poles predict nearly the same speeds, so single coefficients
wander although the behaviour is constant. Rise time and mean lag show the behaviour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.units import FloatArray
from sysid.online.estimator import OnlineEstimator


@dataclass(frozen=True, eq=False)
class History:
    """The estimate at each of N ticks."""

    sample_period_s: float
    speed_rpm: FloatArray
    """Measured speed [rpm], NaN where there was none, shape (N,)."""
    predicted_rpm: FloatArray
    """Speed predicted before the measurement [rpm], shape (N,)."""
    coefficients: FloatArray
    """A-F after the measurement, shape (N, 6)."""
    covariance: FloatArray
    """Covariance of A-F, shape (N, 6, 6)."""
    noise_rpm: FloatArray
    """Usual standard deviation of the innovations [rpm], shape (N,)."""
    forgetting: FloatArray
    """Share of the information forgotten at the tick, shape (N,)."""

    @property
    def time_s(self) -> FloatArray:
        """Time of each tick from the first [s], shape (N,)."""
        return np.asarray(np.arange(len(self.speed_rpm)) * self.sample_period_s, np.float64)

    @property
    def innovation_rpm(self) -> FloatArray:
        """Measured minus predicted [rpm], shape (N,)."""
        return self.speed_rpm - self.predicted_rpm

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of A-F, shape (N, 6)."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))

    def law(self, tick: int) -> WheelLaw:
        """Return the estimate after a tick; negative ticks count from the end."""
        return WheelLaw.from_coefficients(self.coefficients[tick], self.sample_period_s)


@dataclass(frozen=True, eq=False)
class LawMetrics:
    """Metrics of the estimated laws at chosen ticks, each of shape (M,)."""

    tick: npt.NDArray[np.intp]
    rise_time_s: FloatArray
    """Rise time from 10 to 90 % of a step [s]."""
    mean_lag_s: FloatArray
    """Area between a unit command step and its response [s]."""
    mean_lag_error_s: FloatArray
    """Standard error of the mean lag, by the delta method [s]."""
    dominant_pole: FloatArray
    """Magnitude of the largest pole."""
    dc_gain: FloatArray
    """Steady speed over command: 1 by construction."""


def track(
    estimator: OnlineEstimator,
    command_rpm: npt.ArrayLike,
    speed_rpm: npt.ArrayLike,
    progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
) -> History:
    """Pass samples to `estimator` one by one and record its estimates.

    Call its `restart` first if they begin another run. Commands and speeds [rpm], at the ticks, have shape
    (N,); a speed is NaN where none was measured. `progress` wraps the iteration, such as `tqdm`.

    Raises:
        InputError: the two are not rows of equal length, of at least one sample.
    """
    commands, speeds = np.asarray(command_rpm, float), np.asarray(speed_rpm, float)
    if commands.ndim != 1 or commands.shape != speeds.shape or len(speeds) == 0:
        raise InputError(
            f"command_rpm has shape {commands.shape} and speed_rpm {speeds.shape}; must be two rows of equal "
            "length, at least 1"
        )
    ticks: Iterable[int] = range(len(speeds)) if progress is None else progress(range(len(speeds)))
    estimates = [estimator.update(float(commands[k]), float(speeds[k])) for k in ticks]
    return History(
        estimator.law.sample_period_s,
        speeds,
        predicted_rpm=np.array([estimate.predicted_rpm for estimate in estimates]),
        coefficients=np.array([estimate.law.coefficients for estimate in estimates]),
        covariance=np.array([estimate.covariance for estimate in estimates]),
        noise_rpm=np.array([estimate.noise_rpm for estimate in estimates]),
        forgetting=np.array([estimate.forgetting for estimate in estimates]),
    )


def law_metrics(history: History, every: int = 1) -> LawMetrics:
    """Return the metrics at every `every`-th tick and at the last.

    Raises:
        InputError: `every` is below 1.
    """
    if every < 1:
        raise InputError(f"every = {every}, must be at least 1")
    n = len(history.speed_rpm)
    ticks = np.unique(np.append(np.arange(0, n, every), n - 1))
    laws = [history.law(int(tick)) for tick in ticks]
    slopes = [_mean_lag_gradient(law) for law in laws]
    variances = [float(g @ history.covariance[tick] @ g) for tick, g in zip(ticks, slopes, strict=True)]
    return LawMetrics(
        tick=ticks,
        rise_time_s=np.array([law_step_metrics(law).rise_time_s for law in laws]),
        mean_lag_s=np.array([mean_lag_s(law) for law in laws]),
        mean_lag_error_s=np.sqrt(np.maximum(variances, 0.0)),
        dominant_pole=np.array([abs(law.poles[0]) for law in laws]),
        dc_gain=np.array([law.dc_gain for law in laws]),
    )


def mean_lag_s(law: WheelLaw) -> float:
    """Return the area between a unit step of the command and the response to it [s], for unit DC gain.

    It is -dH/dz at z = 1 of H = (D/z + E/z^2 + F/z^3) / (1 - A/z - B/z^2 - C/z^3), the delay as defined by
    W. C. Elmore (J. Appl. Phys. 19 (1948)).
    """
    moments = law.D + 2.0 * law.E + 3.0 * law.F + law.A + 2.0 * law.B + 3.0 * law.C
    return moments / (1.0 - law.A - law.B - law.C) * law.sample_period_s


def _mean_lag_gradient(law: WheelLaw) -> FloatArray:
    """Return d(mean lag)/d(A..F) [s], shape (6,)."""
    rest = 1.0 - law.A - law.B - law.C
    order = np.array([1.0, 2.0, 3.0])
    lag = mean_lag_s(law) / law.sample_period_s
    return np.concatenate([(order + lag) / rest, order / rest]) * law.sample_period_s
