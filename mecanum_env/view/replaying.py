"""Replaying: a log and its simulation are shown at the time that the page asks for."""

from __future__ import annotations

import time
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.rendering.video import nearest_rows
from mecanum_env.simulator.robot import RobotPlant
from mecanum_env.simulator.trajectory import SimulationDivergedError
from mecanum_env.units import FloatArray
from mecanum_env.view.choices import choices_for, first_on, with_effects
from mecanum_env.view.messages import camera_of, camera_row, effect_rows, number, switched
from mecanum_env.view.picture import Camera, Picture, placed
from mecanum_env.view.replay import SHOWN, Drive, Log, Replay, replay
from mecanum_env.view.server import Message, Server

_POINTS: Final = 1500  # of a curve at most
_IDLE_S: Final = 0.02


class Replaying:
    """The session in which pages look at a log of a robot, or of a wheel, beside its simulation."""

    def __init__(self, model: Model, log: Log, plant: RobotPlant) -> None:
        self._model, self._log, self._plant = model, log, plant
        where = "bench" if log.commands is None else plant
        self._choices = choices_for(model, where, measured=True)
        self._on = first_on(self._choices)
        self._show(self._on)
        robot = self._replay.robot
        self._picture = None if robot is None else Picture(robot.mj_model)
        self._camera, self._look_s, self._due = Camera(), 0.0, True

    def hello(self) -> Message:
        """Return what a page that opens needs to know."""
        cameras = () if self._picture is None else self._picture.cameras
        return {
            "type": "hello",
            "mode": "replay",
            "log": self._log.name,
            "cameras": cameras,
            "camera": camera_row(self._camera),
            "effects": effect_rows(self._choices, self._on),
            **self._curves(),
        }

    def run(self, server: Server) -> None:
        """Serve pages for ever."""
        while True:
            for message in server.messages():
                self._hear(message, server)
            robot = self._replay.robot
            if robot is not None and self._picture is not None and self._due and server.wants_picture:
                server.publish(picture=self._draw(robot, self._picture))
                self._due = False
            else:
                time.sleep(_IDLE_S)

    def close(self) -> None:
        """Free the graphics."""
        if self._picture is not None:
            self._picture.close()

    def _show(self, on: frozenset[str]) -> None:
        self._replay: Replay = replay(with_effects(self._model, self._choices, on), self._log, self._plant)
        self._on = on

    def _draw(self, robot: Drive, picture: Picture) -> bytes:
        qpos = robot.qpos[int(nearest_rows(robot.time_s, self._look_s))]
        ghost = None
        if robot.logged_pose is not None:
            pose = [np.interp(self._look_s, self._log.time_s, column) for column in robot.logged_pose.T]
            ghost = placed(robot.mj_model, robot.qpos[0], np.array(pose))
        return picture.jpeg(qpos, self._camera, ghost)

    def _curves(self) -> Message:
        every = max(1, -(-self._log.time_s.size // _POINTS))
        rms = self._replay.rms()
        return {
            "time_s": self._log.time_s[::every].round(4).tolist(),
            "channels": [
                {
                    "name": name,
                    "label": SHOWN[name][0],
                    "unit": SHOWN[name][1],
                    "measured": _or_gaps(self._log.channels[name][::every]),
                    "simulated": _or_gaps(values[::every]),
                    "rms": rms[name],
                }
                for name, values in self._replay.simulated.items()
            ],
        }

    def _hear(self, message: Message, server: Server) -> None:
        try:
            match message["type"]:
                case "look":
                    self._look_s = number(message, "time_s")
                    self._due = True
                case "camera" if self._picture is not None:
                    self._camera = camera_of(message, self._picture.cameras)
                    self._due = True
                case "effect":
                    self._show(switched(self._on, message, self._choices))
                    self._tell_all(server)
        except (InputError, SimulationDivergedError) as error:
            server.publish({"type": "note", "text": str(error)})
            self._tell_all(server)

    def _tell_all(self, server: Server) -> None:
        server.hello = self.hello()
        server.publish(server.hello)
        self._due = True


def _or_gaps(values: FloatArray) -> list[float | None]:
    """Return values for JSON, which has no NaN: None where a sample is missing."""
    return [round(float(value), 5) if np.isfinite(value) else None for value in values]
