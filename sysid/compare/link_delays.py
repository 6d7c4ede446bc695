"""When each change of a command acted, from bench logs: a link's delays as latent values.

The delay of change i is d(i) = m + s e(i), with the link's common delay m, its spread s and e(i) of Student's
t, which allows for a change that is very late. A model predicts the logs with every change at its delay; the
likelihood of another delay of one change follows without another simulation, since the law is linear: the
change's step response is moved. Delays and prediction are improved in turns. The common delay and the spread
maximise the likelihood of the logs with the delays integrated out (empirical Bayes; Robbins, Proc. 3rd
Berkeley Symp. 1:157, 1956), and each delay is then the mean of its posterior.

Delays that go with the size or the direction of a change are no jitter: a limit, friction or play delays
large or small changes more. A spread therefore counts only if it remains beside them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.law.drive import shaped_command
from mecanum_env.model import Model
from mecanum_env.simulator.bench import BenchRun, bench_motions
from mecanum_env.units import FloatArray
from sysid.compare.prediction import start_of
from sysid.compare.samples import COMMAND_STEP_RPM
from sysid.logs import Run

LONGEST_S: Final = 0.5
"""Longest delay that is looked for [s]."""
_STEP_S: Final = 0.002  # of the grid of delays
_AFTER_S: Final = 0.6
"""Time beyond the longest delay that a change's samples are compared for [s]: a drive's response is over."""
_ROUNDS: Final = 3
_TAIL: Final = 4.0
"""Degrees of freedom of Student's t as which errors are counted: a few outliers decide nothing. Assumed."""
_SPREADS_S: Final = (0.0, *np.geomspace(0.001, 0.2, 24).tolist())
_FEWEST: Final = 6  # changes that show a spread
_LEAST_SPREAD: Final = 0.25
"""Least spread in sampling intervals: stamps and latches alone make about that. Assumed."""
_EVIDENCE: Final = 10.0  # twice the logarithm of a likelihood ratio: "very strong" (Kass and Raftery, 1995)
_LOST: Final = 8.0  # logarithm of a likelihood ratio from which a change counts as lost
_FEW_SAMPLES: Final = 5  # a change seen in fewer samples tells nothing
GRID_S: Final = np.arange(0.0, LONGEST_S + 0.5 * _STEP_S, _STEP_S)


@dataclass(frozen=True)
class Change:
    """A change of the command in one of the runs."""

    run: int
    """Index of the run."""
    given_s: float
    """When the command was given, from the start of the run [s]."""
    before_rpm: float
    after_rpm: float


@dataclass(frozen=True, eq=False)
class LinkDelays:
    """The delays of all changes of the command in some runs; arrays have shape (n,)."""

    changes: tuple[Change, ...]
    delay_s: FloatArray
    """Of each change [s]."""
    error_s: FloatArray
    """Its standard deviation, given the logs [s]."""
    lost: npt.NDArray[np.bool_]
    """Which changes never acted before the next one."""
    unsure: tuple[FloatArray, ...]
    """For each run and row the variance of the speed that unsure delays cause, in variances of the noise."""
    mean_s: float
    """Common delay [s]."""
    spread_s: float
    """Standard deviation of the delays [s]."""
    evidence: float
    """Twice the logarithm of the likelihood with the spread over that without, less the price of a parameter;
    the smaller one of delays as they are and beside what goes with size and direction."""
    likelihood: FloatArray
    """Logarithm of the likelihood of each change (rows) at each delay of `GRID_S`."""
    lost_likelihood: FloatArray
    """Logarithm of the likelihood of each change never acting."""
    untrended: FloatArray
    """As `likelihood`, with the delays' dependence on size and direction of the changes taken off."""

    @property
    def jitters(self) -> bool:
        """Whether delays differ by more than they are uncertain."""
        return self.evidence > _EVIDENCE

    @property
    def loss(self) -> float:
        """Share of the changes that never acted."""
        return float(np.mean(self.lost)) if self.lost.size else 0.0


