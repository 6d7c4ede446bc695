"""Scripts of a whole dodge with known strike: waiting motion, evasion, return; many side by side.

A script waits at a distance, perhaps creeping sideways; evades with one velocity, perhaps with another one
before; and returns to the opponent. Its numbers are drawn at random, or near those of scripts that did well.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import scale_wheels, twist_to_wheels, wheels_to_command
from mecanum_env.model import Robot
from mecanum_env.tankendo.actions import FULL_VC_RPM
from mecanum_env.units import FloatArray

_CREEPS_M_S: Final = np.array([0.0, 0.2, -0.2])
_WAIT_GAIN_PER_S: Final = 2.0
_FASTEST_M_S: Final = 2.0
"""Speed that an evasion asks for [m/s]; the command is scaled to what the wheels can do."""
_SPREADS: Final = {"wait_m": 0.04, "angle": 0.3, "first_angle": 0.3, "evade_s": 0.08, "change_s": 0.06}
"""Standard deviations around a script that did well: [m], [rad], [rad], [s], [s]."""


@dataclass(frozen=True)
class Scripts:
    """n scripts; arrays of shape (n,). Angles are from the direction towards the opponent."""

    creep_m_s: FloatArray
    """Sideways speed while waiting, positive to the robot's left [m/s]."""
    wait_m: FloatArray
    """Distance beyond maai that it waits at [m]."""
    evade_s: FloatArray
    """Time before the hit at which the evasion begins [s]."""
    first_angle: FloatArray
    """Direction of the evasion at first [rad]."""
    change_s: FloatArray
    """Time before the hit from which it has its final direction [s]."""
    angle: FloatArray
    """Final direction of the evasion [rad]."""
    return_s: FloatArray
    """Time before the hit at which the return begins [s]."""
    gain_per_s: FloatArray
    """Gain of the return [1/s]."""

    def __len__(self) -> int:
        """Return n."""
        return len(self.angle)

    def near(self, best: npt.NDArray[np.intp], rng: np.random.Generator) -> Scripts:
        """Return scripts near those with the indices `best`, drawn with the generator `rng`."""
        numbers = {}
        for one in fields(self):
            values = getattr(self, one.name)[best]
            numbers[one.name] = values + _SPREADS.get(one.name, 0.0) * rng.standard_normal(len(best))
        return Scripts(**numbers)

    def joined(self, other: Scripts) -> Scripts:
        """Return these scripts and those of the other, in this order."""
        pairs = {one.name: (getattr(self, one.name), getattr(other, one.name)) for one in fields(self)}
        return Scripts(**{name: np.concatenate(pair) for name, pair in pairs.items()})


def random_scripts(n: int, rng: np.random.Generator) -> Scripts:
    """Return n scripts drawn with the generator `rng`; half of them keep one direction."""
    angle = rng.uniform(-np.pi, np.pi, n)
    evade, once = rng.uniform(0.2, 0.75, n), rng.random(n) < 0.5
    return Scripts(
        creep_m_s=rng.choice(_CREEPS_M_S, n),
        wait_m=rng.uniform(-0.1, 0.15, n),
        evade_s=evade,
        first_angle=np.where(once, angle, rng.uniform(-np.pi, np.pi, n)),
        change_s=np.where(once, 9.0, evade - rng.uniform(0.1, 0.4, n)),
        angle=angle,
        return_s=rng.choice([0.0, 0.05, 0.1, 0.15], n),
        gain_per_s=rng.choice([2.0, 3.0, 4.0], n),
    )


def script_twists(
    scripts: Scripts,
    scene: FloatArray,
    *,
    maai_m: float,
    left_s: FloatArray,
    home: FloatArray,
    towards_rad: FloatArray,
) -> FloatArray:
    """Return the twists that scripts want: ahead, left [m/s], turn [rad/s], shape (n, 3).

    Args:
        scripts: n scripts.
        scene: where the players are, shape (11, n).
        maai_m: the rules' striking distance.
        left_s: time until the hit, infinite before the opponent decides, shape (n,).
        home: where the opponent stood when it decided to strike, or stands, shape (2, n) [m].
        towards_rad: direction towards the opponent in the field when it decided, or now, shape (n,).
    """
    dx, dy = home[0] - scene[0], home[1] - scene[1]
    distance = np.maximum(np.hypot(dx, dy), 1e-6)
    x, y = dx / distance, dy / distance
    returns = left_s <= scripts.return_s
    evades = ~returns & (left_s <= scripts.evade_s)
    gain = np.where(returns, scripts.gain_per_s, _WAIT_GAIN_PER_S)
    closing = gain * (distance - maai_m - np.where(returns, 0.0, scripts.wait_m))
    creep = np.where(returns, 0.0, scripts.creep_m_s)
    vx, vy = closing * x - creep * y, closing * y + creep * x
    angle = towards_rad + np.where(left_s <= scripts.change_s, scripts.angle, scripts.first_angle)
    vx = np.where(evades, _FASTEST_M_S * np.cos(angle), vx)
    vy = np.where(evades, _FASTEST_M_S * np.sin(angle), vy)
    bearing = (np.arctan2(dy, dx) - scene[2] + np.pi) % (2.0 * np.pi) - np.pi
    turn = np.where(evades, 0.0, gain * bearing)
    cos, sin = np.cos(scene[2]), np.sin(scene[2])
    return np.stack([cos * vx + sin * vy, cos * vy - sin * vx, turn], axis=1)


def twist_commands(twists: FloatArray, robot: Robot, limit_rpm: float) -> FloatArray:
    """Return the commands V, theta, VC in whole numbers, shape (n, 3), of body twists, shape (n, 3).

    As `twist_command`: what exceeds the wheels' limit, or the largest VC, is scaled, turn included.
    """
    wheels = scale_wheels(twist_to_wheels(twists, robot), limit_rpm)
    v, theta, vc = wheels_to_command(wheels)
    share = np.minimum(1.0, FULL_VC_RPM / np.maximum(np.abs(vc), 1e-9))
    return np.rint(np.stack([v * share, theta, vc * share], axis=1))
