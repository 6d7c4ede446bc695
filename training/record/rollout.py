"""One episode of a controller as frames: the picture, the score, commanded against actual speed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.kinematics import command_to_twist
from mecanum_env.model import Model
from mecanum_env.rendering.caption import Frame
from mecanum_env.rendering.view import LARGEST_PX
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.drawing import Painter
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.units import FloatArray
from training.controllers.interface import Controller
from training.record.strip import Panel, Strip

STRIP_SHARE: Final = 0.32
"""Of the picture's height that the plots take."""
AFTER_S: Final = 1.0
"""How long the last picture stays [s]."""
_SMALLEST: Final = (320, 240)


class Rollout:
    """One episode, seeded; iterate over `frames` once, then `info` says how it ended.

    Args:
        env: with `action_mode="command"`; its first episode from now on is played.
        controller: that plays; reset by who made it.
        known: the robot as the controller knows it, whose kinematics say what a command asks for.
        seed: of the episode.
        width: of the frames [pixels], even.
        height: of the frames [pixels], even.
        fps: frames per second of simulated time.
        title: over the plots, such as the controller's name.

    Raises:
        InputError: a size that is odd, too small to read or too large to draw, a negative seed, or no frame a
            second.
    """

    def __init__(
        self,
        env: TankendoEnv,
        controller: Controller,
        known: Model,
        *,
        seed: int = 0,
        width: int = 640,
        height: int = 480,
        fps: float = 30.0,
        title: str = "",
    ) -> None:
        for name, pixels, least in (("width", width, _SMALLEST[0]), ("height", height, _SMALLEST[1])):
            if pixels % 2 or not least <= pixels <= LARGEST_PX:
                raise InputError(
                    f"{name} = {pixels} pixels, must be an even number from {least} to {LARGEST_PX}"
                )
        require_at_least(0, seed=seed)
        if not 1.0 <= fps <= 240.0:
            raise InputError(f"fps = {fps}, must be 1 to 240")
        self._env, self._controller, self._known, self._seed = env, controller, known, seed
        self._width, self._fps, self._title = width, fps, title
        self._strip_height = 2 * round(STRIP_SHARE * height / 2)
        self._picture_height = height - self._strip_height
        self.info: dict[str, Any] = {}
        """Of the last step that was drawn."""

    def frames(self, plant: str) -> Iterator[Frame]:
        """Play the episode; yield its pictures, (height, width, 3).

        Args:
            plant: "planar" or "rollers", that the environment simulates.
        """
        env, arena = self._env, self._env.arena
        observation, self.info = env.reset(seed=self._seed)
        painter = Painter(
            arena, "rollers" if plant == "rollers" else "planar", self._width, self._picture_height
        )
        strip = Strip(_panels(self._known), self._width, self._strip_height, self._title)
        samples = [_sample(arena, self._known)]
        each = max(1, round(self._fps * arena.step_s))
        over = False
        try:
            frame = _stacked(painter.frame(), strip, 0.0, samples)
            yield frame
            while not over:
                before = arena.robots.qpos(0)
                action = command_to_action(self._controller.act(observation))
                observation, _, terminated, truncated, self.info = env.step(action)
                over, after = terminated or truncated, arena.robots.qpos(0)
                samples.append(_sample(arena, self._known))
                for i in range(1, each + 1):
                    share = i / each
                    ago_s = (1.0 - share) * arena.step_s
                    picture = painter.frame(ago_s, before + share * (after - before))
                    frame = _stacked(picture, strip, samples[-1][0] - ago_s, samples)
                    yield frame
            for _ in range(round(AFTER_S * self._fps)):
                yield frame
        finally:
            painter.close()


def outcome(arena: Arena) -> str:
    """Return how the episode in the first row of an arena ended, in a word."""
    if arena.succeeded[0]:
        return "success"
    return "hit" if arena.hit[0] else "no success"


def _panels(known: Model) -> tuple[Panel, ...]:
    """Return the plots, their axes as wide as what the wheels can do."""
    ceiling = min(known.wheel.saturation_rpm, 200.0)
    speed = float(command_to_twist(ceiling, 0.0, 0.0, known.robot)[0])
    turn = float(np.rad2deg(command_to_twist(0.0, 0.0, ceiling, known.robot)[2]))
    wide = float(np.ceil(10.0 * speed) / 10.0)
    return (
        Panel("ahead, m/s", wide),
        Panel("left, m/s", wide),
        Panel("turn, deg/s", float(np.ceil(turn / 10.0) * 10.0)),
    )


def _sample(arena: Arena, known: Model) -> tuple[float, FloatArray, FloatArray]:
    """Return time, commanded and actual (ahead, left [m/s], turn [deg/s]) of the first row."""
    v, theta, vc = arena.commands[0]
    commanded = command_to_twist(v, theta, vc, known.robot)
    yaw, vx, vy, turn = arena.scenes.now[2:6, 0]
    cos, sin = np.cos(yaw), np.sin(yaw)
    actual = np.array([cos * vx + sin * vy, cos * vy - sin * vx, turn])
    degrees = np.array([1.0, 1.0, 180.0 / np.pi])
    return float(arena.time_s()[0]), commanded * degrees, actual * degrees


def _stacked(
    picture: Frame, strip: Strip, now_s: float, samples: list[tuple[float, FloatArray, FloatArray]]
) -> Frame:
    time_s = np.array([sample[0] for sample in samples])
    commanded, actual = (np.array([sample[i] for sample in samples]) for i in (1, 2))
    return np.concatenate([picture, strip.draw(now_s, time_s, commanded, actual)])
