"""P + feed-forward of the opponent's motion + prediction over the delays (a Smith predictor)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Model
from mecanum_env.tankendo import Rules, read_observation
from training.controllers.interface import Command
from training.controllers.prediction.seen_motion import Delays, SeenMotion
from training.controllers.proportional import Proportional


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
