"""How a picture shows the robot (camera, size, quality), and captions drawn into pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError

if TYPE_CHECKING:
    from PIL import ImageFont

Frame = npt.NDArray[np.uint8]
"""A picture, shape (height, width, 3)."""
Quality = Literal["light", "full"]
"""light: for software renderers, with coarser round shapes, a smaller shadow map, no reflections and one
sample per pixel; full: as the model asks."""
LARGEST_PX: Final = 8192
"""Longest side of a picture [pixels]; every OpenGL driver draws this size."""


@dataclass(frozen=True)
class View:
    """How to look at the robot.

    Raises:
        InputError: a size that is not a whole number of pixels from 16 to 8192, or an unknown quality.
    """

    camera: str = "track"
    """Name of a camera of the model."""
    width: int = 640
    """Width [pixels], even for a video."""
    height: int = 480
    """Height [pixels], even for a video."""
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


def draw_caption(frame: Frame, lines: Sequence[str], widest: str) -> None:
    """Draw lines of text in a dark box in the upper left corner of a picture, in place.

    Only the box is touched, which is cheap enough for every frame of a video; lines that do not fit are cut
    off. `widest` is a text as wide as the box, the same for all frames of a video so that it does not move.
    """
    from PIL import Image, ImageDraw

    size = max(11, frame.shape[0] // 36)
    font, pitch, margin = _font(size), round(1.35 * size), size // 2
    height = pitch * len(lines) + margin
    width = _text_width(size, widest) + 3 * margin
    box = frame[margin : margin + height, margin : margin + width]
    picture = Image.fromarray((box * 0.4).astype(np.uint8))
    pen = ImageDraw.Draw(picture)
    for i, line in enumerate(lines):
        pen.text((margin, margin // 2 + i * pitch), line, font=font, fill=(255, 255, 255))
    box[:] = np.asarray(picture)


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    from PIL import ImageFont

    return ImageFont.load_default(size=size)


@lru_cache(maxsize=8)
def _text_width(size: int, text: str) -> int:
    left, _, right, _ = _font(size).getbbox(text)
    return int(right - left)
