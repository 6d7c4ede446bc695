"""What lies before the law: the clock of the commands, a transport delay, a ceiling; adopted on evidence.

Each of them makes the fit runs fit better, if only a little, whatever the truth. So one is adopted where it
explains the fit runs far beyond chance *and* the validation runs, which it has not seen, by more than a
hair, and where the law's own zeros cannot do the same. The search is by single starts from the
Steiglitz-McBride law; `pipeline` then runs all starts of the law behind what was chosen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sysid.fit.command_path import COMMAND_PERIOD_S, CommandPath
from sysid.fit.estimators import Estimate, Options, WheelRun, estimate
from sysid.fit.metrics import Runs, residual, rms
from sysid.fit.statistics import uncertainty
from sysid.fit.wheel_data import driven, longest_delay_s, wheel_runs
from sysid.logs import Dataset
from sysid.logs.runs import SPLITS

LONGEST_DELAY_S: Final = 0.25
_EVIDENCE: Final = 10.0
"""Difference of BIC: "very strong" on the scale of Kass and Raftery (1995)."""
_WORTH: Final = 0.02
"""Relative fall of the validation error from which another parameter is worth having."""
_ENOUGH_TICKS: Final = 30_000
VAGUE: Final = 0.5
"""Relative standard error from which a delay is as good as unknown."""


@dataclass(frozen=True)
class Search:
    """What every fit of one dataset shares."""

    method: str
    seed: int
    unit_gain: bool
    path: CommandPath
    effective_share: float
    """Independent samples over samples; less than 1 where a slow sensor's samples repeat."""

    def run(
        self,
        data: Sequence[WheelRun],
        *,
        method: str | None = None,
        starts: int = 1,
        delay_s: float = 0.0,
        saturation_rpm: float = math.inf,
        free: Sequence[str] = (),
        initial: Sequence[Sequence[float]] = (),
        unit_gain: bool | None = None,
    ) -> Estimate:
        """Estimate the law and what is `free` of "delay_s", "saturation_rpm"; the rest is held as given.

        Args:
            data: the runs.
            method: which; the search's own when None.
            starts: how many.
            delay_s: held, unless free [s].
            saturation_rpm: held, unless free [rpm].
            free: what is estimated beside the law.
            initial: starting points A-F instead of the method's own.
            unit_gain: hold the DC gain at 1; as the search does when None.
        """
        held_delay = 0.0 if "delay_s" in free else delay_s
        held_limit = math.inf if "saturation_rpm" in free else saturation_rpm
        options = Options(
            starts=starts,
            seed=self.seed,
            unit_gain=self.unit_gain if unit_gain is None else unit_gain,
            fit_delay="delay_s" in free,
            max_delay_s=min(LONGEST_DELAY_S, longest_delay_s(self.path)),
            fit_saturation="saturation_rpm" in free,
            initial=tuple(tuple(float(x) for x in row) for row in initial),
        )
        prepared = [driven(run, held_delay, held_limit) for run in data]
        found = estimate(prepared, method or self.method, options)
        return replace(
            found,
            delay_s=held_delay + found.delay_s,
            saturation_rpm=min(held_limit, found.saturation_rpm),
        )


def pooled(wheels: Mapping[str, Sequence[WheelRun]]) -> list[WheelRun]:
    """Return the runs of all wheels in one list."""
    return [run for runs in wheels.values() for run in runs]


def runs_by_split(dataset: Dataset, path: CommandPath, sigma_rpm: Mapping[str, float]) -> Runs:
    """Return split -> wheel -> data on the law's clock."""
    return {split: wheel_runs(dataset.split(split), path, sigma_rpm) for split in SPLITS}


def choose_clock(
    dataset: Dataset, search: Search, sigma_rpm: Mapping[str, float], given: bool
) -> tuple[Search, Estimate, Runs, str | None]:
    """Fit with the clock that the stamps suggest and with the platform's own; return the better with a note.

    Args:
        dataset: the logs.
        search: with the inferred command path.
        sigma_rpm: noise of each column.
        given: the user stated the command period: only that one is tried.
    """
    path = search.path
    paths = [path]
    if not given and not (path.latched and path.command_period_s == COMMAND_PERIOD_S):
        whole = COMMAND_PERIOD_S / path.sample_period_s
        if path.command_period_s >= path.sample_period_s and abs(whole - round(whole)) < 1e-6:
            paths.append(replace(path, latched=True, command_period_s=COMMAND_PERIOD_S))
    if path.command_period_s < 0.5 / 120.0:  # commands that fast were seen to be
        paths = paths[:1]
    tried = []
    for candidate in paths:
        runs = runs_by_split(dataset, candidate, sigma_rpm)
        chosen = replace(search, path=candidate)
        tried.append((chosen, chosen.run(pooled(runs["fit"])), runs))
    best = min(tried, key=lambda item: item[1].cost)
    if best[1].cost > (1.0 - _WORTH) * tried[0][1].cost:
        return (*tried[0], None)
    note = f"commands fit better latched every {COMMAND_PERIOD_S:g} s from each run's start than as stamped"
    return (*best, note)


