"""Law and effects as far as a search has come, and how they compare: by price, and on held-out runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.compare.joint import LawWithEffects, joint_covariance
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.prediction import Study
from sysid.compare.simulator import Simulator
from sysid.compare.whitening import Whitener
from sysid.logs import Dataset

EVIDENCE: Final = 10.0
"""Difference of BIC that an effect must gain: "very strong" on the scale of Kass and Raftery (1995)."""
WORTH: Final = 0.02
"""Least relative decrease of the error on the validation runs for which an effect is added. Assumed; the same
as for a delay or a ceiling (`drive_choice`)."""
_NORMAL_90: Final = 1.645


@dataclass(frozen=True, eq=False)
class Reached:
    """Law and effects after a round."""

    base: Model
    fitted: Fitted[LawWithEffects]
    parameter_count: int
    """All parameters that were fitted to these logs, the gain of the starting law included."""
    held_out: float
    """Rms error on the validation runs, in sigmas as the fit weights them."""
    held_out_rpm: float

    @property
    def model(self) -> Model:
        """The base with the law and the effects."""
        return self.fitted.candidate.model(self.base, self.fitted.place)

    @property
    def inflation(self) -> float:
        """Squared residual relative to the noise, at least 1."""
        return max(1.0, self.fitted.cost / self.fitted.residual.size)

    def price(self, inflation: float) -> float:
        """Return the BIC for residuals of a variance of `inflation`, and what each effect must add."""
        samples = self.fitted.residual.size
        effects = len(self.fitted.candidate.effects.names)
        return self.fitted.cost / inflation + self.parameter_count * math.log(samples) + EVIDENCE * effects

    def better_than(self, other: Reached) -> bool:
        """Return whether this is worth its parameters: by BIC, and on the validation runs."""
        samples = self.fitted.residual.size
        gain = (other.fitted.cost - self.fitted.cost) / self.inflation
        price = (self.parameter_count - other.parameter_count) * math.log(samples)
        more = max(1, len(self.model.effects) - len(other.model.effects))
        agrees = self.held_out < (1.0 - WORTH) ** more * other.held_out
        return gain - price > EVIDENCE and agrees

    def stated(self) -> tuple[Model, FloatArray]:
        """Return the model with all that is known of its uncertainty, and the covariance (6, 6) of A-F."""
        return with_uncertainty(self.base, self.fitted, self.inflation)


def with_uncertainty(
    base: Model, fitted: Fitted[LawWithEffects], inflation: float
) -> tuple[Model, FloatArray]:
    """Return the fitted model with the uncertainty of law and effects, and the covariance (6, 6) of A-F.

    `base` is the model that was fitted, and `inflation` the variance of the residual relative to the noise.
    """
    names, covariance = joint_covariance(fitted, base, inflation)
    of_law = covariance[: len(COEFFICIENTS), : len(COEFFICIENTS)]
    stated = {
        "wheel": {
            **base.uncertainty.get("wheel", {}),
            "names": list(COEFFICIENTS),
            "covariance": of_law.tolist(),
        },
        "effects": _intervals(fitted, inflation),
        "joint": {"names": names, "covariance": covariance.tolist()},
    }
    model = fitted.candidate.model(base, fitted.place)
    return replace(model, uncertainty={**base.uncertainty, **stated}), of_law


def _intervals(fitted: Fitted[LawWithEffects], inflation: float) -> dict[str, dict[str, dict[str, float]]]:
    """Return effect -> parameter -> value and 90 % interval, as a model file states them."""
    effects, count = fitted.candidate.effects, fitted.candidate.law.parameter_count
    spread = np.sqrt(np.diag(fitted.covariance(inflation)))[count:] * _NORMAL_90
    place = fitted.place[count:]
    found: dict[str, dict[str, dict[str, float]]] = {}
    for effect, intervals in effects.intervals(place, place - spread, place + spread).items():
        for parameter, ends in intervals.items():
            if all(map(math.isfinite, ends)):
                values = dict(zip(("value", "low", "high"), ends, strict=True))
                found.setdefault(effect, {})[parameter] = values
    return found


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The validation runs, or the fit runs if there are none."""

    whitener: Whitener
    study: Study

    @classmethod
    def of(cls, dataset: Dataset, study: Study | None = None) -> HeldOut:
        """Return those of a dataset, simulated as in a `study`."""
        observations = observe(replace(dataset, runs=dataset.split("validation") or dataset.split("fit")))
        return cls(Whitener(observations, measure_noise(dataset, observations), None), study or Study())

    def errors(self, model: Model) -> tuple[float, float]:
        """Return the rms error of a model in sigmas, weighted as in a fit, and that of wheel speeds in rpm.

        Both are over the means of repeats. Samples after a change of command, which may be timed a little
        differently each time, would outweigh all others in rpm.
        """
        blocks = self.whitener.observations.blocks
        predicted = Simulator(self.whitener.observations, self.study).predictions(model)
        parts = [block.value - p for block, p in zip(blocks, predicted, strict=True)]
        wheels = [
            part for block, part in zip(blocks, parts, strict=True) if block.channel.startswith("speed_")
        ]
        return rms(self.whitener.whiten(parts)), rms(np.concatenate(wheels))
