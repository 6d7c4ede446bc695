"""The runs that a study decides on: those of fit and validation, as far as there is time to simulate them."""

from __future__ import annotations

from collections.abc import Sequence

from mecanum_env.model import Model
from sysid.compare.measured import select_runs
from sysid.gap.result import GapOptions
from sysid.gap.search.known_effects import known_effects
from sysid.gap.search.thresholds import EFFORT
from sysid.logs import Dataset, Run


def deciding_runs(dataset: Dataset, model: Model, options: GapOptions) -> tuple[tuple[Run, ...], list[str]]:
    """Return the runs that decide, or pieces of them, and what was chosen, in sentences."""
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
            f"{len(chosen)} of {len(runs)} runs ({_length_s(chosen):.0f} s) decide: those that cover "
            "the speeds, with the most changes of command"
        )
    if options.plant == "planar":
        left = [name for name in known_effects("robot") if name not in known_effects("robot", "planar")]
        notes.append(f"simulated without slip (plant planar): no search for {', '.join(left)}")
    return chosen, notes


def _length_s(runs: Sequence[Run]) -> float:
    return sum(run.duration_s for run in runs)
