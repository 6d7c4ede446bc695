"""Repeats that tell what varies from run to run, beside those of the fit with the commands of new logs.

A robot's runs differ by more than the noise of their samples, and along an effect only the difference of two
runs counts, however many samples each has. So every pair of repeats is worth having: the new logs may hold
some, and the logs of the fit may hold other command sequences, which the new logs have not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, is_long, observe
from sysid.compare.model_error.adopted import as_fitted
from sysid.compare.model_error.beside import Beside, contrasts_of, residuals_of
from sysid.compare.model_error.elsewhere import change
from sysid.compare.model_error.run_to_run import Scatter
from sysid.compare.model_error.same_commands import with_same_commands
from sysid.compare.model_error.whitening import Whitener
from sysid.compare.noise import Noise
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.logs import Dataset, Run


@dataclass(frozen=True, eq=False)
class Moved:
    """What an effect changes in new logs, and how to find out what it changes in others."""

    change: FloatArray
    """In the new logs, whitened, (N,)."""
    model: Model
    """With the effect."""
    smooth: bool
    """Whether the planar plant shows it."""


@dataclass(frozen=True, eq=False)
class FurtherRepeats:
    """Repeats of command sequences that the logs of a fit hold and new logs do not."""

    observations: Observations
    """Of one run of each sequence, with the weights of its difference from the mean of all."""
    contrasts: tuple[tuple[FloatArray, ...], ...]
    """Independent differences of repeats, (m,) for each block."""
    simulators: Simulators
    model: Model
    """To which the effects are added."""
    late: tuple[FloatArray, ...] = ()
    """What the unknown delay of each change of command changes, (m, k) for each block."""

    @classmethod
    def of(
        cls, model: Model, fitted_on: Dataset, known: Sequence[Run], settings: SimulationSettings
    ) -> FurtherRepeats | None:
        """Return the repeats in the logs of the fit of a model; None if there are none.

        The runs that are `known` to have the commands of the new logs are left out, and runs so long that a
        study takes pieces of them.

        Raises:
            InputError: the model cannot be simulated.
            SimulationDivergedError: the state stopped being finite.
        """
        rest = [run for run in fitted_on.runs if run not in known and not is_long(run)]
        sequences = list(_sequences(rest, model.wheel.command_period_s))
        if not sequences:
            return None
        logs = observe(replace(fitted_on, runs=tuple(run for each in sequences for run in each)))
        predicted = Simulators.of(logs, settings).smooth(as_fitted(model))
        residuals = {one.run: one for one in residuals_of(fitted_on, logs, predicted)}
        observations = observe(replace(fitted_on, runs=tuple(next(iter(each)) for each in sequences)))
        pairs = []
        for block in observations.blocks:
            (run,) = observations.situations[block.situation].runs
            shifts = next(each for each in sequences if run in each)
            beside = [(residuals[other], shift) for other, shift in shifts.items() if other in residuals]
            found = Beside.of(block, beside, 1)
            if found is not None and len(found.deviations):
                pairs.append(found)
        if not pairs:
            return None
        observations = replace(observations, blocks=tuple(pair.block for pair in pairs))
        simulators = Simulators.of(observations, settings)
        return cls(observations, tuple(contrasts_of(pairs)), simulators, model)

    @property
    def count(self) -> int:
        """Number of independent differences of runs."""
        return sum(
            len({b.situation for b, part in zip(self.observations.blocks, parts, strict=True) if part.any()})
            for parts in self.contrasts
        )

    def scatter(self, noise: Noise, effects: Sequence[Moved]) -> Scatter:
        """Return the contrasts beside what the `effects` change here; 0 where one cannot be simulated."""
        whitener = Whitener(self.observations, noise, None)
        run = np.concatenate(
            [np.full(block.value.size, block.situation) for block in self.observations.blocks]
        )
        return Scatter(
            np.stack([whitener.whiten(parts) for parts in self.contrasts], axis=1),
            np.stack([self._change(whitener, effect) for effect in effects], axis=1),
            run,
            tuple(np.unique(run).tolist()),
            whitener.whiten(self.late) if self.late else np.zeros((whitener.size, 0)),
        )

    def _change(self, whitener: Whitener, effect: Moved) -> FloatArray:
        simulate = self.simulators.smooth if effect.smooth else self.simulators.full.predictions
        return whitener.whiten(change(simulate, effect.model, self.model, self.model))


def _sequences(runs: Sequence[Run], period_s: float) -> Iterator[dict[Run, float]]:
    """Yield the runs that were sent the same commands, each with its shift from the first of them [s]."""
    left = list(runs)
    while left:
        first, *others = left
        same = {first: 0.0, **with_same_commands(first, others, period_s)}
        left = [run for run in others if run not in same]
        if len(same) > 1:
            yield same


def fresh_contrasts(
    model: Model, logs: Dataset, compared: Observations, settings: SimulationSettings
) -> tuple[tuple[FloatArray, ...], ...]:
    """Return independent differences between repeats of new logs, (m,) for each block; none without repeats.

    Args:
        model: to study.
        logs: whatever the new runs were read with.
        compared: the new logs, with the weights of their difference from the logs of the fit.
        settings: of simulations.

    Raises:
        InputError: the model cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    runs = tuple(dict.fromkeys(run for situation in compared.situations for run in situation.runs))
    observed = observe(replace(logs, runs=runs))
    predicted = Simulators.of(observed, settings).smooth(model)
    residuals = {one.run: one for one in residuals_of(logs, observed, predicted)}
    period_s, pairs = model.wheel.command_period_s, []
    for block in compared.blocks:
        run = compared.situations[block.situation].runs[0]
        shifts = {run: 0.0, **with_same_commands(run, [one for one in runs if one is not run], period_s)}
        beside = [(residuals[other], shift) for other, shift in shifts.items() if other in residuals]
        found = Beside.of(block, beside, 1)
        # The deviations have the variance of a single sample, and then that of the difference of both logs.
        pairs.append(found and replace(found, block=block))
    most = max((len(pair.deviations) for pair in pairs if pair), default=0)
    return tuple(
        tuple(
            np.zeros(block.value.size) if pair is None else pair.contrast(number)
            for pair, block in zip(pairs, compared.blocks, strict=True)
        )
        for number in range(most - 1)
    )