def choose_drive(runs: Runs, search: Search, plain: Estimate, *, delay: bool) -> Estimate:
    """Return the estimate with a transport delay, a ceiling, both or neither, as the data ask.

    Args:
        runs: by split.
        search: how to fit.
        plain: the estimate with neither.
        delay: whether a delay may be estimated; a ceiling may be where `search.path.seek_ceiling`.
    """
    data = representative(pooled(runs["fit"]))
    best = plain if len(data) == len(pooled(runs["fit"])) else search.run(data, delay_s=plain.delay_s)
    candidates = ["delay_s"] * delay + ["saturation_rpm"] * search.path.seek_ceiling
    while True:
        free = [name for name in ("delay_s", "saturation_rpm") if name in best.free]
        others = [
            search.run(data, free=[*free, name], delay_s=plain.delay_s)
            for name in candidates
            if name not in free
        ]
        worthy = [other for other in others if worth_having(runs, data, best, other, search.effective_share)]
        if not worthy:
            return best
        best = min(worthy, key=lambda other: other.cost)


def worth_having(
    runs: Runs, data: Sequence[WheelRun], found: Estimate, other: Estimate, effective_share: float
) -> bool:
    """Return whether `other`, with one parameter more, is worth adopting over `found`.

    The difference of BIC counts with the residual's own variance where that exceeds the noise: error of the
    model is no noise that averages out, yet the data cannot be trusted beyond it.

    Args:
        runs: by split; the validation runs count.
        data: what both were fitted to.
        found: the simpler estimate.
        other: the one with a parameter more.
        effective_share: independent samples over samples.
    """
    if len(_drive(other)) <= len(_drive(found)):
        return False
    samples = sum(len(run.speed_rpm) for run in data)
    variance = max(1.0, 2.0 * found.cost / samples)
    gain = 2.0 * (found.cost - other.cost) / variance * effective_share
    evidence = gain - math.log(max(2.0, samples * effective_share))
    return evidence >= _EVIDENCE and _held_out_agrees(runs, found, other)


def delay_is_vague(data: Sequence[WheelRun], found: Estimate) -> bool:
    """Return whether the law's zeros imitate the estimated delay, so that the two cannot be told apart."""
    if "delay_s" not in found.free or found.delay_s <= 0.0:
        return False
    return uncertainty(data, found)["delay_s"].relative_error > VAGUE


def representative(data: Sequence[WheelRun]) -> list[WheelRun]:
    """Return runs spread evenly over the data, the fastest among them: enough to compare structures."""
    ticks = sum(len(run.command_rpm) for run in data)
    if ticks <= _ENOUGH_TICKS:
        return list(data)
    fastest = max(range(len(data)), key=lambda i: float(np.max(np.abs(data[i].command_rpm))))
    chosen, every = {fastest}, ticks / _ENOUGH_TICKS
    chosen |= {int(i * every) for i in range(int(len(data) / every))}
    return [data[i] for i in sorted(chosen)]


def _drive(found: Estimate) -> tuple[str, ...]:
    """Return the drive parameters that an estimate really has."""
    return ("delay_s",) * (found.delay_s > 0.0) + ("saturation_rpm",) * math.isfinite(found.saturation_rpm)


def _held_out_agrees(runs: Runs, found: Estimate, other: Estimate) -> bool:
    """Return whether the runs held out are predicted better where it matters, or do not tell the two apart.

    A ceiling, say, changes only the samples beyond it, and a validation run may have none.
    """
    data = pooled(runs["validation"]) or pooled(runs["fit"])
    before, after = (np.concatenate([residual(run, e) for run in data]) for e in (found, other))
    apart = np.abs(after - before) > _WORTH * rms(before)
    if not apart.any():
        return True
    return rms(after[apart]) < (1.0 - _WORTH) * rms(before[apart])


def held_out_rms(runs: Runs, found: Estimate) -> float:
    """Return the rms [rpm] on the validation runs, or on the fit runs where there are none."""
    data = pooled(runs["validation"]) or pooled(runs["fit"])
    return rms(np.concatenate([residual(run, found) for run in data]))
