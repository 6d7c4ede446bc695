"""The thresholds of a certificate, apart from it: the program's help needs nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from mecanum_env.errors import InputError
from mecanum_env.tankendo import Rules


@dataclass(frozen=True)
class Thresholds:
    """What a controller must reach; each is compared with the worse end of the metric's 95 % interval."""

    success: float = 0.75
    """Smallest success on the nominal plant."""
    worst_success: float = 0.60
    """Smallest success on the worst plant."""
    held_out_success: float = 0.60
    """Smallest success on the worst of the plants and opponents that no training has seen."""
    warning_s: float = 0.58
    """Longest warning needed for nine successes in ten, nominal plant [s]; the longest published."""
    tracking_m: float = Rules.band_m
    """Largest tracking error [m]: RMS of distance - maai behind an opponent that walks about. By default the
    largest that still counts as at maai."""
    settling_s: float = 1.0
    """Longest mean time until the robot is at maai and facing [s]."""
    overshoot: float = 0.25
    """Largest mean overshoot of the distance, relative to the distance to cover."""
    saturated_share: float = 0.5
    """Largest share of commands that ask a wheel for its maximum speed."""
    command_s: float = 0.1
    """Longest processor time per command, 99th percentile [s]; the robot takes a command every 0.1 s."""


def require_valid(thresholds: Thresholds) -> None:
    """Refuse thresholds that no metric can be compared with.

    Raises:
        InputError: one is not a number of at least 0, or a share is above 1.
    """
    for one in fields(thresholds):
        value = getattr(thresholds, one.name)
        most = (
            1.0
            if one.name in ("success", "worst_success", "held_out_success", "saturated_share")
            else math.inf
        )
        if not 0.0 <= value <= most:
            right = "a number from 0 to 1" if most == 1.0 else "a number of at least 0"
            raise InputError(f"thresholds: {one.name} = {value}, must be {right}")
