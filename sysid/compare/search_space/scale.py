"""How fast and how stiff the drive of some logs is, which the ranges of a search follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.logs import Run

_MOST_THRESHOLDS: Final = 32
"""Most thresholds that a search tries, over all sizes where commands hardly repeat, as those of joysticks."""
_SAME_SHARE: Final = 0.005
"""Share of the top speed within which sizes of commands count as one. Assumed."""


def scale_of(model: Model, runs: Sequence[Run]) -> Scale:
    """Return the scale of a model's drive in some runs.

    The top speed is the largest command or speed in the runs, at most the model's ceiling, or that ceiling if
    nothing moves. The rise time is that of the model's law. On the bench the torque has no limit, and there
    are thresholds between all sizes of commands. The length is that of the longest run, and the time between
    samples that of the run with the slowest ones.
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
        _thresholds_rpm([run.command.wheels_rpm for run in runs], top) if bench else (),
    )


def _thresholds_rpm(commands_rpm: Sequence[FloatArray], top_rpm: float) -> tuple[float, ...]:
    """Return speeds between neighbouring sizes of commands [rpm], in rising order."""
    same = _SAME_SHARE * top_rpm
    sizes = np.unique(np.round(np.abs(np.concatenate([[0.0], *map(np.ravel, commands_rpm)])) / same))
    between = 0.5 * (sizes[1:-1] + sizes[2:]) * same
    kept = np.unique(np.linspace(0.0, between.size - 1.0, min(between.size, _MOST_THRESHOLDS)).round())
    return tuple(between[kept.astype(int)].tolist())


def _largest_rpm(run: Run) -> float:
    speeds = [values[np.isfinite(values)] for name, values in run.channels.items() if name.endswith("_rpm")]
    return max(float(np.max(np.abs(v), initial=0.0)) for v in (run.command.wheels_rpm, *speeds))
