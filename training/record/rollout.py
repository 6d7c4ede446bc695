"""One episode of a controller as frames: the scene, and plots of commanded and actual speed under it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.kinematics import command_to_twist
from mecanum_env.model import Model
from mecanum_env.rendering.view import LARGEST_PX, Frame
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.drawing import Painter
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.units import FloatArray
from training.controllers.interface import Controller
from training.evaluate.play import body_velocity

WINDOW_S: Final = 4.0
"""Length of the plotted past [s]."""
_STRIP_SHARE: Final = 0.32
"""Share of the frame's height that the plots take."""
AFTER_S: Final = 1.0
"""Time that the last frame stays [s]."""
COMMANDED: Final = (255, 159, 28)
"""Colour of the commanded speed."""
ACTUAL: Final = (92, 184, 255)
"""Colour of the actual speed."""
_BACKGROUND, _TEXT, _FAINT = (24, 26, 31), (235, 235, 235), (74, 78, 88)
_SCALE: Final = 2
"""Plots are drawn this much larger and scaled down, for smooth lines."""
_SMALLEST: Final = {"width": 320, "height": 240}


@dataclass(frozen=True)
class Panel:
    """One plot."""

    title: str
    limit: float
    """End of the value axis, which begins at minus this."""


class Strip:
    """A strip of plots of the last seconds, side by side, with a legend and a title; sizes are in pixels."""

    def __init__(self, panels: Sequence[Panel], width: int, height: int, title: str = "") -> None:
        self._panels, self._width, self._height, self._title = tuple(panels), width, height, title

    def draw(self, now_s: float, time_s: FloatArray, commanded: FloatArray, actual: FloatArray) -> Frame:
        """Return the strip at a time, the right end of its time axis, as (height, width, 3) pixels.

        Each sample at `time_s`, shape (n,), has the actual values and the values commanded until then, both
        of shape (n, panels); those commanded until the first one are ignored.
        """
        size = (_SCALE * self._width, _SCALE * self._height)
        image = Image.new("RGB", size, _BACKGROUND)
        pen = ImageDraw.Draw(image)
        font = _font(round(_SCALE * max(11, self._height / 12)))
        line = round(1.5 * font.size)
        self._legend(pen, font, line)
        for i, panel in enumerate(self._panels):
            left, right = (round(size[0] * (i + end) / len(self._panels)) for end in (0.0, 1.0))
            label = round(pen.textlength(f"-{panel.limit:g}", font=font)) + 4 * _SCALE
            box = (left + label + 2 * _SCALE, 2 * line + 2 * _SCALE, right - 6 * _SCALE, size[1] - 6 * _SCALE)
            pen.text((left + label, line), panel.title, font=font, fill=_TEXT)
            _axes(pen, font, box, panel)
            _line(image, box, _stairs(time_s, commanded[:, i], now_s), COMMANDED, now_s, panel.limit)
            _line(image, box, _until(time_s, actual[:, i], now_s), ACTUAL, now_s, panel.limit)
        small = image.resize((self._width, self._height), Image.Resampling.LANCZOS)
        return np.asarray(small, np.uint8)

    def _legend(self, pen: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont, line: int) -> None:
        x = 6.0 * _SCALE
        past = f"the last {WINDOW_S:g} s"
        for text, colour in (("commanded", COMMANDED), ("actual", ACTUAL), (past, _TEXT)):
            pen.text((x, 0.15 * line), text, font=font, fill=colour)
            x += pen.textlength(text, font=font) + font.size
        right = _SCALE * (self._width - 6)
        pen.text((right, 0.15 * line), self._title, font=font, fill=_TEXT, anchor="ra")


def _axes(
    pen: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont, box: tuple[int, int, int, int], panel: Panel
) -> None:
    left, top, right, bottom = box
    middle = (top + bottom) / 2
    pen.line((left, middle, right, middle), fill=_FAINT, width=_SCALE)
    pen.line((left, top, left, bottom), fill=_FAINT, width=_SCALE)
    for value, y in ((panel.limit, top), (0.0, middle), (-panel.limit, bottom)):
        pen.text((left - 3 * _SCALE, y), f"{value:g}", font=font, fill=_TEXT, anchor="rm")


def _line(
    image: Image.Image,
    box: tuple[int, int, int, int],
    points: FloatArray,
    colour: tuple[int, int, int],
    now_s: float,
    limit: float,
) -> None:
    """Draw a curve of points (time [s], value), shape (n, 2), into a box, clipped to its edges."""
    left, top, right, bottom = box
    thick = 2 * _SCALE
    x = (points[:, 0] - now_s + WINDOW_S) / WINDOW_S * (right - left)
    y = (1.0 - np.clip(points[:, 1] / limit, -1.0, 1.0)) / 2 * (bottom - top) + thick
    inside = Image.new("L", (right - left + 1, bottom - top + 1 + 2 * thick))
    pairs = [(float(a), float(b)) for a, b in zip(x, y, strict=True)]
    ImageDraw.Draw(inside).line(pairs, fill=255, width=thick)
    image.paste(colour, (left, top - thick), inside)


