"""What only the critic sees in training: the true robot, the true opponent, and what it is about to do.

No sensor shows these numbers, and no policy gets them. The value of a state depends on them, so a critic that
knows them explains more of the reward, and the actor learns from a smaller noise: asymmetric actor-critic,
L. Pinto et al., "Asymmetric actor critic for image-based robot learning", Robotics: Science and Systems 2018.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.model import Model
from mecanum_env.tankendo.actions import FULL_V_RPM
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.constants import Opponent
from mecanum_env.units import FloatArray

_FAR_S: Final = 0.6
"""Times to a strike that is not under way, or farther than this, are this long [s]. An evasion takes less;
the numbers that decide when it begins must not be small beside others, or learning takes twice as long."""
_LONG_S: Final = 1.0
"""Longest time since the sword rose [s]."""
_ROBOT: Final = 5
_OPPONENT: Final = 7
_STATE: Final = 17
PRIVILEGED: Final = _ROBOT + _OPPONENT + _STATE
"""How many numbers there are."""


def robot_numbers(model: Model) -> FloatArray:
    """Return delay [s], ceiling, its softness and gain [1], and friction [rad/s], shape (5,)."""
    drive = drive_parameters(model)
    friction = sum(
        values.get("torque_n_m", 0.0)
        for name, values in model.effects.items()
        if name.startswith("coulomb_friction")
    )
    return np.array(
        [
            drive.delay_s,
            min(drive.saturation_rpm / FULL_V_RPM, 2.0),
            drive.softness_rpm / FULL_V_RPM,
            drive.gain,
            friction / model.robot.servo_n_m_s_rad,
        ]
    )


def opponent_numbers(opponent: Opponent) -> FloatArray:
    """Return how an opponent sees, leads and reaches, shape (7,)."""
    return np.array(
        [
            opponent.sight_delay_s,
            opponent.lead,
            opponent.habit,
            opponent.extra_reach_m,
            opponent.extra_size_m,
            opponent.feint_probability,
            opponent.techniques[0].swing_s,
        ]
    )


class Privileged:
    """Reads the privileged numbers off an arena."""

    def __init__(self, arena: Arena) -> None:
        self._arena = arena
        self._fixed = np.zeros((_ROBOT + _OPPONENT, arena.n))
        self._robots: dict[int, tuple[Model, FloatArray]] = {}

    def numbers(self) -> FloatArray:
        """Return the numbers of the present state, shape (n, PRIVILEGED)."""
        arena = self._arena
        for row in np.flatnonzero(arena.step_count == 0).tolist():
            self._fixed[:_ROBOT, row] = self._of_robot(arena.robots.model_of(row))
            self._fixed[_ROBOT:, row] = opponent_numbers(arena.fighter.opponents[row])
        return np.concatenate([self._fixed, self._state()]).T

    def _of_robot(self, model: Model) -> FloatArray:
        known = self._robots.get(id(model))
        if known is None or known[0] is not model:
            known = self._robots[id(model)] = (model, robot_numbers(model))
        return known[1]

    def _state(self) -> FloatArray:
        """Return what moves: robot, strike and where it is aimed, shape (17, n)."""
        arena = self._arena
        fighter, sword, now = arena.fighter, arena.fighter.sword, arena.time_s()
        distance, bearing = arena.scenes.separation()
        scene = arena.scenes.now
        cos, sin = np.cos(scene[2]), np.sin(scene[2])
        pending, technique = fighter.pending, fighter.technique()
        coming = pending | ~sword.idle(now)
        aim = np.where(fighter.aimed & pending, sword.end - scene[:2], 0.0)
        strike = [
            pending,
            coming & sword.is_feint,
            np.where(pending, np.clip(sword.land_s - now, 0.0, _FAR_S), _FAR_S),
            np.where(coming, np.clip(sword.cut_s - now, -_FAR_S, _FAR_S), _FAR_S),
            np.where(coming, np.clip(now - sword.raise_s, 0.0, _LONG_S), 0.0),
            np.clip(fighter.drawn(arena.chance.patience) - fighter.open_s, 0.0, _FAR_S),
            fighter.has_struck(now),
            cos * aim[0] + sin * aim[1],
            cos * aim[1] - sin * aim[0],
        ]
        own = [distance, bearing, cos * scene[3] + sin * scene[4], cos * scene[4] - sin * scene[3], scene[5]]
        kinds = [technique == kind for kind in range(3)]
        return np.stack([np.asarray(one, float) for one in (*strike, *own, *kinds)])
