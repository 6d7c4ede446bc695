"""How fast and how stiff a drive is: what the ranges of a search are in proportion to.

The catalogue states its ranges for one reference drive. A search on the logs of another drive scales them:
speeds with the largest speed of the logs, what would change nothing in them left out; rates with that speed
over the time in which the drive rises, since a limit far above shows nothing and one far below never lets the
wheel arrive; torques with the torque that would take all of that speed, so that any droop can be reached;
drifts with the inverse length of the runs, since what is slow in minutes must be fast to show in seconds;
frequencies with the rate of the samples where that is low, since they do not show faster ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from mecanum_env.units import RAD_S_PER_RPM

_TOP_RPM, _RISE_S = 135.0, 0.125  # of the reference drive
_RUN_S: Final = 10.0  # of the reference logs
_INTERVAL_S: Final = 0.025
"""Time between samples [s] up to which all frequencies of the catalogue are searched.

The highest of them, 15 Hz, is three eighths of that sampling rate; half of the rate could be seen at best."""


@dataclass(frozen=True)
class Scale:
    """What a drive and its logs show; the default is the reference drive."""

    top_rpm: float = _TOP_RPM
    """Largest speed that is commanded or reached [rpm]."""
    rise_s: float = _RISE_S
    """Time in which the drive follows a step from 10 to 90 % [s]."""
    servo_n_m_s_rad: float = 5.0
    """Torque per speed that the drive loses [N m s/rad]. On the bench only ratios to it show."""
    torque_limit_n_m: float = math.inf
    """Largest torque of the drive on its wheel [N m], beyond which a load stops it."""
    run_s: float = _RUN_S
    """Length of the longest run [s]."""
    interval_s: float = _INTERVAL_S
    """Time between samples, of the run that has the fewest in a second [s]."""
    thresholds_rpm: tuple[float, ...] = ()
    """Wheel speeds between the sizes of neighbouring commands [rpm]: what a threshold between two others does
    is what one of these does."""

    @property
    def torque_n_m(self) -> float:
        """Torque that takes all of the top speed, or that the drive gives at most [N m]."""
        return min(self.servo_n_m_s_rad * self.top_rpm * RAD_S_PER_RPM, self.torque_limit_n_m)

    def factor(self, unit: str, *, relative: bool = False) -> float:
        """Return the factor on a range that the catalogue states in a `unit`.

        It is a power of two for speeds and rates, about one step of the scan grids, at least 1 for drifts
        ("1/s"), which long runs show as well if they are fast, at most 1 for frequencies ("Hz"), and 1 for
        other units.
        `relative`: the range is one of shares, in "s" of the longest run, in "N m" of the `torque_n_m`, in
        "N m s/rad" of the damping that takes this torque at the top speed.
        """
        if relative:
            return _SHARES_OF[unit](self)
        if unit == "1/s":
            return max(1.0, _RUN_S / self.run_s)
        if unit == "Hz":
            return min(1.0, _INTERVAL_S / self.interval_s)
        power = _POWERS.get(unit)
        if power is None:
            return 1.0
        speed, rise = power
        return 2.0 ** round(math.log2((self.top_rpm / _TOP_RPM) ** speed * (_RISE_S / self.rise_s) ** rise))


_POWERS: Final[Mapping[str, tuple[int, int]]] = MappingProxyType(
    {"rpm": (1, 0), "rpm/s": (1, 1), "rpm/s2": (1, 2)}
)
"""Unit -> powers of top speed and of the inverse rise time in it."""
_SHARES_OF: Final[Mapping[str, Callable[[Scale], float]]] = MappingProxyType(
    {
        "s": lambda scale: scale.run_s,
        "N m": lambda scale: scale.torque_n_m,
        "N m s/rad": lambda scale: scale.torque_n_m / (scale.top_rpm * RAD_S_PER_RPM),
    }
)
REFERENCE: Final = Scale()
"""The drive for which the catalogue states its ranges."""
