"""A strip of plots under the picture: commanded against actual speed of the last seconds.

One episode of a controller as frames: the picture, the score, commanded against actual speed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.kinematics import command_to_twist
from mecanum_env.model import Model
from mecanum_env.rendering.view import LARGEST_PX, Frame
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.drawing import Painter
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.units import FloatArray
from training.controllers.interface import Controller

WINDOW_S: Final = 4.0
"""How much of the past is shown [s]."""
_FINER: Final = 2  # drawn larger and scaled down, so that lines are smooth
_PAPER, _INK, _FAINT = (24, 26, 31), (235, 235, 235), (74, 78, 88)
COMMANDED: Final = (255, 159, 28)
"""Colour of what is commanded."""
ACTUAL: Final = (92, 184, 255)
"""Colour of what the robot does."""


@dataclass(frozen=True)
class Panel:
    """One plot."""

    title: str
    limit: float
    """The axis runs from minus this to this."""


class Strip:
    """Draws the plots.

    Args:
        panels: side by side.
        width: of the strip [pixels].
        height: of the strip [pixels].
        title: at the right end, beside the legend.
    """

    def __init__(self, panels: Sequence[Panel], width: int, height: int, title: str = "") -> None:
        self._panels, self._width, self._height = tuple(panels), width, height
        self._title = title

    def draw(self, now_s: float, time_s: FloatArray, commanded: FloatArray, actual: FloatArray) -> Frame:
        """Return the strip at a time, (height, width, 3).

        Args:
            now_s: right end of the plots [s].
            time_s: of the samples, the first at the start, (n,) [s].
            commanded: held until each sample, (n, panels); the first one counts for nothing.
            actual: at each sample, (n, panels).
        """
        size = (_FINER * self._width, _FINER * self._height)
        image = Image.new("RGB", size, _PAPER)
        pen = ImageDraw.Draw(image)
        font = _font(round(_FINER * max(11, self._height / 12)))
        line = round(1.5 * font.size)
        self._legend(pen, font, line)
        for i, panel in enumerate(self._panels):
            left, right = (round(size[0] * (i + end) / len(self._panels)) for end in (0.0, 1.0))
            label = round(pen.textlength(f"-{panel.limit:g}", font=font)) + 4 * _FINER
            box = (left + label + 2 * _FINER, 2 * line + 2 * _FINER, right - 6 * _FINER, size[1] - 6 * _FINER)
            pen.text((left + label, line), panel.title, font=font, fill=_INK)
            _axes(pen, font, box, panel)
            stairs = _stairs(time_s, commanded[:, i], now_s)
            curve = _until(time_s, actual[:, i], now_s)
            for points, colour in ((stairs, COMMANDED), (curve, ACTUAL)):
                _line(image, box, points, colour, now_s, panel.limit)
        small = image.resize((self._width, self._height), Image.Resampling.LANCZOS)
        frame: Frame = np.asarray(small, np.uint8)
        return frame

    def _legend(self, pen: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont, line: int) -> None:
        x = 6.0 * _FINER
        pieces = (("commanded", COMMANDED), ("actual", ACTUAL), (f"the last {WINDOW_S:g} s", _INK))
        for text, colour in pieces:
            pen.text((x, 0.15 * line), text, font=font, fill=colour)
            x += pen.textlength(text, font=font) + font.size
        right = _FINER * (self._width - 6)
        pen.text((right, 0.15 * line), self._title, font=font, fill=_INK, anchor="ra")


def _axes(
    pen: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont, box: tuple[int, int, int, int], panel: Panel
) -> None:
    left, top, right, bottom = box
    middle = (top + bottom) / 2
    pen.line((left, middle, right, middle), fill=_FAINT, width=_FINER)
    pen.line((left, top, left, bottom), fill=_FAINT, width=_FINER)
    for value, y in ((panel.limit, top), (0.0, middle), (-panel.limit, bottom)):
        pen.text((left - 3 * _FINER, y), f"{value:g}", font=font, fill=_INK, anchor="rm")


def _line(
    image: Image.Image,
    box: tuple[int, int, int, int],
    points: FloatArray,
    colour: tuple[int, int, int],
    now_s: float,
    limit: float,
) -> None:
    """Draw a curve of points (n, 2) [s, value] into a box; what is beyond runs along its edge."""
    left, top, right, bottom = box
    thick = 2 * _FINER
    x = (points[:, 0] - now_s + WINDOW_S) / WINDOW_S * (right - left)
    y = (1.0 - np.clip(points[:, 1] / limit, -1.0, 1.0)) / 2 * (bottom - top) + thick
    inside = Image.new("L", (right - left + 1, bottom - top + 1 + 2 * thick))
    pairs = [(float(a), float(b)) for a, b in zip(x, y, strict=True)]
    ImageDraw.Draw(inside).line(pairs, fill=255, width=thick)
    image.paste(colour, (left, top - thick), inside)


def _stairs(time_s: FloatArray, values: FloatArray, now_s: float) -> FloatArray:
    """Return the corners of what is held until each sample, (n, 2), up to now."""
    corners = [
        (min(float(t), now_s), float(value))
        for start, end, value in zip(time_s[:-1], time_s[1:], values[1:], strict=True)
        if start < now_s
        for t in (start, end)
    ]
    return np.array(corners).reshape(-1, 2)


def _until(time_s: FloatArray, values: FloatArray, now_s: float) -> FloatArray:
    """Return the samples up to now, the last one interpolated, (n, 2)."""
    past = time_s < now_s
    clock = np.append(time_s[past], now_s)
    return np.stack([clock, np.interp(clock, time_s, values)], axis=1)


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size=size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # what Pillow brings, where a size is given
    return font


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
