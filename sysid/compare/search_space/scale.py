"""How fast and how stiff the drive of some logs is, which the ranges of a search follow."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.model import Model
from sysid.logs import Run


def scale_of(model: Model, runs: Sequence[Run]) -> Scale:
    """Return the scale of a model's drive in some runs.

    The top speed is the largest command or speed in the runs, at most the model's ceiling, or that ceiling if
    nothing moves. The rise time is that of the model's law. On the bench the torque has no limit. The length
    is that of the longest run, and the time between samples that of the run with the slowest ones.
    """
    ceiling = model.wheel.saturation_rpm
    top = min(max((_largest_rpm(run) for run in runs), default=0.0) or ceiling, ceiling)
    rise = law_step_metrics(model.wheel.law).rise_time_s
    bench = all(run.level == "bench" for run in runs)
    return Scale(
        top if math.isfinite(top) and top > 0.0 else REFERENCE.top_rpm,
        rise if math.isfinite(rise) and rise > 0.0 else REFERENCE.rise_s,
        model.robot.servo_n_m_s_rad,
        math.inf if bench else model.robot.torque_limit_n_m,
        max((run.duration_s for run in runs if run.duration_s > 0.0), default=REFERENCE.run_s),
        max((run.median_interval_s for run in runs if run.time_s.size > 1), default=REFERENCE.interval_s),
    )


def _largest_rpm(run: Run) -> float:
    speeds = [values[np.isfinite(values)] for name, values in run.channels.items() if name.endswith("_rpm")]
    return max(float(np.max(np.abs(v), initial=0.0)) for v in (run.command.wheels_rpm, *speeds))
