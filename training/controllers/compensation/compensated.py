"""Compensation of named effects around any controller."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import active_effects, drive_parameters
from mecanum_env.model import Model
from mecanum_env.tankendo import Sensors
from training.controllers.compensation.drive_inverse import DriveInverse
from training.controllers.compensation.sense_inverse import SenseInverse
from training.controllers.interface import Command, Controller


class Compensated:
    """Lets a controller that knows only the nominal robot drive one whose effects are known.

    The gap workflow names effects in the model; their inverse is put around the controller. It sees
    observations without the known sensor errors and without the latency of commands (`SenseInverse`), and
    what it commands is changed so that the robot moves as the nominal one would (`DriveInverse`). Neutral
    effects change nothing, bit for bit.

    Args:
        controller: what is wrapped; make it for the model without effects.
        model: wheel, robot and effects.
        delay_s: how late the sensors are by nature [s].
        foresees: the controller itself predicts over the model's `command_latency`, which is left to it.
    """

    def __init__(
        self,
        controller: Controller,
        model: Model,
        delay_s: float = Sensors.delay_s,
        foresees: bool = False,
    ) -> None:
        self._controller = controller
        self._drive = DriveInverse(model)
        self._senses = SenseInverse(model, delay_s, foresees)
        self._period_s = model.wheel.command_period_s
        self._late_s = drive_parameters(model).delay_s
        self.left_alone = tuple(e.name for e, _ in active_effects(model) if e.undone_by is None)
        """Names of the model's effects that nothing is done about."""
        self._steps = 0

    def reset(self) -> None:
        """Forget the episode."""
        self._controller.reset()
        self._drive.reset()
        self._senses.reset()
        self._steps = 0

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = self._senses.corrected(observation, hides_command=self._drive.is_needed)
        wanted = self._controller.act(seen)
        self._senses.send(wanted)
        command = self._drive.command(wanted, self._steps * self._period_s + self._late_s)
        self._steps += 1
        return command
