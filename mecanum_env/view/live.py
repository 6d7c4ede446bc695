"""Driving: what the page commands is simulated in real time, and shown to it."""

from __future__ import annotations

import math
import time
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.simulator.robot import RobotPlant
from mecanum_env.simulator.trajectory import SimulationDivergedError
from mecanum_env.view.choices import choices_for, first_on, with_effects
from mecanum_env.view.messages import (
    camera_of,
    camera_row,
    clip,
    effect_rows,
    number,
    switched,
)
from mecanum_env.view.picture import Camera, Picture
from mecanum_env.view.robot import LiveRobot
from mecanum_env.view.server import Message, Server

SLICE_S: Final = 1.0 / 15.0
"""Time between two pictures, if the machine can draw so many [s]."""
_LONGEST_SLICE_S: Final = 0.5  # what is simulated at most before pages are heard again; more is left out
_SAMPLES_HZ: Final = 45.0  # of the curves
_COMMAND_HOLDS_S: Final = 0.5  # a page that says nothing for so long does not drive any more
_IDLE_S: Final = 0.05
_FASTEST_RPM: Final = 200.0  # commanded at most where a model knows no ceiling
STILL: Final = (0.0, 0.0, 0.0)


class Driving:
    """The session in which pages drive a model on a plant."""

    def __init__(self, model: Model, plant: RobotPlant) -> None:
        self._model = model
        self._choices = choices_for(model, plant, measured=False)
        self._on = first_on(self._choices)
        self._robot = LiveRobot(with_effects(model, self._choices, self._on), plant)
        self._picture = Picture(self._robot.mj_model)
        self._camera = Camera()
        self._fastest_rpm = min(model.wheel.saturation_rpm, _FASTEST_RPM)
        self._command, self._commanded_s = STILL, -math.inf

    def hello(self) -> Message:
        """Return what a page that opens needs to know."""
        return {
            "type": "hello",
            "mode": "drive",
            "fastest_rpm": self._fastest_rpm,
            "period_s": self._model.wheel.command_period_s,
            "cameras": self._picture.cameras,
            "camera": camera_row(self._camera),
            "effects": effect_rows(self._choices, self._on),
        }

    def run(self, server: Server) -> None:
        """Serve pages for ever; the robot waits while none is open."""
        last = time.monotonic()
        while True:
            for message in server.messages():
                self._hear(message, server)
            now = time.monotonic()
            if not server.watched or now - last < SLICE_S:
                last = last if server.watched else now
                time.sleep(min(_IDLE_S, max(0.001, SLICE_S - (now - last))))
                continue
            passed, last = min(now - last, _LONGEST_SLICE_S), now
            self._go_on(passed, server)

    def close(self) -> None:
        """Free the graphics."""
        self._picture.close()

    def _go_on(self, seconds: float, server: Server) -> None:
        command = self._command if time.monotonic() - self._commanded_s < _COMMAND_HOLDS_S else STILL
        try:
            motion = self._robot.advance(command, seconds, max(1, round(seconds * _SAMPLES_HZ)))
        except SimulationDivergedError as error:
            self._robot.reset()
            server.publish({"type": "note", "text": f"{error}. The robot is back at the start."})
            return
        server.publish(
            {
                "type": "motion",
                "command": command,
                "time_s": motion.time_s.round(4).tolist(),
                "sent_rpm": motion.sent_rpm.round(2).tolist(),
                "wheels_rpm": motion.wheels_rpm.round(2).tolist(),
                "twist": motion.twist.round(3).tolist(),
                "pose": motion.pose.round(3).tolist(),
            }
        )
        if server.wants_picture:
            server.publish(picture=self._draw())

    def _draw(self) -> bytes:
        qpos = self._robot.qpos
        if not self._picture.fits(qpos):
            self._picture.close()
            self._picture = Picture(self._robot.mj_model)
        return self._picture.jpeg(qpos, self._camera)

    def _hear(self, message: Message, server: Server) -> None:
        try:
            match message["type"]:
                case "drive":
                    limit = self._fastest_rpm
                    v, theta, vc = (number(message, name) for name in ("v", "theta", "vc"))
                    self._command = (clip(v, limit), clip(theta, 180.0), clip(vc, limit))
                    self._commanded_s = time.monotonic()
                case "reset":
                    self._robot.reset()
                    server.publish({"type": "reset"})
                case "camera":
                    self._camera = camera_of(message, self._picture.cameras)
                case "effect":
                    on = switched(self._on, message, self._choices)
                    self._robot.change(with_effects(self._model, self._choices, on))
                    self._on = on
                    self._tell_effects(server)
        except InputError as error:
            server.publish({"type": "note", "text": str(error)})
            # The page's checkbox may show what was refused.
            self._tell_effects(server)

    def _tell_effects(self, server: Server) -> None:
        server.hello = self.hello()
        server.publish({"type": "effects", "effects": effect_rows(self._choices, self._on)})
