"""Controllers that keep a distance to the opponent and face it (P, Smith predictor), or follow a pose."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Model, Robot, Wheel
from mecanum_env.tankendo import Observed, Rules, read_observation
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.observed_motion import ObservationPredictor


def opponent_place(seen: Observed) -> tuple[float, float, float]:
    """Return where the opponent is `seen`: ahead, left, and its distance, at least 1e-6 [m]."""
    x, y = float(seen.opponent_x), float(seen.opponent_y)
    return x, y, max(float(np.hypot(x, y)), 1e-6)


@dataclass(frozen=True)
class Proportional:
    """P controller: twist = gain * (distance error along the line to the opponent, bearing)."""

    distance_m: float = Rules.maai_m
    """Distance to keep [m]."""
    gain_per_s: float = 2.0
    """Gain of the distance error [1/s]."""
    turn_gain_per_s: float = 2.0
    """Gain of the bearing [1/s]."""
    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    limit_rpm: float = Wheel.saturation_rpm
    """Maximum wheel speed [rpm]."""

    def reset(self) -> None:
        """Do nothing: the controller has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        return self.command(*self.twist(read_observation(observation)))

    def command(self, vx_m_s: float, vy_m_s: float, yaw_rate_rad_s: float) -> Command:
        """Return the robot's command for a twist: ahead, left [m/s], turn [rad/s]."""
        return twist_command(vx_m_s, vy_m_s, yaw_rate_rad_s, self.robot, self.limit_rpm)

    def twist(self, seen: Observed) -> tuple[float, float, float]:
        """Return the wanted twist (ahead, left [m/s], turn [rad/s]) for an observation `seen`."""
        x, y, distance = opponent_place(seen)
        speed = self.gain_per_s * (distance - self.distance_m)
        turn = self.turn_gain_per_s * float(np.arctan2(y, x))
        return speed * x / distance, speed * y / distance, turn


class Smith:
    """Smith predictor: twist = P(predicted place of the opponent) + lead * velocity of the opponent.

    O. J. M. Smith's predictor (Chemical Engineering Progress 53, 1957) lets a controller act on the output of
    a model without the delay, corrected by the delayed measurement. Here the model is the identified wheel
    law: the effect of the commands under way is known, so P acts on the place where they leave the robot.
    Without delays and lead it equals P.

    Args:
        model: wheel laws, robot and its `command_latency`.
        distance_m: distance to keep.
        gain_per_s: gain of the distance error.
        turn_gain_per_s: gain of the bearing [1/s].
        lead: share of the opponent's velocity that is fed forward.
        horizon_s: age of an observation when its answer acts; by default the delays of sensors and commands.
    """

    def __init__(
        self,
        model: Model,
        distance_m: float = Rules.maai_m,
        gain_per_s: float = 4.0,
        turn_gain_per_s: float = 4.0,
        lead: float = 1.0,
        horizon_s: float | None = None,
    ) -> None:
        limit_rpm = model.wheel.saturation_rpm
        self._p = Proportional(distance_m, gain_per_s, turn_gain_per_s, model.robot, limit_rpm)
        self._lead = lead
        self._motion = ObservationPredictor(model, horizon_s)

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = self._motion.predict(read_observation(observation))
        vx, vy, turn = self._p.twist(seen)
        vx, vy = vx + self._lead * float(seen.opponent_vx), vy + self._lead * float(seen.opponent_vy)
        command = self._p.command(vx, vy, turn)
        self._motion.send(command)
        return command


@dataclass(frozen=True)
class PoseController:
    """Follows a moving pose: twist = wanted twist + gain * pose error, in the body frame.

    The gain must stay well below 1 / (command period + rise time), 4 1/s for the paper's robot: beyond it
    the correction arrives too late and the robot oscillates.
    """

    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    gain_per_s: float = 2.0
    """Gain of position and heading errors [1/s]."""
    limit_rpm: float = Wheel.saturation_rpm
    """Maximum wheel speed [rpm]; the direction of motion is kept."""

    def command(self, pose: FloatArray, wanted_pose: FloatArray, wanted_twist: FloatArray) -> Command:
        """Return the command for a measured pose.

        Args:
            pose: measured x [m], y [m], yaw [rad] in the world, shape (3,).
            wanted_pose: pose that the robot should have now, shape (3,).
            wanted_twist: its velocity in the world: vx, vy [m/s], yaw rate [rad/s], shape (3,).
        """
        error = np.asarray(wanted_pose, float) - pose
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        vx, vy, turn = np.asarray(wanted_twist, float) + self.gain_per_s * error
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        return twist_command(cos * vx + sin * vy, cos * vy - sin * vx, turn, self.robot, self.limit_rpm)
