"""Whether a drive is of any use: a short drive at its top command, forwards and backwards."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.simulate import move

_RPM = 60.0 / (2.0 * math.pi)
_REST_S, _TOP_S, _HALF_S, _BACK_S, _STOP_S = 0.2, 4.0, 1.5, 2.0, 1.5
_LOOK_S = 0.5
"""At the end of each part, where the drive is looked at."""

SLOWEST_RISE_S = 3.0
LEAST_REACHED = 0.7
MOST_REACHED = 1.4
LARGEST_OVERSHOOT = 0.6
LARGEST_RIPPLE = 0.05


@dataclass(frozen=True)
class Trial:
    """What a drive did in its trial."""

    reached: float
    """Speed at the top command, as a share of it."""
    rise_s: float
    """From the top command to nine tenths of the speed that is reached."""
    overshoot: float
    """Beyond the speed that is reached, as a share of it."""
    ripple: float
    """Largest standard deviation of the speed under a constant command, as a share of the top command."""
    back: float
    """Speed at the top command backwards, as a share of it, and positive."""
    left: float
    """Size of the mean speed after the last command of 0, as a share of the top command."""

    @property
    def useful(self) -> bool:
        """Whether the drive is stable, reaches its speed and does so in time."""
        return bool(
            min(self.reached, self.back) >= LEAST_REACHED
            and max(self.reached, self.back) <= MOST_REACHED
            and self.rise_s <= SLOWEST_RISE_S
            and self.overshoot <= LARGEST_OVERSHOOT
            and self.ripple <= LARGEST_RIPPLE
            and self.left <= LARGEST_RIPPLE
        )


def try_out(drive: Drive) -> Trial:
    """Return what the drive does from rest to its top command, to half of it, to the reverse and to 0."""
    top = drive.top_rpm
    parts = ((_REST_S, 0.0), (_TOP_S, top), (_HALF_S, 0.5 * top), (_BACK_S, -top), (_STOP_S, 0.0))
    period_s = drive.link.period_s
    commands = np.concatenate([np.full(round(seconds / period_s), rpm) for seconds, rpm in parts])
    motion = move(drive, commands, np.random.default_rng(0))
    speed_rpm = motion.wheel_rad_s * _RPM
    changes_s = np.flatnonzero(np.diff(commands)) * period_s + period_s
    ends_s = np.append(changes_s[1:], len(commands) * period_s)

    def at_the_end(end_s: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        seen = speed_rpm[(motion.time_s >= end_s - _LOOK_S) & (motion.time_s < end_s)]
        return np.asarray(seen, dtype=np.float64)

    looks = [at_the_end(end_s) for end_s in ends_s]
    means = [float(look.mean()) for look in looks]
    rising = (motion.time_s >= changes_s[0]) & (motion.time_s < changes_s[1])
    high = speed_rpm[rising] >= 0.9 * means[0]
    first = int(np.argmax(high)) if high.any() else len(high)
    return Trial(
        reached=means[0] / top,
        rise_s=first * float(motion.time_s[1] - motion.time_s[0]),
        overshoot=float(speed_rpm[rising].max()) / max(means[0], 1e-9) - 1.0,
        ripple=max(float(look.std()) for look in looks) / top,
        back=-means[2] / top,
        left=abs(means[3]) / top,
    )
