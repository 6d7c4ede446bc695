"""What lies before the law: the clock of the commands, a transport delay, a ceiling; adopted on evidence.

Each additional parameter improves the fit of the fit runs a little, whatever the truth. One is therefore
adopted only if its improvement is significant, if it also improves the prediction of the validation runs,
and if the law's own zeros cannot do the same. Each choice is made by a single start from the
Steiglitz-McBride law; `pipeline` then runs all starts with the chosen structure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.fit.command_path import COMMAND_PERIOD_S, CommandPath
from sysid.fit.estimators import Estimate, Options, WheelRun, estimate
from sysid.fit.metrics import Runs, residual
from sysid.fit.statistics import uncertainty
from sysid.fit.wheel_data import driven, longest_delay_s, wheel_runs
from sysid.logs import Dataset
from sysid.logs.runs import SPLITS

_LONGEST_DELAY_S: Final = 0.5
"""Longest transport delay that is tried [s]."""
_EVIDENCE: Final = 10.0  # difference of BIC: "very strong" on the scale of Kass and Raftery (1995)
_WORTH: Final = 0.02  # least relative decrease of the validation error for which a parameter is adopted
_ENOUGH_TICKS: Final = 30_000  # number of ticks that suffice to compare structures
_VAGUE: Final = 0.5
"""Relative standard error above which a delay counts as unknown."""
_WORTH_SAYING: Final = 0.02
"""Least difference of a free gain from 1, and relative decrease of the validation error by it, for a note."""


@dataclass(frozen=True)
class Search:
    """Settings that all fits of one dataset share."""

    method: str
    seed: int
    unit_gain: bool
    path: CommandPath
    effective_share: float
    """Share of the samples that are independent; below 1 if the values of a slow sensor repeat."""

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
        """Estimate the law from `starts` starting points, or from the `initial` ones A-F.

        "delay_s" [s] and "saturation_rpm" [rpm] are held, unless `free` names them. `method` and `unit_gain`
        (whether the DC gain is held at 1) default to those of the search.
        """
        held_delay = 0.0 if "delay_s" in free else delay_s
        held_limit = math.inf if "saturation_rpm" in free else saturation_rpm
        options = Options(
            starts=starts,
            seed=self.seed,
            unit_gain=self.unit_gain if unit_gain is None else unit_gain,
            fit_delay="delay_s" in free,
            max_delay_s=min(_LONGEST_DELAY_S, longest_delay_s(self.path)),
            fit_saturation="saturation_rpm" in free,
            initial=tuple(tuple(float(x) for x in row) for row in initial),
        )
        prepared = [driven(run, held_delay, held_limit) for run in data]
        found = estimate(prepared, method or self.method, options)
        return replace(
            found, delay_s=held_delay + found.delay_s, saturation_rpm=min(held_limit, found.saturation_rpm)
        )


def pooled(wheels: Mapping[str, Sequence[WheelRun]]) -> list[WheelRun]:
    """Return the runs of all wheels in one list."""
    return [run for runs in wheels.values() for run in runs]


def runs_by_split(dataset: Dataset, path: CommandPath, sigma_rpm: Mapping[str, float]) -> Runs:
    """Return split -> wheel -> runs on the law's clock, with the noise `sigma_rpm` of each column."""
    return {split: wheel_runs(dataset.split(split), path, sigma_rpm) for split in SPLITS}


