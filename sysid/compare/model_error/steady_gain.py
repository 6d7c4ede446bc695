"""How far the steady speeds of a model are from what the logs of its fit could show.

Where every command of the fit ended before the wheel had settled, the speed that it would have reached is the
law's extrapolation. A drive behind a ramp, say, answers short holds as a slower law of a smaller gain would,
and only longer ones tell the two apart. So the gain may be off by the rest of the way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from sysid.compare.measured import Observations, changes_from_rest
from sysid.logs import Run


def unreached_share(model: Model, observations: Observations) -> float:
    """Return which share of its steady speed a law is short of throughout bench logs, 0 if it gets there."""
    law = model.wheel.law
    runs = [situation.runs[0] for situation in observations.situations]
    return max(0.0, 1.0 - max((_reached(law, run) for run in runs), default=0.0))


def _reached(law: WheelLaw, run: Run) -> float:
    """Return the largest speed that a law reaches in a run, in steady speeds of the largest command."""
    times, levels = changes_from_rest(run)
    ticks = np.arange(0.0, run.time_s[-1] - run.time_s[0], law.sample_period_s) + run.time_s[0]
    commands = levels[np.clip(np.searchsorted(times, ticks, side="right") - 1, 0, None), 0]
    steady = abs(law.dc_gain) * float(np.max(np.abs(levels)))
    return float(np.max(np.abs(law.simulate(commands)), initial=0.0)) / steady if steady > 0.0 else 0.0


def with_other_gain(model: Model, share: float) -> Model:
    """Return a model whose steady speeds are larger by a `share`."""
    law = model.wheel.law
    times = 1.0 + share
    return replace(
        model, wheel=replace(model.wheel, law=replace(law, D=times * law.D, E=times * law.E, F=times * law.F))
    )
