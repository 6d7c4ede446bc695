"""The fit to bench logs whose commands act at times of their own.

A link delays every change of the command differently, or the log shows a command in the first row after it
was given, at any time since the row before (`sysid.compare.links.between_rows`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.statistics import rms
from sysid.compare.links import AlignedLogs, LinkClock, delays_between_rows, link_delays, with_stamps
from sysid.fit.drive.behind_path import fit_behind
from sysid.fit.drive.command_clock import SHORTEST
from sysid.fit.drive.command_path import (
    LAW_RATE_HZ,
    UNSEEN_TICKS,
    CommandPath,
    infer_command_path,
)
from sysid.fit.drive.law_fit import LawFit, wheel_model
from sysid.fit.options import FitOptions
from sysid.fit.statistics import residual
from sysid.progress import Progress, silent, within

STAGE: Final = "times of the commands"
"""What progress is told of this work."""
_TURNS: Final = 6
"""How often the times of the changes and the law are estimated in turns, at most."""
_BETTER: Final = 0.05
"""Relative decrease of the error from one turn to the next below which there is no other. Assumed."""
_WORTH: Final = 0.2
"""Least relative decrease of the error by the delays for which they are adopted. Assumed."""
_PARTS: Final = 2.5
"""Ticks per sample where there would be more than `UNSEEN_TICKS`: changes that act between samples show a
faster response than samples are apart."""


def with_times_of_commands(plain: LawFit, progress: Progress) -> LawFit:
    """Return the fit with each change of the command at its own time, where bench logs show such times.

    The times of the changes and the law are estimated in turns: first between rows, unless a clock slower
    than the rows says when commands were given, and then delays that differ. The fit is `plain` with one
    delay for all changes. `progress` is told of each turn.
    """
    found, path = plain, plain.path
    if not (path.latched and path.command_period_s > SHORTEST * _interval_s(plain)):
        found = _in_turns(plain, progress, between_rows=True)
    return _in_turns(plain, progress, between_rows=False) if found is plain else found


def with_times_by(model: Model, timed: LawFit, plain: LawFit, progress: Progress) -> LawFit:
    """Return a fit with times between rows again, with the times that a better model of the logs says.

    Args:
        model: that of the `timed` fit, with effects beside its law.
        timed: the fit with the changes at times between rows.
        plain: the fit with one delay for all changes.
        progress: told of each long step.
    """
    assert timed.link is not None
    link = timed.link
    stated = link.as_stated(model)
    delays = delays_between_rows(stated, plain.dataset.runs, link.clock)
    logs = AlignedLogs.of(plain.dataset, with_stamps(stated, delays.mean_s), link.clock, delays)
    return _behind(logs, plain.path, plain.options, within(progress, STAGE))


def _in_turns(plain: LawFit, progress: Progress, *, between_rows: bool) -> LawFit:
    """Return the fit with the times of the best turn, the plain one unless that is clearly better.

    The gain of the law is free in the turns: one that cannot stay below its command tells no times. Where
    that finds none, the turns have the gain of 1 of the fit itself: a free gain follows what friction does to
    the speed, and then tells no times either.
    """
    tell = within(progress, STAGE)
    for unit_gain in (False, True) if plain.options.unit_gain else (False,):
        link = _link_in_turns(plain, progress, between_rows=between_rows, unit_gain=unit_gain)
        if link is not None:
            return _behind(link, plain.path, plain.options, tell)
        progress = silent  # the stage is told once
    return plain


def _link_in_turns(
    plain: LawFit, progress: Progress, *, between_rows: bool, unit_gain: bool
) -> AlignedLogs | None:
    """Return the aligned logs of the best turn; None if no turn is clearly better than one delay for all."""
    path, tell = plain.path, within(progress, STAGE)
    one_method = replace(plain.options, methods=plain.options.methods[:1], unit_gain=unit_gain)
    quick = replace(one_method, starts=min(3, plain.options.starts))
    alone = fit_behind(replace(path, exact=True), plain.dataset, quick, silent)
    best, found, link = alone, alone, None
    for turn in range(_TURNS):
        logs = _aligned(plain, found, between_rows=between_rows)
        # A law that was fitted to the stamps may speak for them; one that was not decides.
        if not (logs.delays.differ or (between_rows and turn == 0)):
            break
        if turn == 0:
            progress(STAGE)
        tell(f"turn {turn + 1}")
        found = _behind(logs, path, quick, silent)
        if _error(found) < (1.0 - _BETTER) * _error(best):
            best, link = found, logs
        elif turn > 0:
            break
    if link is None or not link.delays.differ or _error(best) >= (1.0 - _WORTH) * _error(alone):
        return None
    return link


def _behind(logs: AlignedLogs, path: CommandPath, options: FitOptions, progress: Progress) -> LawFit:
    """Return the law fitted to aligned logs, whose changes are known to act on a clock of their own."""
    fine = replace(path, sample_period_s=logs.clock.tick_s, command_period_s=logs.period_s)
    fine = replace(fine, latched=True, exact=True, notes=())
    found = fit_behind(fine, logs.dataset, options, progress)
    notes = path.notes
    if logs.between_rows:
        # What was said of the clock and the tick does not hold for this fit.
        notes = infer_command_path(
            logs.logs,
            sample_period_s=fine.sample_period_s,
            command_period_s=fine.command_period_s,
            quantum_rpm=options.quantum_rpm,
            saturation_rpm=options.saturation_rpm,
        ).notes
    return replace(found, link=logs, notes=(*notes, logs.note, *found.notes))


def _aligned(plain: LawFit, found: LawFit, *, between_rows: bool) -> AlignedLogs:
    """Return the logs of the plain fit aligned by the law as found."""
    path = plain.path
    runs, tick, interval = plain.dataset.runs, path.sample_period_s, _interval_s(plain)
    # A log whose own rows are its clock has a law as slow as they are.
    shortest = min(tick, 1.0 / LAW_RATE_HZ) if between_rows else tick
    if interval > UNSEEN_TICKS * shortest * (1.0 + 1e-6):
        # In whole ticks per sample a law could alternate from tick to tick unseen.
        tick = interval / _PARTS
    # Between rows nothing tells on which clock the drive looks for commands, least of all one of rows.
    latched = path.latched and not between_rows
    clock = LinkClock(tick, path.command_period_s if latched else None)
    period = tick if between_rows else path.command_period_s
    wheel = replace(wheel_model(found.path, found.estimate), command_period_s=period)
    given = with_stamps(Model(wheel, plain.options.robot), 0.0 if between_rows else None)
    delays = (delays_between_rows if between_rows else link_delays)(given, runs, clock)
    return AlignedLogs.of(plain.dataset, given, clock, delays)


def _interval_s(fit: LawFit) -> float:
    """Return the time between rows [s]."""
    return float(np.median([run.median_interval_s for run in fit.dataset.runs]))


def _error(fit: LawFit) -> float:
    """Return the rms error [rpm] on the runs that were not fitted, or on all if there are none."""
    data = fit.pooled("validation") + fit.pooled("test") or fit.pooled("fit")
    return rms(np.concatenate([residual(run, fit.estimate) for run in data]))
