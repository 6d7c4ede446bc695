"""How likely each delay of each single change of a command is, under a model, from bench logs.

A model predicts the logs with every change at its delay. The likelihood of another delay of one change
follows without another simulation: the model's response to a step of that size, from the speed held before,
is moved. A law alone would do for small steps; a limit of the acceleration makes large ones rise otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import sensors_of, without_sensors
from mecanum_env.model import Model
from mecanum_env.simulator.bench import bench_motions
from mecanum_env.simulator.free_wheel import BenchRun
from mecanum_env.statistics import MEDIAN_OF_NORMAL
from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, LONGEST_S, SPEED, Change, means_over_ticks
from sysid.compare.links.common_delay import TAIL
from sysid.compare.measured import start_of
from sysid.logs import Run

_AFTER_S: Final = 0.6
"""Time beyond the longest delay that a change's samples are compared for [s]: a drive's response is over."""
_SETTLED_S: Final = 1.0
"""Time for which the command before a change is held before its response is simulated [s]."""
_FEW_SAMPLES: Final = 5  # a change seen in fewer samples tells nothing


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """Logarithms of likelihoods of the changes."""

    at_delay: FloatArray
    """Of each change (rows) at each delay of the grid."""
    lost: FloatArray
    """Of each change never acting."""
    noise_rpm: float
    """Usual size of an error at the best delays [rpm]."""


class SeenChanges:
    """The samples of bench `runs` that show their `changes`, and what a `model` says of them.

    The model has no delay, takes commands at the ticks of its law, and does not round them: a command that
    arrives within a tick is simulated as its mean over the tick. At the next tick it would act late.
    """

    def __init__(self, model: Model, runs: Sequence[Run], changes: Sequence[Change]) -> None:
        """Take what is known."""
        self._model, self._runs, self._changes = model, runs, changes
        self._responses = _responses(model, changes)
        self._windows = _windows(runs, changes)

    def likelihoods(self, delay_s: FloatArray, lost: npt.NDArray[np.bool_]) -> Likelihoods:
        """Return how likely each delay of each change is, the others at `delay_s` [s] or `lost`, (n,)."""
        predicted, rests = self._predicted(delay_s, lost), []
        for i, (window, change) in enumerate(zip(self._windows, self._changes, strict=True)):
            speed, response = np.interp(window.time_s, *predicted[change.run]), self._responses[i]
            since = window.time_s - change.given_s
            # Without this change; then with it at any delay.
            bare = speed - (0.0 if lost[i] else response.at(since - delay_s[i]))
            moved = response.at(since[:, None] - GRID_S[None, :])
            rests.append(
                window.value[:, None] - bare[:, None] - np.column_stack([moved, np.zeros(since.size)])
            )
        scale, share, noise = _scale(rests)
        table = [_log_likelihood(rest / scale) * share for rest in rests]
        together = np.array(table).reshape(-1, GRID_S.size + 1)
        return Likelihoods(together[:, :-1], together[:, -1], noise)

    def unsure(self, weights: FloatArray, noise_rpm: float) -> tuple[FloatArray, ...]:
        """Return what unsure delays make of each row's speed in each run, in variances of the noise.

        `weights` has the probability of each delay of the grid (columns) for each change (rows), and the
        noise has a size of `noise_rpm` [rpm].
        """
        found = [np.zeros(run.time_s.size) for run in self._runs]
        for change, response, weight in zip(self._changes, self._responses, weights, strict=True):
            time = self._runs[change.run].time_s - change.given_s
            rows = np.flatnonzero((time >= 0.0) & (time < LONGEST_S + _AFTER_S))
            speed = response.at(time[rows][:, None] - GRID_S[None, :]) / noise_rpm
            mean = speed @ weight
            found[change.run][rows] += np.maximum(speed**2 @ weight - mean**2, 0.0)
        return tuple(found)

    def _predicted(
        self, delay_s: FloatArray, lost: npt.NDArray[np.bool_]
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Return for each run a clock [s] and the speed [rpm] on it, with each change at its delay."""
        commands, changes, tick_s = [], self._changes, self._model.wheel.law.sample_period_s
        for index, run in enumerate(self._runs):
            own = [i for i, change in enumerate(changes) if change.run == index]
            initial = start_of(run).initial_rpm
            first = changes[own[0]].before_rpm if own else float(run.command.wheels_rpm[0, 0])
            acting = [i for i in own if not lost[i]]
            times = np.maximum.accumulate([0.0, *(changes[i].given_s + delay_s[i] for i in acting)])
            levels = np.array([first, *(changes[i].after_rpm for i in acting)])
            times, levels = means_over_ticks(times[1:], levels, tick_s, run.duration_s)
            commands.append(BenchRun(times, levels, run.duration_s, initial))
        return _seen_motions(self._model, commands)


