"""What most methods begin with: the simulator's error in both sets of logs, and whether it has grown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.logs import Run
from sysid.studies.gapbench.case_folder import CHANNEL, simulated
from sysid.studies.gapbench.cases import BenchCase

_GROWN: Final = 1.2
"""Error in the changed logs over that in the held-out nominal ones above which something has changed."""

TWINS: Final[Mapping[str, str]] = MappingProxyType(
    {"speed_gain": "sensor_scale", "command_latency": "sensor_latency"}
)
"""Name -> the one that no log of commands and one wheel's speed can tell from it."""


def errors(model: Model, runs: Sequence[Run]) -> list[FloatArray]:
    """Return measured minus simulated speed [rpm] of each run, shape (n,).

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    return [run.channels[CHANNEL] - simulated(model, run, known=True) for run in runs]


def rms_error(model: Model, runs: Sequence[Run]) -> float:
    """Return the rms of measured minus simulated speed [rpm] over all runs.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    return rms(np.concatenate(errors(model, runs)))


def usual_error(case: BenchCase) -> float:
    """Return the simulator's rms error [rpm] in nominal logs that it was not fitted to."""
    held_out = [run for run in case.nominal.runs if run.split != "fit"]
    return rms_error(case.model, held_out or case.nominal.runs)


def has_changed(case: BenchCase) -> bool:
    """Return whether the simulator's error is clearly larger in the changed logs than in the nominal ones."""
    return rms_error(case.model, case.changed.runs) > _GROWN * usual_error(case)
