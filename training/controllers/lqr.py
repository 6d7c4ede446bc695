"""LQR for tracking: optimal feedback on the predicted state, about motion along with the opponent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import wheels_to_twist
from mecanum_env.model import Model
from mecanum_env.tankendo import Rules, read_observation
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.lqr_design import Weights, tracking_gain
from training.controllers.prediction.seen_motion import Delays, SeenMotion

PLACE: Weights = Weights(place=0.03, command=0.3)
"""Along each axis of the floor [m], [m/s]."""
TURN: Weights = Weights(place=0.06, command=0.6)
"""In yaw [rad], [rad/s]."""


class Lqr:
    """Twist asked for = c - K (state of the wheel law - c, place error) on each axis; c the opponent's speed.

    The state is that at which the command acts: the law's memory is known from the commands sent, the place
    is predicted as in `Smith`. The gains K are those of `training.controllers.lqr_design`.

    Args:
        model: wheel laws, robot and its `command_latency`.
        distance_m: to keep [m].
        place: weights along and across.
        turn: weights in yaw.
        delays: how late it sees and acts; by default the usual sensors and the model's latency.
    """

    def __init__(
        self,
        model: Model,
        distance_m: float = Rules.maai_m,
        place: Weights = PLACE,
        turn: Weights = TURN,
        delays: Delays | None = None,
    ) -> None:
        self._robot, self._limit_rpm = model.robot, model.wheel.saturation_rpm
        self._distance_m = distance_m
        law, period = model.wheel.law, model.wheel.command_period_s
        self.gains: FloatArray = np.array([tracking_gain(law, period, w) for w in (place, place, turn)])
        self._motion = SeenMotion(model, Delays.of(model) if delays is None else delays)

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = self._motion.now(read_observation(observation))
        x, y = float(seen.opponent_x), float(seen.opponent_y)
        distance = max(float(np.hypot(x, y)), 1e-6)
        short = 1.0 - self._distance_m / distance
        error = np.array([short * x, short * y, np.arctan2(y, x)])
        along = np.array([float(seen.opponent_vx), float(seen.opponent_vy), 0.0])
        # The memory of the four wheels as that of three axes, shape (3, 5).
        memory = wheels_to_twist(self._motion.own.state.law[:, :, 0].T, self._robot).T
        state = np.concatenate([memory - along[:, None], -error[:, None]], axis=1)
        twist = along - np.sum(self.gains * state, axis=1)
        command = twist_command(
            float(twist[0]), float(twist[1]), float(twist[2]), self._robot, self._limit_rpm
        )
        self._motion.send(command)
        return command