def _stairs(time_s: FloatArray, values: FloatArray, now_s: float) -> FloatArray:
    """Return the corners of a curve that holds each value until its sample, shape (n, 2), up to now."""
    corners = [
        (min(float(t), now_s), float(value))
        for start, end, value in zip(time_s[:-1], time_s[1:], values[1:], strict=True)
        if start < now_s
        for t in (start, end)
    ]
    return np.array(corners).reshape(-1, 2)


def _until(time_s: FloatArray, values: FloatArray, now_s: float) -> FloatArray:
    """Return the samples up to now, the last one interpolated, shape (n, 2)."""
    past = time_s < now_s
    clock = np.append(time_s[past], now_s)
    return np.stack([clock, np.interp(clock, time_s, values)], axis=1)


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size=size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # Pillow's own font, if a size is given
    return font


def rollout_frames(
    env: TankendoEnv,
    controller: Controller,
    known: Model,
    plant: RobotPlant,
    *,
    seed: int = 0,
    width: int = 640,
    height: int = 480,
    fps: float = 30.0,
    title: str = "",
) -> Iterator[Frame]:
    """Play an episode and return its frames, each (height, width, 3).

    Args:
        env: an environment with `action_mode="command"`.
        controller: the controller, ready for an episode.
        known: the robot as the controller knows it; its kinematics give the commanded speed.
        plant: the simulated system of the environment.
        seed: of the episode.
        width: of the frames [pixels], even.
        height: of the frames [pixels], even.
        fps: frames per second of simulated time.
        title: shown over the plots, such as the controller's name.

    Raises:
        InputError: a size is odd, too small or too large, the seed is negative, or `fps` is out of range.
    """
    for name, pixels in (("width", width), ("height", height)):
        least = _SMALLEST[name]
        if pixels % 2 or not least <= pixels <= LARGEST_PX:
            raise InputError(f"{name} = {pixels} pixels, must be an even number from {least} to {LARGEST_PX}")
    require_at_least(0, seed=seed)
    if not 1.0 <= fps <= 240.0:
        raise InputError(f"fps = {fps}, must be 1 to 240")
    strip_height = 2 * round(_STRIP_SHARE * height / 2)
    strip = Strip(_panels(known), width, strip_height, title)

    def frames() -> Iterator[Frame]:
        arena = env.arena
        observation, _ = env.reset(seed=seed)
        painter = Painter(arena, plant, width, height - strip_height)
        samples = [_sample(arena, known)]
        each = max(1, round(fps * arena.step_s))
        over = False
        try:
            yield (frame := _stacked(painter.frame(), strip, 0.0, samples))
            while not over:
                before = arena.robots.qpos(0)
                step = env.step(command_to_action(controller.act(observation)))
                observation, _, terminated, truncated, _ = step
                over, after = terminated or truncated, arena.robots.qpos(0)
                samples.append(_sample(arena, known))
                for share in (i / each for i in range(1, each + 1)):
                    ago_s = (1.0 - share) * arena.step_s
                    picture = painter.frame(ago_s, before + share * (after - before))
                    yield (frame := _stacked(picture, strip, samples[-1][0] - ago_s, samples))
            for _ in range(round(AFTER_S * fps)):
                yield frame
        finally:
            painter.close()

    return frames()


def outcome(arena: Arena) -> str:
    """Return in a few words how the episode in the first row of an arena ended."""
    if arena.succeeded[0]:
        return "success"
    return "hit" if arena.hit[0] else "no success"


def _panels(known: Model) -> tuple[Panel, ...]:
    """Return the plots, with axes up to the speeds that the wheels can reach."""
    fastest = min(known.wheel.saturation_rpm, 200.0)
    speed = float(np.ceil(10.0 * command_to_twist(fastest, 0.0, 0.0, known.robot)[0]) / 10.0)
    turn = float(np.ceil(np.rad2deg(command_to_twist(0.0, 0.0, fastest, known.robot)[2]) / 10.0) * 10.0)
    return Panel("ahead, m/s", speed), Panel("left, m/s", speed), Panel("turn, deg/s", turn)


def _sample(arena: Arena, known: Model) -> tuple[float, FloatArray, FloatArray]:
    """Return time, commanded and actual (ahead, left [m/s], turn [deg/s]) of the first row."""
    v, theta, vc = arena.commands[0]
    commanded, degrees = command_to_twist(v, theta, vc, known.robot), np.array([1.0, 1.0, 180.0 / np.pi])
    return float(arena.time_s()[0]), commanded * degrees, body_velocity(arena, 0) * degrees


def _stacked(
    picture: Frame, strip: Strip, now_s: float, samples: list[tuple[float, FloatArray, FloatArray]]
) -> Frame:
    time_s = np.array([sample[0] for sample in samples])
    commanded, actual = (np.array([sample[i] for sample in samples]) for i in (1, 2))
    return np.concatenate([picture, strip.draw(now_s, time_s, commanded, actual)])
