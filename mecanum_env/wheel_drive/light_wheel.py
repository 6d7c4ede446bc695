"""A wheel in the backlash of its gear that nothing but the gap and its own friction moves.

    its acceleration = swing^2 gap + 2 damping swing (motor's speed - its own) -+ slowing   [rad/s^2]

The `gap` is the angle by which the motor leads [rad], at most half the backlash. An elastic filling makes
the wheel swing, with an angular frequency [rad/s] of its own; without one only dry friction slows it. At an
end of the gap the two touch, and the wheel has the speed of the motor.

This speed is the setpoint of the servo. So the wheel is light: a robot that rolls on has no hand in it. The
motor is that of the setpoint, too: a friction that takes much of its speed makes it cross the gap later.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.parameters import Sets
from mecanum_env.wheel_drive.wheel_load import GAP_KINDS


def is_light(p: Sets) -> Any:
    """Return which of the parameters `p` are those of such a gap, of their shape."""
    return (p["gap_rad"] > 0.0) & (p["gap_kind"] == GAP_KINDS.index("light"))


def across_gap(
    p: Sets, motor: FloatArray, wheel: FloatArray, gap: FloatArray, timestep_s: float, xp: Any = np
) -> tuple[FloatArray, FloatArray]:
    """Return the wheel's speed after a substep [rad/s], and the motor's lead in the gap [rad].

    `p` are the parameters, `motor` is the speed of the motor at the end of the substep; `wheel` and `gap` are
    those at its start. Where the wheel is not light it has the speed of the motor, and the gap is left as it
    is. `xp` is the array module.
    """
    light = is_light(p)
    if not bool(light.any()):
        return motor, gap
    half, swing = p["gap_rad"] / 2, p["gap_swing_rad_s"]
    free = wheel + timestep_s * (swing * swing * gap + 2 * p["gap_damping"] * swing * (motor - wheel))
    stopped = timestep_s * p["gap_slowing_rad_s2"] + 0.0 * free
    speed = xp.where(xp.abs(free) <= stopped, 0.0 * free, free - xp.copysign(stopped, free))
    position = gap + timestep_s * (motor - speed)
    inside = xp.clip(position, -half, half)
    crossed = xp.where(inside == position, speed, motor - (inside - gap) / timestep_s)
    return xp.where(light, crossed, motor), xp.where(light, inside, gap)
