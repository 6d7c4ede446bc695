"""Recursive estimation of the wheel law, at every sample.

A recursive output-error method: the recursive prediction error method (RPEM) with the free-running law as
the predictor, L. Ljung, "System Identification: Theory for the User" (2nd ed. 1999), sections 11.4-11.5, and
L. Ljung and T. Soderstrom, "Theory and Practice of Recursive Identification" (1983), chapter 3. Least squares
on measured past speeds would be simpler but is biased by measurement noise; a free-running predictor is not.

With theta = (A, B, C, D, F), E = 1 - A - B - C - D - F, and everything relative to r(k-1):

    w(k+1)   = r(k-1) + theta . phi(k)                  the free-running prediction
    phi(k)   = (w(k), w(k-1), w(k-2), r(k), r(k-2)) - r(k-1)
    psi(k+1) = phi(k) + A psi(k) + B psi(k-1) + C psi(k-2)    its gradient dw(k+1)/dtheta
    R        = (1 - g) R + g R0 + psi psi'               information, forgotten towards the prior's R0
    theta   += R^-1 (psi e + g R0 (theta0 - theta))      e: the innovation, clipped

- Stabilised forgetting (R. Kulhavy and M. B. Zarrop, "On a general concept of forgetting", Int. J. Control
  58 (1993)): information decays towards R0, not to zero, so R is never singular. The rate g never exceeds a
  multiple of the information in the sample, psi' R^-1 psi: a constant command contains none, so nothing is
  forgotten and nothing diverges.
- Variable memory (T. R. Fortescue, L. S. Kershenbaum and B. E. Ydstie, Automatica 17 (1981)): g grows with
  the ratio of recent to usual innovation power, so a changed law is learnt within a second or two.
- Projection: every step ends in the region of stable poles (`projection.feasible_step`).
- The predictor's past speeds follow theta, w += psi . step, to first order what the new law would have
  predicted: the extended Kalman filter of a state without process noise (Ljung, IEEE TAC 24 (1979)).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.units import FloatArray
from sysid.online.options import OnlineOptions
from sysid.online.projection import feasible_start, feasible_step, free_parameters, law_of

_STATE_FORMAT: Final = "mecanum-online/1"

_N: Final = 5
_ABSURD_RPM: Final = 1e6
"""Commands and speeds beyond this come from a broken sensor or message and count as missing."""
_FORGETTING_PER_INFORMATION: Final = 2.0
"""Largest g relative to psi' R^-1 psi / 5, which averages g under steady excitation: binds if it is poor."""
_LARGEST_CONDITION: Final = 1e13
"""Ratio of R to the prior up to which samples have full weight, so that double precision can invert R."""
_TO_SIX: Final = np.insert(np.eye(_N), 4, -1.0, axis=0)  # d(A..F)/d(A, B, C, D, F), shape (6, 5)
_MEDIAN_OF_THREE: Final = 0.70346
"""E m^2 for m the median of three |z|, z standard normal: 6 int z^2 G (1 - G) g dz, G and g those of |z|."""
_FASTEST_GROWTH: Final = (25.0, 6.0)
"""Largest power of a sample, as a multiple of the average it enters: recent, usual."""
_SMALLEST_NOISE_RPM: Final = 1e-3


@dataclass
class NoiseTracker:
    """Averages of innovation power over a recent and a usual span [rpm^2].

    Each sample enters as the median of the last three magnitudes. So a single outlier never counts, while a
    changed law, which disturbs several samples in a row, counts from its second sample on. Outliers in up to
    about a tenth of the samples leave both averages near the truth.
    """

    recent_rpm2: float
    usual_rpm2: float
    floor_rpm2: float
    last: float = 0.0
    before_last: float = 0.0

    @staticmethod
    def start(noise_rpm: float, quantum_rpm: float) -> NoiseTracker:
        """Return a tracker that expects `noise_rpm`, and never less than the noise of rounding."""
        floor = max(quantum_rpm / math.sqrt(12.0), _SMALLEST_NOISE_RPM)
        power = max(noise_rpm, floor) ** 2
        return NoiseTracker(power, power, floor**2)

    @property
    def ratio(self) -> float:
        """Recent power over usual power: about 1 while the law fits as well as before."""
        return self.recent_rpm2 / self.usual_rpm2

    def update(self, innovation_rpm: float, recent_samples: float, usual_samples: float) -> None:
        """Add one innovation to the averages over `recent_samples` and `usual_samples`."""
        size = abs(innovation_rpm)
        typical = sorted((size, self.last, self.before_last))[1]
        self.last, self.before_last = size, self.last
        power = typical * typical / _MEDIAN_OF_THREE
        fast, slow = _FASTEST_GROWTH
        self.recent_rpm2 += (min(power, fast * self.recent_rpm2) - self.recent_rpm2) / recent_samples
        self.usual_rpm2 += (min(power, slow * self.usual_rpm2) - self.usual_rpm2) / usual_samples
        self.recent_rpm2 = max(self.recent_rpm2, self.floor_rpm2)
        self.usual_rpm2 = max(self.usual_rpm2, self.floor_rpm2)


