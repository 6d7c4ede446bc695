"""How to look at the robot: camera, size of the picture, quality.

Lines of text in a dark box over a picture's upper left corner, drawn cheaply enough for every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from mecanum_env.errors import InputError

Quality = Literal["light", "full"]
LARGEST_PX = 8192
"""Longest side of a picture [pixels]; what OpenGL must be able to draw begins not far above."""


@dataclass(frozen=True)
class View:
    """How to look at the robot.

    "light" is for software renderers, which spend their time on vertices and pixels: coarser round shapes,
    a smaller shadow map, no reflections and one sample a pixel. "full" keeps what the model asks for.

    Raises:
        InputError: a size that is not a whole number of pixels from 16 to 8192, or no such quality.
    """

    camera: str = "track"
    """A camera of the model by name."""
    width: int = 640
    """In pixels; even for a video."""
    height: int = 480
    """In pixels; even for a video."""
    quality: Quality = "light"
    caption: bool = True
    """Draw time, command and actual motion into the picture."""

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            value = getattr(self, name)
            if value != int(value) or not 16 <= value <= LARGEST_PX:
                raise InputError(
                    f"{name} = {value}, must be a whole number of pixels from 16 to {LARGEST_PX}"
                )
        if self.quality not in get_args(Quality):
            raise InputError(f"quality = {self.quality!r}, must be {' or '.join(get_args(Quality))}")


Frame = npt.NDArray[np.uint8]

_DARKEN = 0.4  # what is left of the picture behind the text
_WHITE = (255, 255, 255)


def draw_caption(frame: Frame, lines: Sequence[str], widest: str) -> None:
    """Draw lines of text into a picture, in place; only the box behind them is touched.

    Args:
        frame: (height, width, 3), writable.
        lines: top to bottom; what does not fit is cut off.
        widest: a text as wide as the box is to be, the same for all frames so that the box keeps still.
    """
    size = max(11, frame.shape[0] // 36)
    font, pitch, margin = _font(size), round(1.35 * size), size // 2
    height = pitch * len(lines) + margin
    width = _width(size, widest) + 3 * margin
    box = frame[margin : margin + height, margin : margin + width]
    picture = Image.fromarray((box * _DARKEN).astype(np.uint8))
    pen = ImageDraw.Draw(picture)
    for i, line in enumerate(lines):
        pen.text((margin, margin // 2 + i * pitch), line, font=font, fill=_WHITE)
    box[:] = np.asarray(picture)


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)


@lru_cache(maxsize=8)
def _width(size: int, text: str) -> int:
    left, _, right, _ = _font(size).getbbox(text)
    return int(right - left)
