"""What a study decides on: the runs, their noise, and what is known of the model's own error."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from sysid.compare.measured import Observations, observe
from sysid.compare.model_error import (
    Learned,
    ModelError,
    RepeatedCommands,
    learn,
    model_error_of,
    repeated_commands,
)
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import SimulationSettings
from sysid.gap.result import GapOptions
from sysid.gap.search.chance import Floor
from sysid.gap.search.deciding_runs import deciding_runs
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import Dataset

_UNREACHED: Final = 0.02
"""Least share of the steady speed, never reached in the logs of a fit, for a note. Assumed: what `sysid.fit`
says of a gain other than 1."""


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
    repeated: RepeatedCommands | None = None
    """What these logs show in the same commands, if these were driven again."""


def study_data(dataset: Dataset, model: Model, options: GapOptions) -> StudyData:
    """Choose the runs that decide and measure their noise; the model's file may state its own error.

    Raises:
        InputError: no run has a measured sample.
    """
    runs, notes = deciding_runs(dataset, model, options)
    observations = observe(replace(dataset, runs=runs))
    noise = measured = measure_noise(dataset, observations)
    error = model_error_of(model)
    learned, repeated, fitted_on = None, None, options.fitted_on
    same_logs = error is not None and error.data_sha256 == dataset.sha256 != ""
    if fitted_on is not None:
        same_logs = same_logs or fitted_on.sha256 == dataset.sha256 != ""
        if fitted_on.level != dataset.level:
            raise InputError(
                f"fitted-on {fitted_on.name}: {fitted_on.level} logs, and those of the study are "
                f"{dataset.level} logs; give the logs that the model was fitted to"
            )
    if fitted_on is not None and not same_logs:
        settings = SimulationSettings(options.plant, options.jobs)
        repeated = repeated_commands(model, fitted_on, observations, settings)
        if repeated is not None:
            notes.append(_repeated_note(observations, repeated))
            observations, error = repeated.observations, None
            noise = repeated.noise.beside(noise)
        else:
            learned = learn(model, fitted_on, settings)
            error, noise = learned.error_in(observations), noise.beside(learned.whitener.noise)
            notes += _limits_of(learned, observations)
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
    repeatable = not (bench and measured.inconsistent_channels(THRESHOLDS.unrepeatable))
    earlier = [repeated.measured] if repeated else [learned.whitener.noise] if learned else []
    if any(measured.is_like(noise_then, THRESHOLDS.inconsistent_repeats) for noise_then in earlier):
        # Whatever acts at random did so in the logs of the fit, too.
        repeatable = True
    compared = learned is not None or repeated is not None
    floor = Floor(
        noise.degrees_of_freedom,
        trusted,
        compared,
        compared and not bench,
        repeatable,
        calibrated=repeated is not None and bench,
        familiar=repeated is not None or (learned is not None and learned.knows(observations)),
        slack=THRESHOLDS.plainly_visible if learned is not None and not bench else 1.0,
    )
    if repeated is not None:
        floor = replace(floor, freedom=repeated.freedom, independent=repeated.freedom)
    elif learned is not None and not bench:
        sequences = len({situation.group for situation in observations.situations})
        floor = replace(floor, independent=learned.freedom * sequences)
    stated = None if same_logs else error
    return StudyData(observations, noise, stated, floor, tuple(notes), learned, repeated)


def _limits_of(learned: Learned, observations: Observations) -> Iterator[str]:
    """Yield what a study of some observations cannot see because of the logs of the model's fit."""
    if (ratio := learned.noise_ratio) > THRESHOLDS.above_noise:
        yield (
            f"the model misses the logs of its own fit by {math.sqrt(ratio):.2g} times the noise (rms), "
            "which hides smaller changes; where the commands of the fit are driven again, it cancels"
        )
    if learned.unreached > _UNREACHED and not learned.knows(observations):
        yield (
            "in the logs of the fit each command ended before the wheel had settled, at "
            f"{1.0 - learned.unreached:.0%} of the model's steady speed at most: the model's gain may be off "
            "by the rest, which is no gap; a fit to logs that hold their commands for longer knows the gain"
        )


def _repeated_note(observations: Observations, repeated: RepeatedCommands) -> str:
    driven, shared = (
        len({situation.group for situation in logs.situations})
        for logs in (observations, repeated.observations)
    )
    which = "the command sequences are" if shared == driven else f"{shared} of {driven} command sequences are"
    alone = "" if shared == driven else ", and decide alone"
    return f"{which} those of the logs of the fit: the two are compared command by command{alone}"
