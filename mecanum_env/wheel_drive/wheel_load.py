"""What stands between a drive's setpoint and its wheel: gear, bearing, and the lag of the drive's answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mecanum_env.errors import InputError

GAP_KINDS: Final = ("coast", "light")
"""What the wheel does while the motor crosses the backlash, in the order of the plugin's numbers."""


@dataclass(frozen=True)
class WheelLoad:
    """What loads the drive of a wheel.

    Raises:
        InputError: a value out of range.
    """

    gap_rad: float = 0.0
    """Backlash between motor and wheel [rad]."""
    gap_kind: str = "coast"
    """One of GAP_KINDS: the wheel runs on under its load; only the gap and its own friction move it."""
    gap_swing_rad_s: float = 0.0
    """Angular frequency at which a light wheel swings on an elastic filling of the gap [rad/s]; 0: none."""
    gap_damping: float = 0.0
    """Damping ratio of that swing."""
    gap_slowing_rad_s2: float = 0.0
    """Rate at which dry friction slows a light wheel in the gap [rad/s^2]."""
    breakaway_n_m: float = 0.0
    """Friction torque of the wheel's bearing at rest beyond that in motion [N m]."""
    stribeck_rad_s: float = 0.0
    """Speed at which 63 % of the breakaway torque is gone [rad/s]."""
    coulomb_n_m: float = 0.0
    """Friction torque of the wheel's bearing at any speed [N m]."""
    viscous_n_m_s_rad: float = 0.0
    """Viscous friction of the bearing [N m s/rad]. The engine's joint has it; here it is what may warm up."""
    friction_warm_share: float = 0.0
    """Share of the bearing's dry friction, at rest and in motion, that is lost when it is warm."""
    friction_warm_s: float = 0.0
    """Time constant of that loss, and of that of viscous friction [s]; 0: none."""
    ripple_n_m: float = 0.0
    """Amplitude of a torque that follows the wheel's angle [N m]."""
    ripple_share: float = 0.0
    """Amplitude in proportion to speed: share of the servo's stiffness."""
    ripple_per_turn: float = 0.0
    """Periods of that torque in one turn of the wheel."""
    ripple_phase_rad: float = 0.0
    """Phase of that torque where the run starts [rad]."""
    answer_s: float = 0.0
    """Lag of the drive's answer to a load [s]: that of a rotor which the servo accelerates."""
    viscous_warm_share: float = 0.0
    """Share of the bearing's viscous friction that is lost when it is warm."""

    def __post_init__(self) -> None:
        if self.gap_kind not in GAP_KINDS:
            raise InputError(f"gap_kind = {self.gap_kind!r}, must be one of {', '.join(GAP_KINDS)}")
        for name, value in vars(self).items():
            if name in ("gap_kind", "ripple_phase_rad"):
                continue
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{name} = {value}, must be finite and not below 0")
        if not math.isfinite(self.ripple_phase_rad):
            raise InputError(f"ripple_phase_rad = {self.ripple_phase_rad}, must be finite")
        for name in ("friction_warm_share", "viscous_warm_share"):
            if getattr(self, name) > 1.0:
                raise InputError(f"{name} = {getattr(self, name)}, must be at most 1")

    @property
    def acts(self) -> bool:
        """Whether anything here differs from a rigid drive with a bearing free of friction.

        The phase of no torque and the viscous friction, which is the engine's, do not count.
        """
        sizes = ("gap_rad", "breakaway_n_m", "coulomb_n_m", "ripple_n_m", "ripple_share", "answer_s")
        return any(getattr(self, name) > 0.0 for name in sizes)


NO_LOAD: Final = WheelLoad()
"""A rigid drive with a bearing free of friction."""
