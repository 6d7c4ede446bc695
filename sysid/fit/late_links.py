"""The fit through a link that delays every change of the command differently."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.statistics import rms
from sysid.compare.late_links import aligned, resolution_s, with_jitter, without_delays
from sysid.compare.link_delays import LinkDelays, link_delays
from sysid.fit.command_path import CommandPath
from sysid.fit.estimators import Estimate
from sysid.fit.metrics import Runs, residual
from sysid.logs import Dataset

LINK_TURNS: Final = 3
"""How often the delays of the changes and the law are estimated in turns."""
_WORTH: Final = 0.2
"""Least relative decrease of the error by the delays for which they are adopted. Assumed."""
_UNSEEN_TICKS: Final = 2.0
"""Ticks per sample above which the law's tick goes with the samples, as in `command_path`."""
_PARTS: Final = 2.5
"""Ticks per sample then: changes that act between samples show a faster response than samples are apart."""


@dataclass(frozen=True, eq=False)
class LateLink:
    """A link that delays every change of the command differently, and the logs without that."""

    delays: LinkDelays
    dataset: Dataset
    """The logs with each change moved to where it acted, less the common delay."""
    path: CommandPath
    """Their command path: its clock is fine enough for the moved changes."""
    given: CommandPath
    """The command path of the logs as they are."""

    def described(self, model: Model) -> Model:
        """Return a model that was fitted to the moved changes as that of the link."""
        return with_jitter(model, self.delays.spread_s, self.given.command_period_s)

    def note(self, before: Estimate, before_runs: Runs, after: Estimate, after_runs: Runs) -> str:
        """Return what was found, in a sentence.

        It has the errors of the estimate `before`, with one delay, on `before_runs`, and of that `after`,
        with the delay of each change, on `after_runs`.
        """
        found = self.delays
        lost = f", and {found.loss:.0%} of the changes never act" if found.lost.any() else ""
        return (
            f"each change of the command acts at a time of its own: {found.mean_s * 1e3:.0f} ms late with a "
            f"spread of {found.spread_s * 1e3:.0f} ms over {len(found.changes)} changes{lost}; with the "
            f"delay of each as found, the law errs by {_error(after_runs, after):.3g} rpm (rms) on runs that "
            f"it was not fitted to, with one delay by {_error(before_runs, before):.3g} rpm"
        )


def late_link(dataset: Dataset, path: CommandPath, model: Model) -> LateLink | None:
    """Return the link of bench logs if it delays every change differently, else None.

    `path` is the command path that the logs suggest, and the `model` has the law as known so far.
    """
    interval = float(np.median([run.median_interval_s for run in dataset.runs]))
    tick = path.sample_period_s
    if interval > _UNSEEN_TICKS * tick * (1.0 + 1e-6):
        # In whole ticks per sample a law could alternate from tick to tick unseen.
        tick = interval / _PARTS
    clock = path.command_period_s if path.latched else None
    found = link_delays(without_delays(model), dataset.runs, clock, resolution_s(tick, 0.0))
    if not found.jitters:
        return None
    period = resolution_s(tick, found.mean_s)
    fine = replace(path, sample_period_s=tick, command_period_s=period, latched=True, exact=True, notes=())
    return LateLink(found, aligned(dataset, found, period), fine, path)


def link_is_worth_having(before_runs: Runs, before: Estimate, after_runs: Runs, after: Estimate) -> bool:
    """Return whether the delays of the changes lower the error enough.

    The estimate `before` is with one delay and predicts `before_runs`, that `after` predicts `after_runs`.
    """
    return _error(after_runs, after) < (1.0 - _WORTH) * _error(before_runs, before)


def _error(runs: Runs, found: Estimate) -> float:
    """Return the rms error [rpm] on the runs that were not fitted, or on all if there are none."""
    held_out = [run for split in ("validation", "test") for wheel in runs[split].values() for run in wheel]
    data = held_out or [run for wheel in runs["fit"].values() for run in wheel]
    return rms(np.concatenate([residual(run, found) for run in data]))
