"""Which parts any of many drives has, and with what functions they are computed.

The reference computes every part, with the C library's functions, so that it equals the plugin bit for bit.
A batch of robots leaves out what none of them has, and takes the functions of its array module, which may
differ in the last bit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from mecanum_env.law.arrays import exponentials, sines
from mecanum_env.wheel_drive.parameters import PROGRAMS


@dataclass(frozen=True)
class Parts:
    """Array module, elementary functions, and what to compute."""

    xp: Any = np
    """numpy or torch."""
    sines: Callable[[Any], Any] = sines
    exponentials: Callable[[Any], Any] = exponentials
    gap: bool = True
    """Backlash."""
    ripple: bool = True
    """A torque that follows the wheel's angle."""
    supply: bool = True
    """A torque limit that falls with speed."""
    custom: bool = True
    """A custom effect."""
    friction: bool = True
    """Friction of the bearing."""
    integral: bool = True
    """Integral action of the servo."""
    rotor: bool = True
    """Inertia of the motor's rotor."""

    @staticmethod
    def of(largest: Mapping[str, float], has_program: Mapping[str, bool], xp: Any) -> Parts:
        """Return what drives need, to be computed with the array module `xp`.

        `largest` are their largest parameters by name; `has_program` says which programs in `PROGRAMS` they
        have.
        """

        def acts(*names: str) -> bool:
            return any(largest[one] > 0.0 for one in names)

        return Parts(
            xp,
            xp.sin,
            xp.exp,
            gap=acts("gap_rad"),
            ripple=acts("ripple_n_m", "ripple_share"),
            supply=acts("supply_rpm"),
            custom=any(has_program[name] for name in PROGRAMS),
            friction=acts("coulomb_n_m", "breakaway_n_m", "friction_warm_share", "viscous_warm_share"),
            integral=acts("servo_integral_n_m_rad"),
            rotor=acts("rotor_kg_m2"),
        )

    def __reduce__(self) -> tuple[Any, ...]:
        # Modules are not copied or pickled.
        values = [getattr(self, field.name) for field in fields(self)]
        return _restored, (self.xp.__name__, *values[1:])


def _restored(module: str, *values: Any) -> Parts:
    return Parts(sys.modules[module], *values)


REFERENCE: Final = Parts()
"""Everything, equal to the plugin bit for bit."""
