"""Optimal tracking (LQR) with gains computed from the identified wheel law.

Along each axis of the robot (ahead, left, turn) the velocity w follows the wheel law, whose input r is held
for a command period, and the position p is its integral. All are deviations from moving along with a target
of constant velocity c (the law has unit DC gain, so velocity and command are then c). The state at each
period and its dynamics are

    z = (w(k), w(k-1), w(k-2), r(k-1), r(k-2), p)        z' = F z + G u

The command u = -K z minimises the sum of (p / p_max)^2 + (u / u_max)^2 (Bryson's rule); K follows from the
discrete algebraic Riccati equation. For commands that act late the optimal gain is K on the state predicted
to the time at which they act.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_discrete_are

from mecanum_env.errors import InputError
from mecanum_env.kinematics import wheels_to_twist
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.model import Model
from mecanum_env.tankendo import Rules, read_observation
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.motion_model import MEMORY
from training.controllers.observed_motion import ObservationPredictor
from training.controllers.tracking import opponent_place


@dataclass(frozen=True)
class Weights:
    """Deviations of equal cost (Bryson's rule)."""

    place: float
    """p_max: deviation of the position [m or rad]."""
    command: float
    """u_max: deviation of the command [m/s or rad/s]."""

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"LQR weight {name} = {value}, must be a finite number above 0")


_TRANSLATION = Weights(place=0.03, command=0.3)
"""Weights along each axis of the floor [m], [m/s]."""
TURN = Weights(place=0.06, command=0.6)
"""Weights in yaw [rad], [rad/s]."""


def axis_dynamics(law: WheelLaw, period_s: float) -> tuple[FloatArray, FloatArray]:
    """Return F, shape (6, 6), and G, shape (6, 1), of one axis over a command period.

    Speeds may be in any unit; the position is in that unit times seconds. The period is rounded to whole
    ticks of the law.
    """
    size = MEMORY + 1
    tick, push = np.zeros((size, size)), np.zeros((size, 1))
    tick[0, :MEMORY] = law.A, law.B, law.C, law.E, law.F
    push[0] = law.D
    tick[1, 0] = tick[2, 1] = tick[4, 3] = 1.0
    push[3] = 1.0
    # The velocity is linear within a tick, so the trapezoidal rule is exact.
    tick[5] = 0.5 * law.sample_period_s * tick[0]
    tick[5, 0] += 0.5 * law.sample_period_s
    tick[5, 5] = 1.0
    push[5] = 0.5 * law.sample_period_s * push[0]
    f, g = np.eye(size), np.zeros((size, 1))
    for _ in range(max(1, round(period_s / law.sample_period_s))):
        f, g = tick @ f, tick @ g + push
    return f, g


def riccati_gain(f: FloatArray, g: FloatArray, weights: Weights) -> FloatArray:
    """Return K of u = -K z, shape (m,), for `f`, shape (m, m), and `g`, shape (m, 1); z[5] is p."""
    q = np.zeros(f.shape)
    q[MEMORY, MEMORY] = 1.0 / weights.place**2
    r = np.array([[1.0 / weights.command**2]])
    p = solve_discrete_are(f, g, q, r)
    return np.asarray(np.linalg.solve(r + g.T @ p @ g, g.T @ p @ f)[0], float)


class Lqr:
    """Twist = c - K z on each axis, with c the opponent's velocity and z the state at which the command acts.

    The memory of the wheel law is known from the commands sent; the position is predicted as in `Smith`.
    """

    def __init__(self, model: Model, distance_m: float = Rules.maai_m) -> None:
        self._robot, self._limit_rpm = model.robot, model.wheel.saturation_rpm
        self._distance_m = distance_m
        dynamics = axis_dynamics(model.wheel.law, model.wheel.command_period_s)
        self._gains = np.array([riccati_gain(*dynamics, w) for w in (_TRANSLATION, _TRANSLATION, TURN)])
        self._motion = ObservationPredictor(model)

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = self._motion.predict(read_observation(observation))
        x, y, distance = opponent_place(seen)
        short = 1.0 - self._distance_m / distance
        error = np.array([short * x, short * y, np.arctan2(y, x)])
        target = np.array([float(seen.opponent_vx), float(seen.opponent_vy), 0.0])
        # The memory of the four wheels as that of the three axes, shape (3, 5).
        memory = wheels_to_twist(self._motion.own.state.law[:, :, 0].T, self._robot).T
        state = np.concatenate([memory - target[:, None], -error[:, None]], axis=1)
        vx, vy, turn = (float(value) for value in target - np.sum(self._gains * state, axis=1))
        command = twist_command(vx, vy, turn, self._robot, self._limit_rpm)
        self._motion.send(command)
        return command