def changes_of(runs: Sequence[Run], clock_s: float | None) -> tuple[Change, ...]:
    """Return the changes of the command in bench runs.

    A first command other than the wheel's speed is a change, too. Commands are given as stamped or, where the
    drive looks for them every `clock_s` [s], as by `Run.held_since`.
    """
    found = []
    for index, run in enumerate(runs):
        rows, level = run.command_rows(), start_of(run).initial_rpm
        since = run.time_s if clock_s is None else run.held_since(clock_s)
        for row in rows:
            value = float(run.command.wheels_rpm[row, 0])
            if row == 0 and level != 0.0:
                # A wheel that is running already follows its first command.
                level = value
            if abs(value - level) > COMMAND_STEP_RPM:
                found.append(Change(index, float(since[row]), level, value))
                level = value
    return tuple(found)


def link_delays(model: Model, runs: Sequence[Run], clock_s: float | None, resolution_s: float) -> LinkDelays:
    """Estimate the delay of each change of the command in bench `runs`.

    The `model` has no delay. `clock_s` is as for `changes_of`, and arrivals are simulated on a grid of
    `resolution_s` [s].
    """
    changes = changes_of(runs, clock_s)
    fine = replace(model, wheel=replace(model.wheel, command_period_s=resolution_s))
    steps = _steps_rpm(fine, changes)
    windows = _windows(runs, changes)
    delays, lost = np.zeros(len(changes)), np.zeros(len(changes), bool)
    table = _Table(np.zeros((len(changes), GRID_S.size)), np.zeros(len(changes)), 1.0)
    for turn in range(_ROUNDS):
        predicted = _predicted(fine, runs, changes, delays, lost)
        table = _table(fine, windows, predicted, changes, steps, delays, lost)
        if turn == 0:
            # All changes are late by the common delay first: their own would follow what others leave.
            delays = np.full(len(changes), GRID_S[int(np.argmax(table.likelihood.sum(axis=0)))])
            continue
        mean, spread = _common(table.likelihood)
        delays, _ = _posterior(table.likelihood, mean, spread)
        lost = table.lost > np.max(table.likelihood, axis=1) + _LOST
    seen = table.likelihood[~lost]
    mean, spread = _common(seen)
    delays, errors = _posterior(table.likelihood, mean, spread)
    unsure = _unsure(fine, runs, changes, steps, _weights(table.likelihood, mean, spread), table.noise_rpm)
    acting = [change for change, gone in zip(changes, lost, strict=True) if not gone]
    untrended = _without_trend(seen, acting)
    whole = table.likelihood.copy()
    whole[~lost] = untrended
    evidence = min(_evidence(seen), _evidence(untrended))
    if min(spread, _common(untrended)[1]) < _LEAST_SPREAD * float(
        np.median([run.median_interval_s for run in runs])
    ):
        evidence = min(evidence, 0.0)
    likelihoods = table.likelihood, table.lost, whole
    return LinkDelays(changes, delays, errors, lost, unsure, mean, spread, evidence, *likelihoods)


@dataclass(frozen=True, eq=False)
class _Table:
    """Logarithms of likelihoods."""

    likelihood: FloatArray
    """Of each change (rows) at each delay of the grid."""
    lost: FloatArray
    """Of each change never acting."""
    noise_rpm: float
    """Usual size of an error at the best delays [rpm]."""


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
        rows = run.finite("speed_rpm") & (run.time_s >= change.given_s) & (run.time_s < end)
        found.append(_Window(run.time_s[rows], run.channels["speed_rpm"][rows]))
    return found


def _steps_rpm(model: Model, changes: Sequence[Change]) -> FloatArray:
    """Return by how much each change moves a settled wheel [rpm], friction left aside, shape (n,)."""
    drive, gain = drive_parameters(model), model.wheel.law.dc_gain
    ends = np.array([(change.before_rpm, change.after_rpm) for change in changes]).reshape(-1, 2)
    reached = np.asarray(shaped_command(drive, ends, 0.0), float)
    return np.asarray(gain * (reached[:, 1] - reached[:, 0]))


