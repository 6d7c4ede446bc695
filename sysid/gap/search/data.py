"""The runs that decide in a study, their noise, and what is known of the model's own error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mecanum_env.model import Model
from sysid.compare.model_error import ModelError, model_error_of
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.observations import Observations, observe
from sysid.compare.subset import select_runs
from sysid.gap.checks import known_effects
from sysid.gap.result import GapOptions
from sysid.gap.search.adequacy import Floor
from sysid.gap.search.thresholds import EFFORT, THRESHOLDS
from sysid.logs import Dataset, Run


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


def study_data(dataset: Dataset, model: Model, options: GapOptions) -> StudyData:
    """Choose the runs that decide and measure their noise; the model's file may state its own error.

    Raises:
        InputError: no run has a measured sample.
    """
    runs, notes = _deciding_runs(dataset, model, options)
    observations = observe(replace(dataset, runs=runs))
    noise = measure_noise(dataset, observations)
    scattered = [name for name, source in noise.source.items() if source == "scatter"]
    if scattered:
        notes.append(
            f"no repeats for {', '.join(scattered)}: the noise is estimated from neighbouring samples of "
            "held commands"
        )
    error = model_error_of(model)
    same_logs = error is not None and error.data_sha256 == dataset.sha256 != ""
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
    floor = Floor(noise.degrees_of_freedom, trusted, repeatable)
    return StudyData(observations, noise, None if same_logs else error, floor, tuple(notes))


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
