"""The fit through a link that delays every change of the command differently."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.statistics import rms
from sysid.compare.links import AlignedLogs, LinkClock, link_delays
from sysid.fit.drive.behind_path import fit_behind
from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.law_fit import LawFit, wheel_model
from sysid.fit.statistics import residual
from sysid.progress import Progress

_TURNS: Final = 3
"""How often the delays of the changes and the law are estimated in turns."""
_WORTH: Final = 0.2
"""Least relative decrease of the error by the delays for which they are adopted. Assumed."""
_UNSEEN_TICKS: Final = 2.0
"""Ticks per sample above which the law's tick goes with the samples, as in `command_path`."""
_PARTS: Final = 2.5
"""Ticks per sample then: changes that act between samples show a faster response than samples are apart."""


def through_late_link(path: CommandPath, plain: LawFit, progress: Progress) -> LawFit:
    """Return the fit with each change of the command at its own delay, where bench logs show such delays.

    The delays of the changes and the law are estimated in turns. `path` is that which the logs suggest, and
    the fit is `plain` with one delay for all changes. `progress` is told of each turn.
    """
    options = plain.options
    quick = replace(options, methods=options.methods[:1], starts=min(3, options.starts))
    found, logs = plain, None
    for turn in range(_TURNS):
        logs = _aligned(path, plain, found)
        if logs is None:
            return plain
        progress(f"delays of the commands: {turn + 1}")
        last = turn == _TURNS - 1
        # The moved changes are known to act on a clock of their own.
        fine = replace(path, sample_period_s=logs.clock.tick_s, command_period_s=logs.period_s)
        fine = replace(fine, latched=True, exact=True, notes=())
        found = fit_behind(fine, logs.dataset, options if last else quick, progress)
    before, after = _error(plain), _error(found)
    if logs is None or after >= (1.0 - _WORTH) * before:
        return plain
    note = (
        f"{logs.note}; with the delay of each as found, the law errs by {after:.3g} rpm (rms) on runs that "
        f"it was not fitted to, with one delay by {before:.3g} rpm"
    )
    return replace(found, link=logs, notes=(*path.notes, note, *found.notes))


def _aligned(path: CommandPath, plain: LawFit, found: LawFit) -> AlignedLogs | None:
    """Return the logs of the plain fit aligned by the law as found, None if one delay is enough.

    `path` is the command path that the logs suggest.
    """
    runs, tick = plain.dataset.runs, path.sample_period_s
    interval = float(np.median([run.median_interval_s for run in runs]))
    if interval > _UNSEEN_TICKS * tick * (1.0 + 1e-6):
        # In whole ticks per sample a law could alternate from tick to tick unseen.
        tick = interval / _PARTS
    clock = LinkClock(tick, path.command_period_s if path.latched else None)
    wheel = replace(wheel_model(found.path, found.estimate), command_period_s=path.command_period_s)
    given = Model(wheel, plain.options.robot)
    delays = link_delays(given, runs, clock)
    return AlignedLogs.of(plain.dataset, given, clock, delays) if delays.jitters else None


def _error(fit: LawFit) -> float:
    """Return the rms error [rpm] on the runs that were not fitted, or on all if there are none."""
    data = fit.pooled("validation") + fit.pooled("test") or fit.pooled("fit")
    return rms(np.concatenate([residual(run, fit.estimate) for run in data]))
