"""The input of a study: checks of options and logs, the runs that decide, and what is known of their noise.

Logs in which nothing moves are refused: a dead sensor would pass for an effect, or make the noise zero.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, PlantKind
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model, cause_of, forms_of
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, observe, select_runs
from sysid.compare.model_error import Learned, ModelError, learn, model_error_of
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import Study
from sysid.gap.result import GapOptions
from sysid.gap.search.chance import Floor
from sysid.gap.search.thresholds import EFFORT, THRESHOLDS
from sysid.logs import Dataset, Run
from sysid.logs.runs import Level

_LEAST_SAMPLES: Final = 7
"""Least number of samples, as for a fit."""


def require_valid(options: GapOptions, level: Level, columns: Collection[str] | None = None) -> None:
    """Refuse options that make no sense for logs of a level, which have these measured `columns`.

    Raises:
        InputError: another level than that of the logs, a count below 1, no time to decide on, or an effect
            that does not exist, has nothing to act on at this level, or is both asked for and excluded.
    """
    if options.level not in ("auto", level):
        raise InputError(f"level {options.level}: these are {level} logs; leave it out, or give {level}")
    if options.plant == "planar" and level == "bench":
        raise InputError("plant planar: these are bench logs, which have no robot; leave it out")
    known = known_effects(level, options.plant, columns)
    for option, names in (("only", options.only), ("exclude", options.exclude)):
        for name in names:
            if name not in CATALOGUE and not forms_of(name):
                raise InputError(
                    f"{option} {name}: no such effect{did_you_mean(name, CATALOGUE)}; "
                    f"for {level} logs: {', '.join(known)}"
                )
    for name in options.only:
        if not any(is_meant(one, (name,)) for one in known):
            needed = CATALOGUE[name].reads if name in CATALOGUE else ()
            logs = f"{level} logs" + (f" without {' and '.join(needed)}" if needed else "")
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


def is_meant(effect: str, names: Collection[str]) -> bool:
    """Return whether `names` of effects, or of causes with all their forms, mean an effect."""
    return effect in names or cause_of(effect) in names


def known_effects(
    level: Level, plant: PlantKind = "rollers", columns: Collection[str] | None = None
) -> tuple[str, ...]:
    """Return the effects that a search tries on logs of a level, in the order of the chain.

    `plant` simulates robot logs. `columns` are those that the logs have, by default all.
    """
    used: PlantKind = "bench" if level == "bench" else plant
    return tuple(
        name
        for name, effect in CATALOGUE.items()
        if effect.searched_in(used) and (columns is None or effect.readable_in(columns))
    )


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
        "wrong column; check the logs"
    )


@dataclass(frozen=True, eq=False)
class StudyData:
    """What a study decides on."""

    observations: Observations
    noise: Noise
    error: ModelError | None
    """The model's own error; None if it is not known from other logs than these."""
    floor: Floor
    """What is known of the noise floor."""
    notes: tuple[str, ...]
    """What was chosen or assumed, in sentences."""
    learned: Learned | None = None
    """What the logs of the model's fit teach about its own error, where they are at hand."""


def study_data(dataset: Dataset, model: Model, options: GapOptions) -> StudyData:
    """Choose the runs that decide and measure their noise; the model's file may state its own error.

    Raises:
        InputError: no run has a measured sample.
    """
    runs, notes = _deciding_runs(dataset, model, options)
    observations = observe(replace(dataset, runs=runs))
    noise = measure_noise(dataset, observations)
    error = model_error_of(model)
    learned, fitted_on = None, options.fitted_on
    same_logs = error is not None and error.data_sha256 == dataset.sha256 != ""
    if fitted_on is not None:
        same_logs = same_logs or fitted_on.sha256 == dataset.sha256 != ""
        if fitted_on.level != dataset.level:
            raise InputError(
                f"fitted-on {fitted_on.name}: {fitted_on.level} logs, and those of the study are "
                f"{dataset.level} logs; give the logs that the model was fitted to"
            )
    if fitted_on is not None and not same_logs:
        learned = learn(model, fitted_on, Study(options.plant, options.jobs))
        error, noise = learned.error_in(observations), noise.beside(learned.whitener.noise)
        notes.append(
            f"compared with the logs of the fit ({fitted_on.name}): an error that these show, too, is no gap"
        )
    scattered = [name for name, source in noise.source.items() if source != "repeats"]
    if scattered:
        notes.append(
            f"no repeats for {', '.join(scattered)}: the noise is estimated from neighbouring samples of "
            "held commands"
        )
    trusted = not same_logs and (noise.from_repeats or error is not None)
    if same_logs:
        notes.append(
            "the model was fitted to these very logs: its own error is not known from others, so no set of "
            "effects is refused for what it leaves"
        )
    elif not trusted:
        notes.append(
            "no repeats, and the model states no error of its own: the residual may or may not be noise"
        )
    # A robot's wheels slip a little differently in each repeat; a wheel on the bench has no such excuse.
    bench = dataset.level == "bench"
    if bench and noise.inconsistent_channels(THRESHOLDS.inconsistent_repeats):
        notes.append(
            f"repeats of one command differ more than {THRESHOLDS.inconsistent_repeats:g} times as much as "
            "neighbouring samples: something that is not in the commands changes from run to run; look at "
            "the repeats"
        )
    repeatable = not (bench and noise.inconsistent_channels(THRESHOLDS.unrepeatable))
    if learned is not None and noise.is_like(learned.whitener.noise, THRESHOLDS.inconsistent_repeats):
        # Whatever acts at random did so in the logs of the fit, too.
        repeatable = True
    compared = learned is not None
    floor = Floor(
        noise.degrees_of_freedom,
        trusted,
        compared,
        compared and not bench,
        repeatable,
        familiar=learned is not None and learned.knows(observations),
        slack=THRESHOLDS.plainly_visible if compared and not bench else 1.0,
    )
    return StudyData(observations, noise, None if same_logs else error, floor, tuple(notes), learned)


def _deciding_runs(dataset: Dataset, model: Model, options: GapOptions) -> tuple[tuple[Run, ...], list[str]]:
    notes = []
    runs = dataset.split("fit") + dataset.split("validation")
    if not runs:
        runs = dataset.runs
        notes.append("all runs are test runs: they decide too, so nothing is left to check the decision")
    elif not dataset.split("test"):
        notes.append("no test runs: before and after are shown on runs that the decision has seen")
    seconds = EFFORT[dataset.level].log_s if options.seconds is None else options.seconds
    chosen = select_runs(runs, seconds, model.wheel.command_period_s)
    if any(run not in runs for run in chosen):
        notes.append(
            f"{len(chosen)} pieces of the runs ({_length_s(chosen):.0f} of {_length_s(runs):.0f} s) that "
            "cover the speeds decide; what grows with the time in a run is not seen in them"
        )
    elif len(chosen) < len(runs):
        notes.append(
            f"{len(chosen)} of {len(runs)} runs ({_length_s(chosen):.0f} s) decide: those with the most "
            "changes of command"
        )
    if options.plant == "planar":
        left = [name for name in known_effects("robot") if name not in known_effects("robot", "planar")]
        notes.append(f"simulated without slip (plant planar): {', '.join(left)} are not looked for")
    return chosen, notes


def _length_s(runs: Sequence[Run]) -> float:
    return sum(run.duration_s for run in runs)
