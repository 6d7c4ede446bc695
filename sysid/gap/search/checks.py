"""Checks of options and logs before a study begins.

Logs in which nothing moves are refused: a dead sensor would pass for an effect, or make the noise zero.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import forms_of
from mecanum_env.units import FloatArray
from sysid.gap.result import GapOptions
from sysid.gap.search.known_effects import effects_for, is_meant, known_effects
from sysid.logs import Dataset
from sysid.logs.runs import Level

_LEAST_SAMPLES: Final = 7
"""Least number of samples, as for a fit."""


def require_valid(options: GapOptions, level: Level, dataset: Dataset | None = None) -> None:
    """Refuse options that make no sense for logs of a level, or for those of a `dataset` of this level.

    Raises:
        InputError: another level than that of the logs, a count below 1, no time to decide on, or an effect
            that does not exist, has nothing to act on at this level, or is both asked for and excluded.
    """
    if options.level not in ("auto", level):
        raise InputError(f"level {options.level}: these are {level} logs; leave it out, or give {level}")
    if options.plant == "planar" and level == "bench":
        raise InputError("plant planar: these are bench logs, which have no robot; leave it out")
    known = known_effects(level, options.plant) if dataset is None else effects_for(dataset, options.plant)
    for option, names in (("only", options.only), ("exclude", options.exclude)):
        for name in names:
            if name not in CATALOGUE and not forms_of(name):
                raise InputError(
                    f"{option} {name}: no such effect{did_you_mean(name, CATALOGUE)}; "
                    f"for {level} logs: {', '.join(known)}"
                )
    for name in options.only:
        if not any(is_meant(one, (name,)) for one in known):
            logs = f"{level} logs" + (_lacking(CATALOGUE[name]) if name in CATALOGUE else "")
            raise InputError(f"only {name}: has no effect in {logs}; use one of: {', '.join(known)}")
        if name in options.exclude:
            raise InputError(f"only {name}: excluded as well; leave out one of the two")
    if all(is_meant(name, options.exclude) for name in known):
        raise InputError(f"exclude: no effect is left to look for; for {level} logs: {', '.join(known)}")
    for option, value in (("max-effects", options.max_effects), ("jobs", options.jobs)):
        if value < 1:
            raise InputError(f"{option} = {value}, must be at least 1")
    if options.seconds is not None and not options.seconds > 0.0:
        raise InputError(f"seconds = {options.seconds:g}, must be above 0")
    if options.seed < 0:
        raise InputError(f"seed = {options.seed}, must be 0 or more")


def require_movement(dataset: Dataset) -> None:
    """Refuse logs in which nothing moves.

    Raises:
        InputError: fewer samples than a fit takes, or no measured channel that ever changes.
    """
    parts: dict[str, list[FloatArray]] = {}
    for run in dataset.runs:
        for name, channel in run.channels.items():
            if name != "battery_v":
                parts.setdefault(name, []).append(channel[np.isfinite(channel)])
    measured = {name: np.concatenate(values) for name, values in parts.items()}
    samples, runs = sum(values.size for values in measured.values()), f"{len(dataset.runs)} run(s)"
    if samples < _LEAST_SAMPLES:
        raise InputError(f"{samples} samples in {runs}, at least {_LEAST_SAMPLES} are needed to find a gap")
    if any(values.size and np.ptp(values) > 0.0 for values in measured.values()):
        return
    fastest = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
    if fastest == 0.0:
        raise InputError(
            f"the command is 0 throughout and nothing moves in {runs}, the first of which is "
            f"{dataset.runs[0].file}; record a step from rest"
        )
    still = " and ".join(f"{name} is {values[0]:g}" for name, values in measured.items() if values.size)
    raise InputError(
        f"{still} in every sample while wheels are commanded up to {fastest:g} rpm: a dead sensor or the "
        "wrong column, or no command that moves the wheel; check the logs, or record larger commands"
    )


def _lacking(effect: Effect) -> str:
    """Return what an effect needs and logs may lack, in words."""
    if effect.needs_falling_command:
        return " in which no command falls or reverses"
    return f" without {' and '.join(effect.reads)}" if effect.reads else ""
