"""Law and effects as far as a search has come, and how they compare: by price, and on held-out runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model, cause_of
from mecanum_env.statistics import VERY_STRONG, rms
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import START_PRICE, SimulationSettings, Simulator
from sysid.compare.search_space import LawWithEffects
from sysid.fit.effects.uncertainty import with_uncertainty
from sysid.logs import Dataset

EVIDENCE: Final = VERY_STRONG
"""Difference of BIC that an effect must gain."""
WORTH: Final = 0.02
"""Least relative decrease of the error on the validation runs for which an effect is added. Assumed; the same
as for a delay or a ceiling (`sysid.fit.drive.choice`)."""
_LINK_DELAY: Final = "command_latency"


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
        """Return the BIC for residuals of a variance of `inflation`, and what each effect must add.

        A delay of the link pays for its parameters only: every fit has estimated one before, as a part of the
        law. Without it a backlash or a slower law imitates it, and errs at speeds that the logs do not have.
        """
        samples = self.fitted.residual.size
        effects = sum(cause_of(name) != _LINK_DELAY for name in self.fitted.candidate.effects.names)
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


def confirmed(worthy: Sequence[Reached], samples: int) -> Reached | None:
    """Return the first set that no other one beats clearly on the validation runs; None if there is none.

    The sets come in the order of their prices, by which one may be first that fits the fit runs only. Clear
    is a difference of `EVIDENCE` in -2 log likelihood, for so many `samples` of the validation runs.
    """
    least = min((one.held_out**2 for one in worthy), default=1.0)
    clear = EVIDENCE * max(1.0, least) / samples
    return next((one for one in worthy if one.held_out**2 <= least + clear), None)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The validation runs, or the fit runs if there are none."""

    whitener: Whitener
    settings: SimulationSettings

    @classmethod
    def of(cls, dataset: Dataset, settings: SimulationSettings | None = None) -> HeldOut:
        """Return those of a dataset, simulated with these `settings`."""
        observations = observe(replace(dataset, runs=dataset.split("validation") or dataset.split("fit")))
        return cls(
            Whitener(observations, measure_noise(dataset, observations), None),
            settings or SimulationSettings(),
        )

    def errors(self, model: Model) -> tuple[float, float]:
        """Return the rms error of a model in sigmas, weighted as in a fit, and that of wheel speeds in rpm.

        Both are over the means of repeats. Samples after a change of command, which may be timed a little
        differently each time, would outweigh all others in rpm. A wheel that starts at an unknown place in a
        gap pays for each such place, as in a fit: it is looked for in these very runs.
        """
        blocks = self.whitener.observations.blocks
        simulator = Simulator(self.whitener.observations, self.settings)
        predicted = simulator.predictions(model)
        parts = [block.value - p for block, p in zip(blocks, predicted, strict=True)]
        wheels = [
            part for block, part in zip(blocks, parts, strict=True) if block.channel.startswith("speed_")
        ]
        whitened = self.whitener.whiten(parts)
        square = float(whitened @ whitened) + START_PRICE * len(simulator.unknown_starts(model))
        return math.sqrt(square / whitened.size), rms(np.concatenate(wheels))

    @property
    def noise_rpm(self) -> float:
        """The rms error of the wheel speed [rpm] that the noise of its sensor alone makes.

        It is of means of repeats, as in `errors`. It is what repeats differ by while a command is held, or
        neighbouring samples, whichever is less: what differs after a change may be how late that acts. Where
        nothing but motion tells it, it counts as 0.
        """
        noise, blocks = self.whitener.noise, self.whitener.observations.blocks

        def of(channel: str) -> float:
            if noise.source[channel] == "motion":
                return 0.0
            return min(noise.settled(channel), noise.scatter.get(channel, math.inf))

        wheels = [block for block in blocks if block.channel.startswith("speed_")]
        return rms(np.concatenate([of(block.channel) / np.sqrt(block.weight) for block in wheels]))
