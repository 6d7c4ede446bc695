"""A strip of plots under the picture: commanded against actual speed of the last seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mecanum_env.rendering.caption import Frame
from mecanum_env.units import FloatArray

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