def _predicted(
    model: Model,
    runs: Sequence[Run],
    changes: Sequence[Change],
    delays: FloatArray,
    lost: npt.NDArray[np.bool_],
) -> list[tuple[FloatArray, FloatArray]]:
    """Return for each run a clock [s] and the speed [rpm] on it, with each change at its delay."""
    commands = []
    for index, run in enumerate(runs):
        own = [i for i, change in enumerate(changes) if change.run == index]
        initial = start_of(run).initial_rpm
        first = changes[own[0]].before_rpm if own else float(run.command.wheels_rpm[0, 0])
        acting = [i for i in own if not lost[i]]
        times = np.maximum.accumulate([0.0, *(changes[i].given_s + delays[i] for i in acting)])
        levels = np.array([first, *(changes[i].after_rpm for i in acting)])
        keep = np.append(np.diff(times) > 0.0, True)
        commands.append(BenchRun(times[keep], levels[keep], run.duration_s, initial))
    return bench_motions([model], commands)[0]


def _table(
    model: Model,
    windows: Sequence[_Window],
    predicted: Sequence[tuple[FloatArray, FloatArray]],
    changes: Sequence[Change],
    steps: FloatArray,
    delays: FloatArray,
    lost: npt.NDArray[np.bool_],
) -> _Table:
    response = _Response(model)
    rests = []
    for i, (window, change) in enumerate(zip(windows, changes, strict=True)):
        speed = np.interp(window.time_s, *predicted[change.run])
        since = window.time_s - change.given_s
        # Without this change; then with it at any delay.
        bare = speed - (0.0 if lost[i] else steps[i]) * response.at(since - delays[i])
        moved = steps[i] * response.at(since[:, None] - GRID_S[None, :])
        rests.append(window.value[:, None] - bare[:, None] - np.column_stack([moved, np.zeros(since.size)]))
    scale, share, noise = _scale(rests)
    table = np.array([_log_likelihood(rest / scale) * share for rest in rests]).reshape(-1, GRID_S.size + 1)
    return _Table(table[:, :-1], table[:, -1], noise)


def _unsure(
    model: Model,
    runs: Sequence[Run],
    changes: Sequence[Change],
    steps: FloatArray,
    weights: FloatArray,
    noise_rpm: float,
) -> tuple[FloatArray, ...]:
    """Return what unsure delays, of probability `weights` on the grid, make of each row's speed."""
    response, found = _Response(model), [np.zeros(run.time_s.size) for run in runs]
    for change, step, weight in zip(changes, steps.tolist(), weights, strict=True):
        time = runs[change.run].time_s - change.given_s
        rows = np.flatnonzero((time >= 0.0) & (time < LONGEST_S + _AFTER_S))
        speed = step / noise_rpm * response.at(time[rows][:, None] - GRID_S[None, :])
        mean = speed @ weight
        found[change.run][rows] += np.maximum(speed**2 @ weight - mean**2, 0.0)
    return tuple(found)


class _Response:
    """The response of a model's law to a step of 1 rpm, and of gain 1."""

    def __init__(self, model: Model) -> None:
        run = BenchRun(np.zeros(1), np.ones(1), LONGEST_S + 2.0 * _AFTER_S)
        self._clock, self._speed = bench_motions([_unit(model)], [run])[0][0]

    def at(self, since_s: FloatArray) -> FloatArray:
        """Return the response [rpm] at times since the step [s], of any shape."""
        return np.interp(since_s, self._clock, self._speed, left=0.0)


def _unit(model: Model) -> Model:
    """Return the model's law alone, without what limits or changes a command of 1 rpm."""
    wheel = replace(model.wheel, command_quantum_rpm=0.0, saturation_rpm=math.inf)
    law = wheel.law
    gain = law.dc_gain
    law = replace(law, D=law.D / gain, E=law.E / gain, F=law.F / gain)
    return Model(replace(wheel, law=law), model.robot)


