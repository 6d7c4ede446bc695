"""One fit of the law to the runs of a dataset, with the settings that all of its fits share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.wheel_data import driven, longest_delay_s, wheel_columns
from sysid.fit.estimators import Estimate, Options, WheelRun, estimate
from sysid.fit.options import FitOptions
from sysid.logs import Dataset

_LONGEST_DELAY_S: Final = 0.5
"""Longest transport delay that is tried [s]."""


@dataclass(frozen=True)
class LawFitter:
    """Fits of the law to one dataset, with the settings that all of them share."""

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
        (whether the DC gain is held at 1) default to those of the settings.
        """
        held_delay = 0.0 if "delay_s" in free else delay_s
        held_limit = math.inf if "saturation_rpm" in free else saturation_rpm
        options = Options(
            starts=starts,
            seed=self.seed,
            unit_gain=self.unit_gain if unit_gain is None else unit_gain,
            fit_delay="delay_s" in free,
            max_delay_s=longest_tried_s(self.path),
            fit_saturation="saturation_rpm" in free,
            initial=tuple(tuple(float(x) for x in row) for row in initial),
        )
        prepared = [driven(run, held_delay, held_limit) for run in data]
        found = estimate(prepared, method or self.method, options)
        return replace(
            found, delay_s=held_delay + found.delay_s, saturation_rpm=min(held_limit, found.saturation_rpm)
        )


def fitter_of(options: FitOptions, path: CommandPath, dataset: Dataset) -> LawFitter:
    """Return the settings of all fits to a `dataset` behind a command `path`, with these `options`."""
    return LawFitter(options.methods[0], options.seed, options.unit_gain, path, _independent_share(dataset))


def longest_tried_s(path: CommandPath) -> float:
    """Return the longest transport delay [s] that is tried behind a command `path`."""
    return min(_LONGEST_DELAY_S, longest_delay_s(path))


def _independent_share(dataset: Dataset) -> float:
    """Return the share of independent samples among the wheel speeds of a `dataset`'s fit runs, above 0 to 1.

    Values that a slow sensor repeats, and channels that copy another, are not independent.
    """
    held = {(f.file, f.channel): f.value for f in dataset.findings if f.kind == "held_samples"}
    copies = {(f.file, f.channel) for f in dataset.findings if f.kind == "same_channel"}
    total = independent = 0.0
    for run in dataset.split("fit"):
        for column in wheel_columns(run).values():
            count = float(run.finite(column).sum())
            total += count
            if (run.file, column) not in copies:
                independent += count * (1.0 - held.get((run.file, column), 0.0))
    return independent / total if independent > 0.0 else 1.0