def choose_clock(
    dataset: Dataset, search: Search, sigma_rpm: Mapping[str, float], given: bool
) -> tuple[Search, Estimate, Runs, str | None]:
    """Fit with the clock that the times of the log suggest and, unless it is `given`, with the platform's.

    Return the search with the better command path, its estimate, its runs with the noise `sigma_rpm` of each
    column [rpm], and a note if the clock is the platform's.
    """
    path = search.path
    paths = [path]
    if not given and not (path.latched and path.command_period_s == COMMAND_PERIOD_S):
        whole = COMMAND_PERIOD_S / path.sample_period_s
        if path.command_period_s >= path.sample_period_s and abs(whole - round(whole)) < 1e-6:
            paths.append(replace(path, latched=True, command_period_s=COMMAND_PERIOD_S))
    if path.command_period_s < 0.5 / 120.0:  # commands that fast are certain
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
    """Return the estimate with those of a transport delay and a ceiling that are worth having.

    `plain`, fitted to all `runs`, has neither. A delay is tried if `delay`, a ceiling if the path seeks one.
    """
    data = _representative(pooled(runs["fit"]))
    best = plain if len(data) == len(pooled(runs["fit"])) else search.run(data, delay_s=plain.delay_s)
    candidates = ["delay_s"] * delay + ["saturation_rpm"] * search.path.seek_ceiling
    while True:
        free = [name for name in ("delay_s", "saturation_rpm") if name in best.free]
        others = [
            search.run(data, free=[*free, name], delay_s=plain.delay_s)
            for name in candidates
            if name not in free
        ]
        worthy = [other for other in others if _worth_having(runs, data, best, other, search.effective_share)]
        if not worthy:
            return best
        best = min(worthy, key=lambda other: other.cost)


def _worth_having(
    runs: Runs, data: Sequence[WheelRun], found: Estimate, other: Estimate, effective_share: float
) -> bool:
    """Return whether `other`, with one parameter more, is worth adopting over `found`.

    Both were fitted to `data`, of which only the `effective_share` is independent, and the validation `runs`
    must agree. The difference of BIC is taken with the variance of the residual if that exceeds the noise,
    since the model's error limits what the data can tell.
    """
    if len(_drive(other)) <= len(_drive(found)):
        return False
    samples = sum(len(run.speed_rpm) for run in data)
    variance = max(1.0, 2.0 * found.cost / samples)
    gain = 2.0 * (found.cost - other.cost) / variance * effective_share
    evidence = gain - math.log(max(2.0, samples * effective_share))
    return evidence >= _EVIDENCE and _held_out_agrees(runs, found, other)


def delay_is_vague(data: Sequence[WheelRun], found: Estimate) -> bool:
    """Return whether the estimated delay cannot be told from the law's zeros."""
    if "delay_s" not in found.free or found.delay_s <= 0.0:
        return False
    return uncertainty(data, found)["delay_s"].relative_error > _VAGUE


def _representative(data: Sequence[WheelRun]) -> list[WheelRun]:
    """Return runs spread evenly over the data, with that of the largest command, to compare structures."""
    ticks = sum(len(run.command_rpm) for run in data)
    if ticks <= _ENOUGH_TICKS:
        return list(data)
    fastest = max(range(len(data)), key=lambda i: float(np.max(np.abs(data[i].command_rpm))))
    chosen, every = {fastest}, ticks / _ENOUGH_TICKS
    chosen |= {int(i * every) for i in range(int(len(data) / every))}
    return [data[i] for i in sorted(chosen)]


def _drive(found: Estimate) -> tuple[str, ...]:
    """Return the parameters before the law that an estimate has."""
    return ("delay_s",) * (found.delay_s > 0.0) + ("saturation_rpm",) * math.isfinite(found.saturation_rpm)


def _held_out_agrees(runs: Runs, found: Estimate, other: Estimate) -> bool:
    """Return whether the held-out runs are predicted better where the two estimates differ, or never differ.

    A ceiling, for example, only changes the samples beyond it, and a validation run may have none.
    """
    before, after = _held_out_residual(runs, found), _held_out_residual(runs, other)
    differ = np.abs(after - before) > _WORTH * rms(before)
    return not differ.any() or rms(after[differ]) < (1.0 - _WORTH) * rms(before[differ])


