"""How to look at the robot: camera, size of the picture, quality."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

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
