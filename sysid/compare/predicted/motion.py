"""The motion in a run, and that of free wheels in several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mecanum_env.effects.apply import Sensors
from mecanum_env.simulator.free_wheel import BenchRuns, FreeWheel, wheel_motions
from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion in a run: the true one, or as sensors see it."""

    time_s: FloatArray
    """Physics clock from the start of the simulation [s], shape (n,)."""
    channels: Mapping[str, FloatArray]
    """Column of a log -> values on that clock, shape (n,)."""
    lead_s: float = 0.0
    """Time simulated before the log starts [s]."""

    def seen_by(self, sensors: Sensors) -> Motion:
        """Return what the sensors show of the motion."""
        return Motion(self.time_s, sensors(self.time_s, self.channels), self.lead_s)


def bench_motions_of(wheel: FreeWheel, runs: BenchRuns) -> list[Motion]:
    """Return the true motion of a free wheel in each of the `runs`, simulated together.

    Raises:
        SimulationDivergedError: the state of any wheel stopped being finite.
    """
    (found,) = wheel_motions([wheel], runs)
    return [Motion(clock, {"speed_rpm": speed}) for clock, speed in found]