def _held_out_residual(runs: Runs, found: Estimate) -> FloatArray:
    """Return the residual [rpm] on the validation runs, or on the fit runs if there are none."""
    data = pooled(runs["validation"]) or pooled(runs["fit"])
    return np.concatenate([residual(run, found) for run in data])


def drive_notes(dataset: Dataset, path: CommandPath, found: Estimate, sought_delay: bool) -> list[str]:
    """Return notes on the delay, if it was sought (`sought_delay`), and the ceiling that were `found`."""
    notes = []
    if sought_delay and found.delay_s > 0.0:
        exactly = "" if "delay_s" in found.free else " (in whole ticks)"
        notes.append(
            f"a transport delay of {found.delay_s * 1e3:.1f} ms was estimated{exactly} and is in the model "
            "as command_latency; wheel speeds alone cannot tell it from sensor_latency"
        )
        longest = min(_LONGEST_DELAY_S, longest_delay_s(path))
        if found.delay_s > 0.99 * longest:
            notes.append(f"that delay is the longest tried, {longest * 1e3:.0f} ms: it may be longer")
    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
    if math.isfinite(found.saturation_rpm):
        where = (
            "it may as well act on the body's speed (body_speed_limit)"
            if dataset.level == "robot"
            else "a limit elsewhere in the platform looks the same to one wheel"
        )
        notes.append(
            f"commands reach {asked:.0f} rpm; a ceiling of {found.saturation_rpm:.1f} rpm on the wheel "
            f"command was estimated, as it predicts held-out runs better; {where}"
        )
    elif asked > path.saturation_rpm:
        notes.append(
            f"commands reach {asked:.0f} rpm and are clipped at the assumed {path.saturation_rpm:g} rpm; the "
            "logs ask for no other ceiling (--saturation sets one)"
        )
    return notes


def gain_notes(runs: Runs, search: Search, found: Estimate) -> list[str]:
    """Return notes on logs that contradict the unit DC gain that the law is given.

    A law of unit gain can imitate another gain by a pole so slow that it does not settle while any command is
    held; rise and settling times are meaningless then. The `runs` are those that the law was `found` with.
    """
    notes = []
    slowest = abs(found.law.poles[0])
    constant_s = -found.law.sample_period_s / math.log(slowest) if 0.0 < slowest < 1.0 else 0.0
    held_s = longest_hold_s(runs)
    if constant_s > held_s:
        notes.append(
            f"the slowest pole has a time constant of {constant_s:.3g} s, but no command is held longer than "
            f"{held_s:.3g} s: rise and settling times are extrapolated"
        )
    if not search.unit_gain:
        return notes
    # An estimated ceiling may only imitate a gain below 1.
    others = [
        search.run(
            _representative(pooled(runs["fit"])),
            delay_s=found.delay_s,
            saturation_rpm=limit,
            initial=[found.coefficients.tolist()],
            unit_gain=False,
        )
        for limit in {found.saturation_rpm, math.inf}
    ]
    before = rms(_held_out_residual(runs, found))
    after, free = min(((rms(_held_out_residual(runs, o)), o) for o in others), key=lambda pair: pair[0])
    if abs(free.law.dc_gain - 1.0) > _WORTH_SAYING and after < (1.0 - _WORTH_SAYING) * before:
        notes.append(
            f"unit DC gain is assumed, but a gain of {free.law.dc_gain:.3g} lowers the held-out error from "
            f"{before:.3g} to {after:.3g} rpm: try --free-gain, or check the units of command and speed"
        )
    return notes


def longest_hold_s(runs: Runs) -> float:
    """Return the longest time [s] for which a command of the fit runs is held."""
    longest = 0
    for run in pooled(runs["fit"]):
        changes = np.flatnonzero(np.diff(run.command_rpm)) + 1
        longest = max(longest, int(np.max(np.diff(np.concatenate([[0], changes, [len(run.command_rpm)]])))))
    return longest * pooled(runs["fit"])[0].sample_period_s