@dataclass(frozen=True, eq=False)
class _Window:
    """The samples that show a change."""

    time_s: FloatArray
    value: FloatArray


def _windows(runs: Sequence[Run], changes: Sequence[Change]) -> list[_Window]:
    found = []
    for index, change in enumerate(changes):
        run = runs[change.run]
        end = change.given_s + LONGEST_S + _AFTER_S
        after = changes[index + 1] if index + 1 < len(changes) else None
        if after is not None and after.run == change.run:
            end = min(end, after.given_s)
        rows = run.finite(SPEED) & (run.time_s >= change.given_s) & (run.time_s < end)
        found.append(_Window(run.time_s[rows], run.channels[SPEED][rows]))
    return found


@dataclass(frozen=True, eq=False)
class _Response:
    """What a change of the command does to a model's speed."""

    since_s: FloatArray
    """Times since the change acts [s]."""
    speed_rpm: FloatArray
    """Change of the speed [rpm]."""

    def at(self, since_s: FloatArray) -> FloatArray:
        """Return the change of the speed [rpm] at times since it acts [s], of any shape."""
        return np.interp(since_s, self.since_s, self.speed_rpm, left=0.0)


def _responses(model: Model, changes: Sequence[Change]) -> list[_Response]:
    """Return the response of a model to each change, from the speed at which the command before holds it."""
    if not changes:
        return []
    steps = [(change.before_rpm, change.after_rpm) for change in changes]
    different = list(dict.fromkeys(steps))
    # On the clock of arrivals, so that the response is not late by a part of its period.
    settled_s = math.ceil(_SETTLED_S / model.wheel.command_period_s) * model.wheel.command_period_s
    duration_s, at = settled_s + LONGEST_S + 2.0 * _AFTER_S, np.array([0.0, settled_s])
    # A slow pole may not have settled: its drift is there without the change, too.
    both = [levels for before, after in different for levels in ((before, after), (before, before))]
    runs = [BenchRun(at, np.array(levels), duration_s, initial_rpm=levels[0]) for levels in both]
    motions = _seen_motions(model, runs)
    found = {}
    for step, (clock_s, changed), (_, held) in zip(different, motions[::2], motions[1::2], strict=True):
        start = int(np.searchsorted(clock_s, settled_s - 1e-9))
        found[step] = _Response(clock_s[start:] - settled_s, (changed - held)[start:])
    return [found[step] for step in steps]


def _seen_motions(model: Model, runs: Sequence[BenchRun]) -> list[tuple[FloatArray, FloatArray]]:
    """Return clocks [s] and speeds [rpm] on them as the sensors of the model show them, which may be late."""
    read = sensors_of(model)
    motions = bench_motions([without_sensors(model)], runs)[0]
    return [(clock, read(clock, {SPEED: speed})[SPEED]) for clock, speed in motions]


def _log_likelihood(scaled: FloatArray) -> FloatArray:
    """Return the logarithm of the likelihood of errors (m, p) in standard deviations, shape (p,)."""
    if len(scaled) < _FEW_SAMPLES:
        return np.zeros(scaled.shape[1])
    return np.asarray(-0.5 * (TAIL + 1.0) * np.log1p(scaled**2 / TAIL).sum(axis=0))


def _scale(rests: Sequence[FloatArray]) -> tuple[float, float, float]:
    """Return the rms error [rpm] at the best delays, the errors' independent share, and their usual size."""
    best = [rest[:, int(np.argmin(np.abs(rest).sum(axis=0)))] for rest in rests if len(rest) >= _FEW_SAMPLES]
    if not best:
        return 1.0, 1.0, 1.0
    errors = np.concatenate(best)
    scale = max(float(np.sqrt(np.mean(np.clip(errors, *np.quantile(errors, (0.02, 0.98))) ** 2))), 1e-6)
    clipped = [np.clip(one, -3.0 * scale, 3.0 * scale) for one in best]
    along = sum(float(one[1:] @ one[:-1]) for one in clipped)
    rho = float(np.clip(along / max(sum(float(one @ one) for one in clipped), 1e-12), 0.0, 0.9))
    usual = max(float(np.median(np.abs(errors))) / MEDIAN_OF_NORMAL, 0.1 * scale)
    return scale, (1.0 - rho) / (1.0 + rho), usual
