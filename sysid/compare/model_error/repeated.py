"""New logs that repeat commands of the logs of a model's fit, and what the model errs by in these commands.

Where a robot or a wheel drives the same commands before and after something was changed, the model errs by
the same in both logs. The residual that the logs of the fit show in a command sequence is then taken off in
the new ones, sample by sample, and nothing of the model's own error is left but what differs from run to run:
the study compares two sets of logs, and the model only says what each effect would change. The mean of r
repeats beside that of s repeats in the logs of the fit has the variance sigma^2 (1 / r + 1 / s).

What differs from run to run is told by the repeats in the logs of the fit: one of them beside the mean of the
others is what new logs of an unchanged robot look like (`scatters`). They calibrate the noise, and show how
much of it is that changes of command act at other times (`sysid.compare.noise.timing`), of a robot in all
channels alike (`sysid.compare.model_error.late_changes`). Of a robot they also show which effects every run
has in another size (`sysid.compare.model_error.run_to_run`). Few runs tell that roughly, so that chance gains
more now and then (`luck`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, is_long, observe, pieces
from sysid.compare.model_error.adopted import as_fitted
from sysid.compare.model_error.beside import Beside, contrasts_of, residuals_of, scatters_of
from sysid.compare.model_error.exchange import Place, new_block, places_of
from sysid.compare.model_error.freedom import KNOWN, DifferenceCounts, freedom_of_each
from sysid.compare.model_error.further_repeats import FurtherRepeats, Moved, fresh_contrasts
from sysid.compare.model_error.late_changes import late_changes, settled_noise
from sysid.compare.model_error.run_to_run import Scatter, run_to_run_columns
from sysid.compare.model_error.same_commands import with_same_commands
from sysid.compare.model_error.whitening import Whitener
from sysid.compare.noise import Noise, measure_noise, noise_beside_model
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.logs import Dataset
from sysid.logs.runs import Level

_FEWEST_SHARED: Final = 0.5
"""Least share of the command sequences that must be among those of the fit for these alone to decide.
Assumed."""
_FEWEST_SEQUENCES: Final = 2
"""Least number of command sequences that must be among those of the fit. Assumed: what happened once in one
sequence says nothing of others."""
_MARGIN: Final[Mapping[Level, float]] = {"bench": 1.0, "robot": 2.0}
"""Factor on the variance of what differs from run to run. The repeats of a few sequences of a robot tell it
roughly. Chosen on drawn robots (the quiet rows of python benchmarks/robot_sensitivity.py with seeds 24, 38
and 40): with 1 some logs in which nothing had changed were called a gap."""
_LEAST_FACTOR: Final[Mapping[Level, float]] = {"bench": 0.0, "robot": 1.0}
"""Least factor on the variance that plain repeats show. On a robot, noise that is less than each sample's own
would be an accident of the few sequences. On the bench, the commands of plain repeats are sent at other
times, which a prediction knows."""


@dataclass(frozen=True, eq=False)
class RepeatedCommands:
    """What the logs of a fit show in the very commands of new logs."""

    observations: Observations
    """Of the new logs, with the weights of the difference between both logs."""
    error: tuple[FloatArray, ...]
    """What the model errs by in the logs of the fit: (m,) for each block, in its unit."""
    scatters: tuple[tuple[FloatArray, ...], ...]
    """What each repeat in the logs of the fit differs by from the others, with the variance of the new logs'
    difference: (m,) for each block. Empty without repeats."""
    contrasts: tuple[tuple[FloatArray, ...], ...]
    """The same without what one repeat tells of another: independent differences, zeros where a command
    sequence has fewer repeats."""
    freedom: float
    """Degrees of freedom of the mean squared noise of either of both logs."""
    simulators: Simulators
    """Of the logs of the fit."""
    whitener: Whitener
    """Of the residual in these logs."""
    measured: Noise
    """Noise of these logs without calibration."""
    varying: FloatArray | None = None
    """Whitened columns (N, p) of what varies from run to run, if that was looked for."""
    difference_counts: DifferenceCounts = KNOWN
    """Of the repeats that tell what varies from run to run."""
    late: tuple[FloatArray, ...] = ()
    """What the unknown delay of each change of a robot's command changes, (m, k) for each block; empty
    without such delays."""
    fresh: tuple[tuple[FloatArray, ...], ...] = ()
    """Independent differences between repeats of a robot's new logs, (m,) for each block."""
    further: FurtherRepeats | None = None
    """Repeats of other commands in the logs of a robot's fit."""
    places: tuple[Place, ...] = ()
    """Of each block, where runs on the bench may be exchanged with those of the fit."""

    @property
    def noise(self) -> Noise:
        """Noise of the logs of the fit, from repeats if there are any."""
        return self.whitener.noise

    def luck(self, rng: np.random.Generator, draws: int, count: float) -> FloatArray:
        """Return factors (draws,) on what chance gains, since the noise is known from few differences.

        Along one effect the variance is that of the differences of so many runs (`count`), however many
        samples a run has: with n of them it is too small by a chi-squared value over n. What the noise is
        larger by anyway (`_MARGIN`) is taken off.
        """
        if not math.isfinite(count):
            return np.ones(draws)
        known = count / rng.chisquare(count, draws)
        return np.asarray(np.maximum(1.0, known / _MARGIN["robot"]))

    def expected_error(
        self, whitener: Whitener, _simulators: Simulators, _at: Model | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the model errs by in the new logs, (N,), and columns for what varies, (N, p).

        Both are whitened. Nothing is simulated for it, and it does not matter where a model moves the robot.
        """
        late = self._late(whitener)
        unknown = late if self.varying is None else np.concatenate([late, self.varying], axis=1)
        return whitener.whiten(self.error), unknown

    def _late(self, whitener: Whitener) -> FloatArray:
        return whitener.whiten(self.late) if self.late else np.zeros((whitener.size, 0))

    def of_unchanged(self, whitener: Whitener) -> FloatArray:
        """Return whitened residuals of logs in which nothing changed, one for each repeat: (N, repeats)."""
        return _whitened(whitener, self.scatters)

    def unchanged(self, model: Model, simulators: Simulators) -> RepeatedCommands | None:
        """Return what makes the scatter the residual of a model: new logs in which nothing changed.

        `simulators` are of the new logs. None without repeats.
        """
        if not self.scatters:
            return None
        predicted = simulators.averaged.predictions(model)
        parts = zip(self.observations.blocks, predicted, self.scatters[0], strict=True)
        return replace(self, error=tuple(block.value - p - scatter for block, p, scatter in parts))

    def with_varying(self, whitener: Whitener, effects: Sequence[Moved]) -> RepeatedCommands:
        """Return the same, with what the scatter shows to vary from run to run along some `effects`.

        The noise is not lowered by what varies.
        """
        if not self.scatters or not effects:
            return self
        level = self.observations.situations[0].runs[0].level
        blocks, groups = self.observations.blocks, [s.group for s in self.observations.situations]
        # All runs of a sequence are beside the same scatter.
        asked = {groups[block.situation]: block.situation for block in blocks}
        # One repeat of each sequence tells the noise of a robot, the more so with its margin.
        differences = self.contrasts if level == "bench" else (*self.scatters[:1], *self.fresh)
        scatter = Scatter(
            _whitened(whitener, differences),
            np.stack([effect.change for effect in effects], axis=1),
            np.concatenate([np.full(block.value.size, block.situation) for block in blocks]),
            tuple(asked.values()),
            self._late(whitener),
        )
        if self.further is not None:
            scatter = scatter.beside(self.further.scatter(self.noise, effects))
        scatter = replace(scatter, differences=math.sqrt(_MARGIN[level]) * scatter.differences)
        varying = run_to_run_columns(scatter)[: whitener.size]
        return replace(self, varying=varying[:, np.any(varying != 0.0, axis=0)])


def _whitened(whitener: Whitener, logs: Sequence[Sequence[FloatArray]]) -> FloatArray:
    """Return some logs, each with (m,) for each block, as whitened columns (N, logs)."""
    found = [whitener.whiten(parts) for parts in logs]
    return np.stack(found, axis=1) if found else np.zeros((whitener.size, 0))


def repeated_commands(
    model: Model,
    fitted_on: Dataset,
    observations: Observations,
    settings: SimulationSettings,
) -> RepeatedCommands | None:
    """Return what the logs of a fit show in the commands of new logs.

    It is None where fewer than half of the command sequences are among those of the fit, and on the bench
    where these were not repeated; else the sequences that are among them decide alone.

    Args:
        model: that was fitted; of what came later nothing is looked at.
        fitted_on: the logs of its fit.
        observations: of the new logs.
        settings: of simulations.

    Raises:
        InputError: the model cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    first = [situation.runs[0] for situation in observations.situations]
    period_s = model.wheel.command_period_s
    # Runs of a study are cut, too, where all of them are too long. A piece is the same for all new runs.
    cut = [piece for run in fitted_on.runs if is_long(run) for piece in pieces(run, period_s)]
    partners = [with_same_commands(run, (*fitted_on.runs, *cut), period_s) for run in first]
    groups = [situation.group for situation in observations.situations]
    shared = [index for index, runs in enumerate(partners) if runs]
    known = {groups[index] for index in shared}
    if len(known) < max(_FEWEST_SEQUENCES, _FEWEST_SHARED * len(set(groups))):
        return None
    # In the order of the new logs, so that the same wheel angles are simulated for both.
    runs = tuple(dict.fromkeys(run for index in shared for run in partners[index]))
    before = observe(replace(fitted_on, runs=runs))
    simulators = Simulators.of(before, settings)
    predicted = simulators.averaged.predictions(as_fitted(model))
    residuals = list(residuals_of(fitted_on, before, predicted))
    pairs, new = [], []
    level = first[0].level
    simulated = Simulators.of(observations, settings).averaged if level == "bench" else None
    answers = [] if simulated is None else simulated.predictions(as_fitted(model))
    for number, block in enumerate(observations.blocks):
        shifts = partners[block.situation]
        beside = [(one, shifts[one.run]) for one in residuals if one.run in shifts]
        found = Beside.of(block, beside, groups.count(groups[block.situation]))
        if found is not None:
            pairs.append(found)
            if answers:
                new.append(new_block(observations, block, answers[number], beside))
    observations = replace(observations, blocks=tuple(pair.block for pair in pairs))
    noise, freedom = measure_noise(fitted_on, before), freedom_of_each(())
    measured = noise
    scatters = scatters_of(pairs)
    late: tuple[FloatArray, ...] = ()
    fresh: tuple[tuple[FloatArray, ...], ...] = ()
    further: FurtherRepeats | None = None
    if scatters:
        noise = noise_beside_model(noise, [pair.noted(observations) for pair in pairs])
        noise, freedom = _calibrated(noise, observations, scatters, level)
        if level == "robot":
            fresh = fresh_contrasts(model, fitted_on, observations, settings)
            further = FurtherRepeats.of(model, fitted_on, runs, settings)
        if level == "robot" and noise.timing:
            if further is not None:
                further = replace(further, late=late_changes(further.observations, noise))
            late, noise = late_changes(observations, noise), settled_noise(noise)
    elif level == "bench":
        # Nothing else tells by how much two answers of a wheel to one command differ after its changes.
        return None
    counts = KNOWN
    if scatters and level == "robot":
        counts = _counts(observations, pairs, fresh, further)
    return RepeatedCommands(
        observations,
        tuple(pair.error for pair in pairs),
        tuple(scatters),
        tuple(contrasts_of(pairs)) if scatters else (),
        freedom * len(known),
        simulators,
        Whitener(before, noise, None),
        measured,
        difference_counts=counts,
        late=late,
        fresh=fresh,
        further=further,
        places=places_of(observations, new) if scatters else (),
    )


def _counts(
    observations: Observations,
    pairs: Sequence[Beside],
    fresh: Sequence[Sequence[FloatArray]],
    further: FurtherRepeats | None,
) -> DifferenceCounts:
    """Return how many independent differences of repeats there are."""
    groups = [observations.situations[block.situation].group for block in observations.blocks]
    most: dict[str, int] = {}
    for pair, group in zip(pairs, groups, strict=True):
        most[group] = max(most.get(group, 0), len(pair.deviations) - 1)
    new = [{group for part, group in zip(parts, groups, strict=True) if np.any(part)} for parts in fresh]
    shared = float(sum(most.values()))
    others = sum(map(len, new)) + (0 if further is None else further.count)
    return DifferenceCounts(shared + others, shared)


def _calibrated(
    noise: Noise,
    observations: Observations,
    scatters: Sequence[Sequence[FloatArray]],
    level: Level,
) -> tuple[Noise, float]:
    """Return the noise with which the scatter is as large as is expected, on a robot with a margin.

    `scatters` are those of each repeat, (m,) for each block. The second value are the degrees of freedom that
    each command sequence adds.
    """
    whitener = Whitener(observations, noise, None)
    square = np.mean([whitener.whiten(scatter) ** 2 for scatter in scatters], axis=0)
    squares: dict[str, list[float]] = {}
    sequences: dict[str, list[float]] = {}
    for block, rows in zip(observations.blocks, whitener.slices, strict=True):
        squares.setdefault(block.channel, []).extend(square[rows])
    factors = {
        name: _MARGIN[level] * max(_LEAST_FACTOR[level], float(np.mean(values)))
        for name, values in squares.items()
    }
    for block, rows in zip(observations.blocks, whitener.slices, strict=True):
        group = observations.situations[block.situation].group
        sequences.setdefault(group, []).append(float(np.mean(square[rows])) / factors[block.channel])
    means = [float(np.mean(values)) for values in sequences.values()]
    return noise.scaled({name: math.sqrt(f) for name, f in factors.items()}), freedom_of_each(means)
