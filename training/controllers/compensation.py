"""Compensation of known effects around any controller: of drives on commands, of sensors on observations.

`Compensated` wraps the controller. Its commands pass `training.controllers.drive_inverse`, its observations
pass `SensorInverse`:

- `sensor_bias` is subtracted, `sensor_scale` divided out, `mount_yaw` turned back.
- `sensor_latency` and `sensor_lowpass`, in all forms, are known filters: what they removed from the motion
  that the commands led to is added back. Unlike an inverse filter this does not amplify noise.
- `command_latency`: the observation is brought forward by it, so that the controller sees a robot that obeys
  at once: its own motion by the commands under way, the opponent's by its velocity.

Observations are those of `mecanum_env.tankendo.observation`; their numbers are addressed by index.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import active_effects, drive_parameters, measured
from mecanum_env.kinematics import POSE, TWIST
from mecanum_env.model import Model
from mecanum_env.tankendo import Sensors
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.units import FloatArray
from training.controllers.drive_inverse import DriveInverse
from training.controllers.interface import Command, Controller
from training.controllers.observed_motion import OwnMotion, seen_from

_CHANNELS: Final = (*TWIST, *POSE)
_KEPT: Final = 40
"""Number of remembered observations; several times the longest delay or filter."""
_OWN, _HELD, _PLACE, _HEADING = slice(10, 13), slice(13, 16), slice(16, 18), slice(18, 20)
_SEEN_PLACES, _SEEN_VELOCITIES = ((0, 1), (4, 5)), ((2, 3), (7, 8))
"""Of the opponent and of its tip."""


class Compensated:
    """Lets a controller that knows only the nominal robot drive one whose effects are known.

    The effects are those that the gap workflow names in the model. The controller sees observations without
    the known sensor errors and without the latency of commands (`SensorInverse`), and its commands are
    changed so that the robot moves as the nominal one would (`DriveInverse`). Neutral effects change nothing,
    bit for bit. With `predicts_latency` the controller itself compensates the model's `command_latency`.
    """

    def __init__(self, controller: Controller, model: Model, predicts_latency: bool = False) -> None:
        self._controller = controller
        self._drive = DriveInverse(model)
        self._senses = SensorInverse(model, predicts_latency)
        self._period_s = model.wheel.command_period_s
        self._late_s = drive_parameters(model).delay_s
        undone = ("command", "set_point") if self._drive.undoes_custom else ()
        self.left_alone = (
            *(e.name for e, _ in active_effects(model) if e.undone_by is None),
            *(f"custom effect ({one.station})" for one in model.custom if one.station not in undone),
        )
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


class SensorInverse:
    """Corrects the observations of one robot for the effects that `undone_by` assigns to observations.

    It compensates `command_latency`, too, unless the controller itself `predicts_latency`.
    """

    def __init__(self, model: Model, predicts_latency: bool = False) -> None:
        effects = [pair for pair in active_effects(model) if pair[0].undone_by == "observation"]
        self._late_s = drive_parameters(model).delay_s
        # Against the order of the chain; the inverse of a filter would need the past, see `_unfilter`.
        self._restorers = [(e.restore_channels, v) for e, v in reversed(effects) if e.restore_channels]
        filters = {e.name: v for e, v in effects if e.restore_channels is None}
        self._filters = replace(model, effects=filters) if filters else None
        self._corrects = bool(effects)
        self._brings_forward = self._late_s > 0.0 and not predicts_latency
        self._is_needed = self._corrects or self._brings_forward
        # A compensated robot does what the controller asks for.
        self._own = OwnMotion(replace(model, effects={}))
        self._step_s = model.wheel.command_period_s
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._own.reset()
        self._last: Command | None = None
        self._pose = np.zeros(3)
        self._past: list[FloatArray] = [np.zeros(6), np.zeros(6)]

    def send(self, command: Command) -> None:
        """Take note of the controller's command, which the compensated robot follows."""
        self._last = command
        if self._is_needed:
            self._own.send(command)

    def corrected(
        self, observation: npt.NDArray[np.floating], hides_command: bool = False
    ) -> npt.NDArray[np.floating]:
        """Return the observation, shape (20 or more,), without the known errors.

        With `hides_command` it shows the controller's last command instead of the one that was sent for it.
        """
        if not self._is_needed and not hides_command:
            return observation
        shown = np.array(observation, float)
        if self._corrects:
            self._correct(shown)
        if self._brings_forward:
            self._bring_forward(shown)
        if hides_command and self._last is not None:
            v, theta, vc = self._last
            cos, sin = math.cos(math.radians(theta)), math.sin(math.radians(theta))
            shown[_HELD] = v / FULL_V_RPM * cos, v / FULL_V_RPM * sin, vc / FULL_VC_RPM
        return shown

    def _correct(self, shown: FloatArray) -> None:
        names, now = _CHANNELS[:5], np.array([self._own.time_s])
        channels = dict(zip(names, np.r_[shown[_OWN], shown[_PLACE]][:, None], strict=True))
        for restore, values in self._restorers:
            channels = restore(now, channels, values)
        shown[_OWN], shown[_PLACE] = np.split(np.concatenate([channels[name] for name in names]), [3])
        if self._filters is not None:
            self._unfilter(shown)

    def _unfilter(self, shown: FloatArray) -> None:
        """Add what the filters removed from the motion that the commands led to."""
        assert self._filters is not None
        twist, pose = self._odometry()
        self._past = [*self._past[1 - _KEPT :], np.array([*twist, *pose])]
        clock = np.arange(len(self._past)) * self._step_s
        channels = dict(zip(_CHANNELS, np.array(self._past).T, strict=True))
        filtered = measured(self._filters, np.asarray(clock, float), channels)
        lost = np.array([channels[name][-1] - filtered[name][-1] for name in _CHANNELS])
        shown[_OWN] += lost[:3]
        heading = math.atan2(shown[19], shown[18]) + lost[5]
        shown[_HEADING] = math.cos(heading), math.sin(heading)
        # Odometry starts with heading 0, the robot with any.
        turn = heading - pose[2]
        cos, sin = math.cos(turn), math.sin(turn)
        shown[_PLACE] += (cos * lost[3] - sin * lost[4], sin * lost[3] + cos * lost[4])

    def _odometry(self) -> tuple[FloatArray, FloatArray]:
        """Return twist and pose that the commands led to at the time that the observation shows."""
        ago_s = Sensors.delay_s + self._late_s
        step = self._own.moved(ago_s + self._step_s, ago_s)
        cos, sin = math.cos(self._pose[2]), math.sin(self._pose[2])
        self._pose = self._pose + np.array(
            [cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2]]
        )
        return self._own.twist(ago_s), self._pose

    def _bring_forward(self, shown: FloatArray) -> None:
        late, seen = self._late_s, Sensors.delay_s
        moved = self._own.moved(late + seen, seen)
        for (x, y), (vx, vy) in zip(_SEEN_PLACES, _SEEN_VELOCITIES, strict=True):
            shown[x], shown[y] = seen_from(moved, shown[x] + late * shown[vx], shown[y] + late * shown[vy])
        shown[6] += late * shown[9]
        turn = np.array([0.0, 0.0, moved[2]])
        for vx, vy in _SEEN_VELOCITIES:
            shown[vx], shown[vy] = seen_from(turn, shown[vx], shown[vy])
        shown[_OWN] += self._own.twist(seen) - self._own.twist(late + seen)
        cos, sin = shown[18], shown[19]
        shown[_PLACE] += (cos * moved[0] - sin * moved[1], sin * moved[0] + cos * moved[1])
        c, s = math.cos(moved[2]), math.sin(moved[2])
        shown[_HEADING] = cos * c - sin * s, sin * c + cos * s
