"""Several drives as one: parts whose numbers may be arrays (m,), one for each drive.

The parts of a single drive check their numbers; these do not.
"""

from __future__ import annotations

from typing import Any

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.wheel_load import WheelLoad


class Laws(WheelLaw):
    """Laws that differ in their coefficients, as one."""

    def __post_init__(self) -> None: ...


class _Drives(DriveParameters):
    def __post_init__(self) -> None: ...


class _Loads(WheelLoad):
    def __post_init__(self) -> None: ...


def several(drive: DriveParameters, **numbers: Any) -> DriveParameters:
    """Return a `drive` several times, as one, with some `numbers` that may differ."""
    own = vars(drive)
    return _Drives(**{**own, "load": _Loads(**vars(own["load"])), **numbers})
