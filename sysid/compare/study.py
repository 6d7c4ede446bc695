"""The settings that every simulation of a study shares, as one value that is passed on whole."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mecanum_env.model import Model, Wheel
from mecanum_env.simulator import RobotPlant
from sysid.logs import Run

T = TypeVar("T")
U = TypeVar("U")


@dataclass(frozen=True)
class Study:
    """The settings of every simulation in a study: search, held-out comparison, design of experiments."""

    plant: RobotPlant = "rollers"
    """How a robot is simulated; the bench has one plant only."""
    jobs: int = 1
    """Simulations that run at the same time; results do not depend on it."""
    timestep_s: float | None = None
    """Upper bound of the physics step [s]; None: the choice of the MJCF generator."""
    seed: int = 0
    """Seed of simulated thresholds, of the bootstrap and of the design of experiments."""
    scale: float = 1.0
    """Factor on the catalogue's bounds and scan grids in rpm and rpm/s, from `speed_scale`."""

    def map(self, work: Callable[[T], U], items: Iterable[T]) -> list[U]:
        """Return `work` of each of the `items`, in order, `jobs` at a time."""
        if self.jobs == 1:
            return [work(item) for item in items]
        # MuJoCo releases the interpreter lock while it steps, so threads suffice.
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(work, items))


def speed_scale(model: Model, runs: Sequence[Run]) -> float:
    """Return the factor on bounds and scan grids in rpm and rpm/s: 1 for a wheel as fast as the packaged one.

    The catalogue is made for the packaged wheel, whose ceiling is `Wheel.saturation_rpm`. The speed of
    another wheel is its model's ceiling or, if the model has none, the largest command or speed in the logs.
    The ratio is rounded to a power of two, about one step of the scan grids.

    Args:
        model: gives the ceiling.
        runs: bench or robot logs.
    """
    top = model.wheel.saturation_rpm
    if not math.isfinite(top):
        top = max((_largest_rpm(run) for run in runs), default=0.0)
    return 2.0 ** round(math.log2(top / Wheel.saturation_rpm)) if top > 0.0 else 1.0


def _largest_rpm(run: Run) -> float:
    speeds = [values[np.isfinite(values)] for name, values in run.channels.items() if name.endswith("_rpm")]
    return max(float(np.max(np.abs(v), initial=0.0)) for v in (run.command.wheels_rpm, *speeds))
