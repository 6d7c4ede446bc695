"""What every simulation of a study needs besides the model, as one value that is passed on whole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mecanum_env.model import Model, Wheel
from mecanum_env.simulator import RobotPlant
from sysid.logs import Run


@dataclass(frozen=True)
class Study:
    """The settings of every simulation in a study: search, held-out comparison, design of experiments."""

    plant: RobotPlant = "rollers"
    """How a robot is simulated; bench logs have no robot."""
    jobs: int = 1
    """Simulations at a time; results do not depend on it."""
    timestep_s: float | None = None
    """Upper bound of the physics step [s]; None: the generator's choice."""
    seed: int = 0
    """Seed of simulated thresholds, bootstrap and the design of experiments."""
    scale: float = 1.0
    """Factor on the catalogue's bounds and scan grids in rpm and rpm/s (`speed_scale`)."""


def speed_scale(model: Model, runs: Sequence[Run]) -> float:
    """Return the factor for bounds and scan grids in rpm and rpm/s: 1 for robots about as fast as ours.

    The catalogue's are for the packaged wheel, whose ceiling is `Wheel.saturation_rpm`. A model's ceiling
    says how fast its wheel is; where it has none, the fastest command or speed of the logs does. The ratio is
    rounded to a power of two, about the step of the grids: finer would change nothing.

    Args:
        model: its ceiling counts.
        runs: bench or robot logs.
    """
    top = model.wheel.saturation_rpm
    if not math.isfinite(top):
        top = max((_fastest_rpm(run) for run in runs), default=0.0)
    return 2.0 ** round(math.log2(top / Wheel.saturation_rpm)) if top > 0.0 else 1.0


def _fastest_rpm(run: Run) -> float:
    speeds = [values[np.isfinite(values)] for name, values in run.channels.items() if name.endswith("_rpm")]
    return max(float(np.max(np.abs(v), initial=0.0)) for v in (run.command.wheels_rpm, *speeds))
