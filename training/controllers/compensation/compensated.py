"""Compensation of named effects around any controller."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import active_effects, drive_parameters
from mecanum_env.model import Model
from training.controllers.compensation.drive_inverse import DriveInverse
from training.controllers.compensation.sense_inverse import SensorInverse
from training.controllers.interface import Command, Controller


class Compensated:
    """Lets a controller that knows only the nominal robot drive one whose effects are known.

    The effects are those that the gap workflow names in the model. The controller sees observations without
    the known sensor errors and without the latency of commands (`SensorInverse`), and its commands are
    changed so that the robot moves as the nominal one would (`DriveInverse`). Neutral effects change nothing,
    bit for bit.

    Args:
        controller: the wrapped controller, made for the model without effects.
        model: wheel, robot and effects.
        predicts_latency: the controller itself compensates the model's `command_latency`.
    """

    def __init__(self, controller: Controller, model: Model, predicts_latency: bool = False) -> None:
        self._controller = controller
        self._drive = DriveInverse(model)
        self._senses = SensorInverse(model, predicts_latency)
        self._period_s = model.wheel.command_period_s
        self._late_s = drive_parameters(model).delay_s
        self.left_alone = tuple(e.name for e, _ in active_effects(model) if e.undone_by is None)
        """Names of the model's effects that are not compensated."""
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
