"""Whether logs hold the commands of other logs."""

from collections.abc import Sequence

import numpy as np

from sysid.compare.measured import Observations, observe
from sysid.compare.model_error.familiar import are_familiar
from sysid.logs import BenchCommand, Dataset, Run

ROW_S = 0.02


def steps(levels: Sequence[float], hold_s: float = 1.0, late_s: float = 0.0) -> Observations:
    """Return logs of a step from rest to each of the levels and back, of as many runs."""
    time = np.arange(0.0, 3.0, ROW_S)
    runs = []
    for number, level in enumerate(levels):
        on = (time >= 0.5 + late_s) & (time < 0.5 + late_s + hold_s)
        command = np.where(on, level, 0.0)
        name = f"run_{number}"
        runs.append(
            Run(f"{name}.csv", name, "fit", time, BenchCommand(command), {"speed_rpm": 0.9 * command})
        )
    return observe(Dataset("steps", tuple(runs), ()))


def test_the_same_steps_at_other_times_are_familiar() -> None:
    assert are_familiar(steps((20.0, -60.0, 100.0), late_s=0.13), steps((100.0, 20.0, -60.0)))


def test_some_of_the_steps_are_familiar() -> None:
    assert are_familiar(steps((20.0, 100.0)), steps((20.0, -60.0, 100.0)))


def test_other_levels_and_longer_holds_are_not() -> None:
    known = steps((20.0, -60.0, 100.0))
    assert not are_familiar(steps((20.0, -60.0, 90.0)), known)
    assert not are_familiar(steps((20.0, -60.0, 100.0), hold_s=2.0), known)
