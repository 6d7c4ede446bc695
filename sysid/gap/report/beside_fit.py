"""What is left of a gap beside the logs of the model's fit, where the same commands were driven.

A model errs in a command sequence by the same before and after a change. Its mean residual in the logs of its
fit is therefore taken off the measured values, sample by sample: what is left of the difference is what
changed, and the noise of both logs. A recording is none beside itself: of logs that the model was fitted to
only the repeats count. Beside a model that is far from its robot this is the only figure that
shows whether an effect closed the gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.kinematics import POSE
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error import as_fitted, with_same_commands
from sysid.compare.predicted import SimulationSettings, predict
from sysid.gap.report.held_out import Channels, Comparison, differences
from sysid.gap.report.samples import Samples
from sysid.gap.result import Difference
from sysid.logs import Dataset, Run


def gap_beside_fit(
    dataset: Dataset,
    fitted_on: Dataset,
    model: Model,
    comparison: Comparison,
    runs: Sequence[Run],
    noise: Mapping[str, float],
    settings: SimulationSettings,
) -> Difference | None:
    """Return the gap on held-out runs without what the model errs by in the logs of its fit.

    The noise floor is that of the difference: n repeats in the logs of the fit add a share of 1 / n to the
    variance of a run. Poses are left out, since their errors depend on where a run began.

    Args:
        dataset: the new logs.
        fitted_on: the logs of the model's fit.
        model: as given; what it adopted after its fit is taken off it for these logs.
        comparison: of the held-out runs.
        runs: these runs.
        noise: of each channel, as for `differences`.
        settings: of simulations.

    Returns:
        None if none of the runs was driven in another recording of the logs of the fit.

    Raises:
        InputError: the model cannot be simulated.
    """
    given, period_s = as_fitted(model), model.wheel.command_period_s
    known: dict[Run, Channels] = {}
    samples: list[Samples] = []
    shares: list[float] = []
    for run in runs:
        others = [other for other in fitted_on.runs if not _is_same_recording(run, other)]
        partners = with_same_commands(run, others, period_s)
        for partner in partners:
            if partner not in known:
                known[partner] = _residuals(partner, predict(given, partner, settings=settings))
        if not partners:
            continue
        beside = [_Shifted(known[partner], partner.time_s - shift) for partner, shift in partners.items()]
        for part in comparison.samples:
            own = [one.at(part) for one in beside if part.run == run.file and part.channel in one.residuals]
            if own:
                samples.append(replace(part, measured=part.measured - np.mean(own, axis=0)))
                shares.append(1.0 / len(own))
    if not samples:
        return None
    noise_factor = math.sqrt(1.0 + float(np.mean(shares)))
    beside_fit = Comparison(comparison.split, tuple(samples))
    return differences(dataset, beside_fit, noise, fitted_on, noise_factor)[0]


def _is_same_recording(one: Run, other: Run) -> bool:
    """Return whether two runs have the same samples."""
    return one.channels.keys() == other.channels.keys() and all(
        np.array_equal(values, other.channels[name], equal_nan=True) for name, values in one.channels.items()
    )


@dataclass(frozen=True, eq=False)
class _Shifted:
    """The residuals of a run of the fit on the clock of a new run."""

    residuals: Channels
    time_s: FloatArray

    def at(self, part: Samples) -> FloatArray:
        """Return the residual in the channel of some samples at their times; NaN beyond the run."""
        values = self.residuals[part.channel]
        measured = np.isfinite(values)
        at: FloatArray = np.interp(part.time_s, self.time_s[measured], values[measured], np.nan, np.nan)
        return at


def _residuals(run: Run, predicted: Channels) -> dict[str, FloatArray]:
    """Return measured minus predicted of each channel of a run that has samples, poses left out."""
    found = {name: run.channel(name) - values for name, values in predicted.items() if name not in POSE}
    return {name: residual for name, residual in found.items() if np.any(np.isfinite(residual))}
