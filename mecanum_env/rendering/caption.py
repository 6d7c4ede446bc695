"""Lines of text in a dark box over a picture's upper left corner, drawn cheaply enough for every frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

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
