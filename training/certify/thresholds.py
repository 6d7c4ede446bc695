"""What a controller must reach; apart from the certificate, since printing the program's help reads it."""

from __future__ import annotations

from dataclasses import dataclass

from mecanum_env.tankendo import Rules


@dataclass(frozen=True)
class Thresholds:
    """What it takes to pass; each is held against the worse end of the figure's 95 % interval."""

    success: float = 0.75
    """Least success on the nominal plant."""
    worst_success: float = 0.60
    """Least success on the worst plant."""
    warning_s: float = 0.58
    """Most warning that it may need for nine successes in ten, nominal plant [s]: the longest published."""
    tracking_m: float = Rules.band_m
    """Largest tracking error: rms of distance - maai behind an opponent that walks about [m]; by default as
    far off as still counts as at maai."""
    settling_s: float = 1.0
    """Longest mean time until at maai and facing [s]."""
    overshoot: float = 0.25
    """Largest mean overshoot of the distance, over the distance to cover."""
    saturated_share: float = 0.5
    """Largest share of commands that ask a wheel for its ceiling."""
    command_s: float = 0.1
    """Longest processor time for a command, 99 of 100 [s]; the robot takes one every 0.1 s."""
