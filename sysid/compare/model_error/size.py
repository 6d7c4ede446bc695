"""The model's own error: how far it is from the plant it was fitted to, beyond noise.

No law is exact. An error that the logs of the fit show is to be expected in new logs of the same plant and is
not a gap. It is described by two numbers per channel, its size while a command is held and its size after a
change of command, relative to that change:

    e(t)^2 = settled^2 + transient^2 sum_c size_c^2 exp(-2 (t - t_c) / DECAY_S),

the sum over the changes of command c at t_c; size_c [rpm] is the largest change of a wheel's command. (Model
discrepancy beside noise: Kennedy and O'Hagan, J. R. Statist. Soc. B 63:425, 2001.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.optimize import nnls

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import activity_rpm
from sysid.logs import Run

DECAY_S: Final = 0.15
"""Time constant with which the error after a change of command decays [s]."""
FACTORS: Final = (1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)
"""With which an error that was estimated may be multiplied until it explains the logs."""
_ROUNDS: Final = 5  # of iteratively reweighted least squares
_LEAST_CORRELATION_S: Final = 0.01
_MOST_CORRELATION_S: Final = 0.3


@dataclass(frozen=True)
class ChannelError:
    """Error of a model in one channel."""

    settled: float
    """Rms while a command is held, in the channel's unit."""
    transient: float
    """Rms after a change of command, in the channel's unit per rpm of change."""
    correlation_s: float
    """Correlation time of the error [s]."""


@dataclass(frozen=True)
class ModelError:
    """Error of a model in the channels of some logs."""

    channels: Mapping[str, ChannelError]
    data_sha256: str = ""
    """Hash of the logs that it was measured on."""

    def scaled(self, factor: float) -> ModelError:
        """Return the error with its sizes, but not its correlation times, multiplied by a `factor`."""
        channels = {
            name: replace(e, settled=factor * e.settled, transient=factor * e.transient)
            for name, e in self.channels.items()
        }
        return replace(self, channels=channels)


@dataclass(frozen=True)
class Residual:
    """Measured minus predicted in one channel of one run, or of the mean of its repeats."""

    run: Run
    channel: str
    time_s: FloatArray
    """Shape (n,)."""
    value: FloatArray
    """Shape (n,), in the channel's unit."""
    noise_variance: FloatArray
    """Variance of the noise of each value, shape (n,)."""


def estimate_model_error(residuals: Sequence[Residual], data_sha256: str = "") -> ModelError:
    """Estimate a model's error from its residuals on the logs of its fit, whose hash is `data_sha256`."""
    channels = {}
    for name in dict.fromkeys(residual.channel for residual in residuals):
        parts = [residual for residual in residuals if residual.channel == name]
        activity = [activity_rpm(part.run, part.time_s, DECAY_S) for part in parts]
        excess = np.concatenate([part.value**2 - part.noise_variance for part in parts])
        columns = np.stack([np.ones(excess.size), np.concatenate(activity) ** 2], axis=1)
        noise = np.concatenate([part.noise_variance for part in parts])
        settled, transient = np.sqrt(_squares(columns, excess, noise)).tolist()
        channels[name] = ChannelError(settled, transient, _correlation_s(parts))
    return ModelError(channels, data_sha256)


def _squares(columns: FloatArray, excess: FloatArray, noise: FloatArray) -> FloatArray:
    """Return settled^2 and transient^2 by least squares, weighted by the inverse of the expected squares."""
    squares = np.zeros(2)
    for _ in range(_ROUNDS):
        weight = 1.0 / np.maximum(noise + columns @ squares, 1e-300)
        weighted = columns * weight[:, None]
        # Columns of one norm, for the conditioning of the solver.
        scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        squares = nnls(weighted / scale, excess * weight)[0] / scale
    # The square of a normal value of variance v has standard deviation sqrt(2) v: less is not detectable.
    detectable = np.sqrt(2.0 * np.diag(np.linalg.pinv(weighted.T @ weighted)))
    return np.maximum(squares, detectable)


def _correlation_s(parts: Sequence[Residual]) -> float:
    """Return the time [s] in which the residual's autocovariance without noise falls to 1/e."""
    interval = float(np.median(np.concatenate([np.diff(part.time_s) for part in parts])))
    variance = sum(float(np.sum(part.value**2 - part.noise_variance)) for part in parts)
    if variance <= 0.0:
        return _LEAST_CORRELATION_S
    lag = 1
    while lag * interval < _MOST_CORRELATION_S:
        product = sum(float(part.value[lag:] @ part.value[:-lag]) for part in parts if part.value.size > lag)
        if product < variance / math.e:
            break
        lag += 1
    return float(np.clip(lag * interval, _LEAST_CORRELATION_S, _MOST_CORRELATION_S))


def model_error_of(model: Model) -> ModelError | None:
    """Return the error that a model's file states, None if it states none."""
    stated = model.uncertainty.get("model_error")
    if not isinstance(stated, Mapping):
        return None
    channels = {
        name: ChannelError(*(float(values[key]) for key in ("settled", "transient", "correlation_s")))
        for name, values in stated["channels"].items()
    }
    return ModelError(channels, str(stated.get("data_sha256", "")))


def with_model_error(model: Model, error: ModelError) -> Model:
    """Return the `model` with its own `error` among the stated uncertainties."""
    channels = {name: asdict(channel) for name, channel in error.channels.items()}
    stated: dict[str, Any] = {"channels": channels, "data_sha256": error.data_sha256}
    return replace(model, uncertainty={**model.uncertainty, "model_error": stated})
