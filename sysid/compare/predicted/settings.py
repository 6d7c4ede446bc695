"""How models are simulated throughout a study."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.parallel import map_in_threads
from mecanum_env.simulator import RobotPlant

T = TypeVar("T")
U = TypeVar("U")


@dataclass(frozen=True)
class SimulationSettings:
    """How models are simulated throughout a study: search, held-out comparison, design of experiments."""

    plant: RobotPlant = "rollers"
    """How a robot is simulated; the bench has one plant only."""
    jobs: int = 1
    """Simulations that run at the same time; results do not depend on it."""
    timestep_s: float | None = None
    """Upper bound of the physics step [s]; None: the choice of the MJCF generator."""
    seed: int = 0
    """Seed of simulated thresholds, of the bootstrap and of the design of experiments."""
    scale: Scale = REFERENCE
    """What the ranges of a search are in proportion to, from `sysid.compare.search_space.scale`."""

    def map(self, work: Callable[[T], U], items: Iterable[T]) -> list[U]:
        """Return `work` of each of the `items`, in order, `jobs` at a time."""
        return map_in_threads(work, items, self.jobs)
