"""Keeping the distance and facing the opponent: a proportional controller.

P + feed-forward of the opponent's motion + prediction over the delays (a Smith predictor).

Following a pose: feed-forward of the wanted twist, proportional correction of the pose error.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import scale_wheels, twist_to_wheels, wheels_to_command
from mecanum_env.model import Model, Robot, Wheel
from mecanum_env.tankendo import Observed, Rules, read_observation
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.prediction.observed_motion import Delays, SeenMotion


@dataclass(frozen=True)
class Proportional:
    """Twist asked for = gains * (distance error, bearing)."""

    distance_m: float = Rules.maai_m
    """Distance to keep [m]."""
    gain_per_s: float = 2.0
    """Correction of the distance [1/s]."""
    turn_gain_per_s: float = 2.0
    """Correction of the bearing [1/s]."""
    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    limit_rpm: float = Wheel.saturation_rpm
    """Ceiling of its wheels [rpm]."""

    def reset(self) -> None:
        """Forget nothing: it has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = read_observation(observation)
        return self.command(*self.twist(seen))

    def command(self, vx_m_s: float, vy_m_s: float, yaw_rate_rad_s: float) -> Command:
        """Return the robot's command for a twist: ahead, left [m/s], turn [rad/s]."""
        return twist_command(vx_m_s, vy_m_s, yaw_rate_rad_s, self.robot, self.limit_rpm)

    def twist(self, seen: Observed) -> tuple[float, float, float]:
        """Return the wanted twist: ahead, left [m/s], turn [rad/s]; `seen` is one observation."""
        x, y = float(seen.opponent_x), float(seen.opponent_y)
        distance = max(float(np.hypot(x, y)), 1e-6)
        speed = self.gain_per_s * (distance - self.distance_m)
        turn = self.turn_gain_per_s * float(np.arctan2(y, x))
        return speed * x / distance, speed * y / distance, turn


class Smith:
    """Twist asked for = P(predicted place of the opponent) + lead * velocity of the opponent.

    O. J. Smith's predictor (Chemical Engineering Progress 53, 1957) lets a controller act on the output of a
    model without the delay, corrected by what the measurement, as late as it is, says of the model. Here the
    model is the identified wheel law: what the commands under way will still do is known, so P acts on the
    place where they leave the robot. Without delays and lead it is P.

    Args:
        model: wheel laws, robot and its `command_latency`.
        distance_m: to keep [m].
        gain_per_s: correction of the distance [1/s].
        turn_gain_per_s: correction of the bearing [1/s].
        lead: share of the opponent's velocity that is fed forward.
        ahead_s: prediction beyond the delays [s], for the rise of the wheels.
        delays: how late it sees and acts; by default the usual sensors and the model's latency.
    """

    def __init__(
        self,
        model: Model,
        distance_m: float = Rules.maai_m,
        gain_per_s: float = 4.0,
        turn_gain_per_s: float = 4.0,
        lead: float = 1.0,
        ahead_s: float = 0.0,
        delays: Delays | None = None,
    ) -> None:
        self._p = Proportional(
            distance_m, gain_per_s, turn_gain_per_s, model.robot, model.wheel.saturation_rpm
        )
        self._lead, self._ahead_s = lead, ahead_s
        self._motion = SeenMotion(model, Delays.of(model) if delays is None else delays)

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = self._motion.now(read_observation(observation), self._ahead_s)
        vx, vy, turn = self._p.twist(seen)
        vx, vy = vx + self._lead * float(seen.opponent_vx), vy + self._lead * float(seen.opponent_vy)
        command = self._p.command(vx, vy, turn)
        self._motion.send(command)
        return command


@dataclass(frozen=True)
class PoseController:
    """Twist asked for = wanted twist + gain * pose error, in the body frame.

    The gain must stay well below 1 / (command period + rise time), 4 1/s for the paper's robot: beyond, the
    correction arrives too late and the robot oscillates.
    """

    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    gain_per_s: float = 2.0
    """Correction of position and heading errors [1/s]."""
    limit_rpm: float = Wheel.saturation_rpm
    """No wheel is asked for more [rpm]; the direction of motion is kept."""

    def command(
        self, pose: FloatArray, wanted_pose: FloatArray, wanted_twist: FloatArray
    ) -> tuple[int, int, int]:
        """Return V [rpm], theta [deg], VC [rpm] as the whole numbers that the robot takes.

        Args:
            pose: measured x [m], y [m], yaw [rad] in the world, shape (3,).
            wanted_pose: where the robot should be now, shape (3,).
            wanted_twist: how the wanted pose moves, in the world frame: vx, vy [m/s], yaw rate [rad/s], (3,).
        """
        error = np.asarray(wanted_pose, float) - pose
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        world = np.asarray(wanted_twist, float) + self.gain_per_s * error
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        body = np.array([cos * world[0] + sin * world[1], cos * world[1] - sin * world[0], world[2]])
        wheels = scale_wheels(twist_to_wheels(body, self.robot), self.limit_rpm)
        v, theta, vc = wheels_to_command(wheels)
        return round(float(v)), round(float(theta)), round(float(vc))
