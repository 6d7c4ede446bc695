"""Whether logs can show a gap at all: a dead sensor would pass for an effect, or stop the arithmetic."""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from sysid.logs import Dataset

_LEAST_SAMPLES: Final = 7  # as for a fit


def require_movement(dataset: Dataset) -> None:
    """Check that something moves in the logs.

    Args:
        dataset: bench or robot logs.

    Raises:
        InputError: fewer samples than a fit takes, or no measured channel that ever changes.
    """
    values: dict[str, list[FloatArray]] = {}
    for run in dataset.runs:
        for name, channel in run.channels.items():
            if name != "battery_v":
                values.setdefault(name, []).append(channel[np.isfinite(channel)])
    measured = {name: np.concatenate(parts) for name, parts in values.items()}
    samples, runs = sum(one.size for one in measured.values()), f"{len(dataset.runs)} run(s)"
    if samples < _LEAST_SAMPLES:
        raise InputError(f"{samples} samples in {runs}, at least {_LEAST_SAMPLES} are needed to tell a gap")
    if any(one.size and np.ptp(one) > 0.0 for one in measured.values()):
        return
    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
    if asked == 0.0:
        raise InputError(
            f"the command is 0 throughout and nothing moves, so nothing can be learnt from {runs} starting "
            f"with {dataset.runs[0].file}; record a step from rest"
        )
    still = " and ".join(f"{name} is {one[0]:g}" for name, one in measured.items() if one.size)
    raise InputError(
        f"{still} in every sample while wheels are commanded up to {asked:g} rpm: a dead sensor or the wrong "
        "column; check the logs"
    )