def _log_likelihood(scaled: FloatArray) -> FloatArray:
    """Return the logarithm of the likelihood of errors (m, p) in standard deviations, shape (p,)."""
    if len(scaled) < _FEW_SAMPLES:
        return np.zeros(scaled.shape[1])
    return np.asarray(-0.5 * (_TAIL + 1.0) * np.log1p(scaled**2 / _TAIL).sum(axis=0))


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
    usual = max(float(np.median(np.abs(errors))) / 0.6745, 0.1 * scale)
    return scale, (1.0 - rho) / (1.0 + rho), usual


def _prior(spread_s: float) -> FloatArray:
    """Return the probability of each delay of the grid (columns) for each common delay (rows)."""
    if spread_s == 0.0:
        return np.eye(GRID_S.size)
    # Student's t, so that one change that is very late does not make the spread of all.
    square = ((GRID_S[:, None] - GRID_S[None, :]) / max(spread_s, 0.5 * _STEP_S)) ** 2
    weight = (1.0 + square / _TAIL) ** (-0.5 * (_TAIL + 1.0))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def _marginal(likelihood: FloatArray, spread_s: float) -> FloatArray:
    """Return the logarithm of the likelihood of all changes for each common delay, for a spread."""
    top = likelihood.max(axis=1, keepdims=True)
    together = np.exp(likelihood - top) @ _prior(spread_s).T
    return np.asarray((np.log(np.maximum(together, 1e-300)) + top).sum(axis=0))


def _common(likelihood: FloatArray) -> tuple[float, float]:
    """Return the common delay and the spread [s] of greatest likelihood."""
    if not len(likelihood):
        return 0.0, 0.0
    tried = [(_marginal(likelihood, spread), spread) for spread in _SPREADS_S]
    best, spread = max(tried, key=lambda pair: float(pair[0].max()))
    return float(GRID_S[int(np.argmax(best))]), spread


def _evidence(likelihood: FloatArray) -> float:
    if len(likelihood) < _FEWEST:
        return 0.0
    without = float(_marginal(likelihood, 0.0).max())
    with_spread = max(float(_marginal(likelihood, spread).max()) for spread in _SPREADS_S[1:])
    return 2.0 * (with_spread - without) - math.log(len(likelihood))


def _posterior(likelihood: FloatArray, mean_s: float, spread_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the mean and the standard deviation of each change's delay [s]."""
    weight = _weights(likelihood, mean_s, spread_s)
    mean = weight @ GRID_S
    return mean, np.sqrt(np.maximum(weight @ GRID_S**2 - mean**2, 0.0))


def _weights(likelihood: FloatArray, mean_s: float, spread_s: float) -> FloatArray:
    """Return the probability of each delay of the grid (columns) for each change (rows), given the logs."""
    row = _prior(spread_s)[round(mean_s / _STEP_S)]
    with np.errstate(divide="ignore"):
        weight = likelihood + np.log(row)
    weight = np.exp(weight - weight.max(axis=1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def _without_trend(likelihood: FloatArray, changes: Sequence[Change]) -> FloatArray:
    """Return the likelihoods with the delays' dependence on size, direction and end of a change taken off."""
    if len(changes) < _FEWEST:
        return likelihood
    _, spread = _common(likelihood)
    mean, error = _posterior(likelihood, *_common(likelihood))
    before = np.array([change.before_rpm for change in changes])
    after = np.array([change.after_rpm for change in changes])
    size = np.abs(after - before)
    kinds = np.column_stack(
        [
            np.ones(size.size),
            size / max(float(size.max()), 1e-9),
            np.abs(after) < np.abs(before),
            np.abs(before) <= COMMAND_STEP_RPM,
            before * after < 0.0,
            after > before,
        ]
    ).astype(float)
    weight = 1.0 / np.maximum(np.hypot(error, spread), _STEP_S)
    slopes = np.linalg.lstsq(kinds * weight[:, None], mean * weight, rcond=None)[0]
    trend = kinds @ slopes
    trend -= np.average(trend, weights=weight**2)
    return np.array(
        [np.interp(GRID_S + off, GRID_S, row) for off, row in zip(trend, likelihood, strict=True)]
    )