@dataclass(frozen=True, eq=False)
class OnlineEstimate:
    """The estimate after a sample."""

    law: WheelLaw
    """Stable, its coefficients summing to 1."""
    predicted_rpm: float
    """Speed predicted for this sample before it was measured [rpm], in free run since the start."""
    innovation_rpm: float
    """Measured minus predicted [rpm]; NaN without a measurement."""
    noise_rpm: float
    """Usual standard deviation of the innovations [rpm]: that of the speed noise once the law fits."""
    forgetting: float
    """Share of the information forgotten at this sample; its inverse is the memory in samples."""
    information: FloatArray
    """Information R about (A, B, C, D, F) in units of the noise variance [rpm^2], shape (5, 5)."""

    @property
    def covariance(self) -> FloatArray:
        """Covariance of A-F, shape (6, 6): noise^2 R^-1.

        With forgetting this is up to twice the effect of noise on a constant law (Ljung 1999, section 11.2),
        which leaves room for drift of the law since the old samples.
        """
        inverse = np.linalg.inv(self.information)
        return np.asarray(self.noise_rpm**2 * _TO_SIX @ inverse @ _TO_SIX.T)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of A-F, shape (6,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


class OnlineEstimator:
    """Recursive estimator of one wheel's law; see the module's docstring for the method.

    Args:
        options: settings.
        initial_law: the law to start from, and to stay near where the data contain no information. `update`
            must be called at its period. An unstable law is made stable first.

    Example::

        estimator = OnlineEstimator(OnlineOptions(), first_order_law(1 / 120))
        for command_rpm, speed_rpm in samples:
            estimate = estimator.update(command_rpm, speed_rpm)
    """

    def __init__(self, options: OnlineOptions, initial_law: WheelLaw) -> None:
        self._options = options
        self._period = initial_law.sample_period_s
        self._initial = feasible_start(free_parameters(initial_law), options)
        self._theta = self._initial.copy()
        self._prior = np.eye(_N) * (options.noise_rpm / options.prior_deviation) ** 2
        self._information = self._prior.copy()
        self._largest_gradient = math.sqrt(_LARGEST_CONDITION * self._prior[0, 0] / options.memory_samples)
        self._noise = NoiseTracker.start(options.noise_rpm, options.quantum_rpm)
        self.restart()

    @property
    def law(self) -> WheelLaw:
        """The present estimate."""
        return law_of(self._theta, self._period)

    def restart(self) -> None:
        """Begin another run of the same wheel: reset the speeds and keep the estimate of its law.

        The wheel is assumed to be in a steady state at the first measured speed.
        """
        self._started = False
        self._speeds = np.zeros(3)  # w(k), w(k-1), w(k-2)
        self._gradients = np.zeros((3, _N))  # psi(k), psi(k-1), psi(k-2)
        self._commands = np.zeros(3)  # r(k), r(k-1), r(k-2)

    def update(self, command_rpm: float, speed_rpm: float) -> OnlineEstimate:
        """Process one sample: the speed [rpm] measured at tick k, and the command [rpm] held from k to k + 1.

        If the speed is not finite, there is no measurement; if the command is not, the previous one is held.
        """
        measured = _usable(speed_rpm)
        if not self._started:
            self._start(speed_rpm if measured else 0.0)
        predicted = float(self._speeds[0])
        innovation, forgetting = math.nan, 0.0
        if measured:
            innovation = float(speed_rpm) - predicted
            forgetting = self._learn(innovation)
        self._advance(float(command_rpm) if _usable(command_rpm) else float(self._commands[0]))
        noise = math.sqrt(self._noise.usual_rpm2)
        return OnlineEstimate(self.law, predicted, innovation, noise, forgetting, self._information)

    def state(self) -> dict[str, Any]:
        """Return the complete state as JSON values; `from_state` makes an equal estimator of it."""
        return {
            "format": _STATE_FORMAT,
            "options": {k: None if math.isinf(v) else v for k, v in asdict(self._options).items()},
            "sample_period_s": self._period,
            "started": self._started,
            "noise": asdict(self._noise),
            **{name: getattr(self, f"_{name}").tolist() for name in _ARRAYS},
        }

    @staticmethod
    def from_state(state: Mapping[str, Any]) -> OnlineEstimator:
        """Return the estimator whose `state` this is.

        Raises:
            InputError: another format, or a value that is missing, misshapen or out of range.
        """
        if state.get("format") != _STATE_FORMAT:
            raise InputError(f'online state: "format" is {state.get("format")!r}, must be "{_STATE_FORMAT}"')
        try:
            options = {k: math.inf if v is None else float(v) for k, v in state["options"].items()}
            arrays = {name: np.array(state[name], float) for name in _ARRAYS}
            noise = NoiseTracker(**{k: float(v) for k, v in state["noise"].items()})
            start = law_of(arrays["initial"], float(state["sample_period_s"]))
            estimator = OnlineEstimator(OnlineOptions(**options), start)
            estimator._started = bool(state["started"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"online state: {error}; use what OnlineEstimator.state() returned") from error
        for name, value in arrays.items():
            if value.shape != getattr(estimator, f"_{name}").shape or not np.all(np.isfinite(value)):
                raise InputError(f"online state: {name} has shape {value.shape} or is not finite")
            setattr(estimator, f"_{name}", value)
        estimator._noise = noise
        return estimator

    def _start(self, speed_rpm: float) -> None:
        self._started = True
        self._speeds[:] = speed_rpm
        self._commands[:] = speed_rpm

    def _learn(self, innovation: float) -> float:
        """Update the estimate with one measurement; return the share of information forgotten."""
        options, noise = self._options, self._noise
        weight = min(1.0, self._largest_gradient / max(float(np.max(np.abs(self._gradients[0]))), 1e-300))
        psi = weight * self._gradients[0]
        noise.update(innovation, options.recent_samples, options.usual_samples)
        limit = options.outlier_deviations * math.sqrt(noise.recent_rpm2)
        clipped = weight * max(-limit, min(limit, innovation))
        shortening = options.memory_samples / options.shortest_memory_samples
        urgency = min(max(1.0, noise.ratio / options.change_ratio), shortening)
        gained = float(psi @ np.linalg.solve(self._information, psi))
        forgetting = urgency * min(
            1.0 / options.memory_samples, _FORGETTING_PER_INFORMATION / _N * max(gained, 0.0)
        )
        kept = (1.0 - forgetting) * self._information + forgetting * self._prior
        information = kept + psi[:, None] * psi[None, :]
        pull = forgetting * (self._prior @ (self._initial - self._theta))
        step = np.linalg.solve(information, psi * clipped + pull)
        self._information = information
        largest = float(np.max(np.abs(step)))
        if largest > options.largest_step:
            step *= options.largest_step / largest
        new = feasible_step(self._theta, step, options)
        self._speeds = self._speeds + self._gradients @ (new - self._theta)
        self._theta = new
        return forgetting

    def _advance(self, command_rpm: float) -> None:
        """Run the law and its gradient to the next tick."""
        limit = self._options.saturation_rpm
        command = max(-limit, min(limit, command_rpm))
        before, before_last = self._commands[0], self._commands[1]
        w0, w1, w2 = self._speeds
        phi = np.array([w0, w1, w2, command, before_last]) - before
        speed = before + phi @ self._theta
        gradient = phi + self._theta[:3] @ self._gradients
        self._speeds = np.array([speed, w0, w1])
        self._gradients = np.array([gradient, self._gradients[0], self._gradients[1]])
        self._commands = np.array([command, before, before_last])


_ARRAYS: Final = ("initial", "theta", "information", "speeds", "gradients", "commands")


def _usable(value: float) -> bool:
    return math.isfinite(value) and abs(value) <= _ABSURD_RPM


def first_order_law(sample_period_s: float, time_constant_s: float = 0.05) -> WheelLaw:
    """Return a plain first-order lag of unit gain: an initial law that assumes little about the drive.

    Raises:
        InputError: a period or time constant that is not above 0.
    """
    for name, value in (("sample_period_s", sample_period_s), ("time_constant_s", time_constant_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name} = {value}, must be above 0")
    pole = math.exp(-sample_period_s / time_constant_s)
    return WheelLaw(pole, 0.0, 0.0, 1.0 - pole, 0.0, 0.0, sample_period_s)
