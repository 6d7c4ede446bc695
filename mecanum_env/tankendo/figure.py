"""What the opponent looks like: shapes to add to a rendered scene, from its pose and the tip of its sword."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mecanum_env.mjcf.chassis import SWORD_M
from mecanum_env.tankendo.constants import GUARD_TIP_M, Rules
from mecanum_env.units import FloatArray

Kind = Literal["ellipsoid", "rod"]
Colour = tuple[float, float, float, float]
_INDIGO: Colour = (0.13, 0.17, 0.36, 1.0)
_DARK: Colour = (0.09, 0.10, 0.14, 1.0)
_ARMOUR: Colour = (0.42, 0.10, 0.12, 1.0)
_METAL: Colour = (0.72, 0.74, 0.77, 1.0)
_BAMBOO: Colour = (0.86, 0.72, 0.42, 1.0)
_LEATHER: Colour = (0.93, 0.91, 0.85, 1.0)
_STRIKING: Colour = (1.0, 0.35, 0.10, 1.0)
_HIT: Colour = (0.95, 0.10, 0.08, 0.75)
_OPEN: Colour = (0.15, 0.65, 0.30, 0.9)
_CLOSED: Colour = (0.45, 0.47, 0.52, 0.7)
_RING_DOTS = 60  # dots of the circle at maai around the opponent
_GRIP_HEIGHT_M, _GRIP_AHEAD_M = 0.46, 0.08


@dataclass(frozen=True)
class Shape:
    """One shape: an ellipsoid at `start` with half-axes `size`, or a rod from `start` to `end`."""

    kind: Kind
    colour: Colour
    start: tuple[float, float, float]
    size: tuple[float, float, float]
    """Half-axes of an ellipsoid along the opponent's heading, across it and up [m]; of a rod, the radius."""
    end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading_rad: float = 0.0


@dataclass(frozen=True)
class Picture:
    """What is drawn of one episode beside the robot."""

    place: FloatArray
    """Position of the opponent: x, y [m]."""
    heading_rad: float
    """Heading of the opponent."""
    tip: FloatArray
    """Tip of its sword: x, y, z [m]."""
    striking: bool
    """Whether the sword goes forward or has just hit."""
    lane: tuple[FloatArray, FloatArray] | None
    """Start and end of its strike on the floor: x, y [m]; None: it does not strike."""
    hit_at: FloatArray | None
    """Where the robot was hit: x, y, z [m]; None: it was not."""
    at_maai: bool
    """Whether the robot is at maai and faces the opponent."""
    rules: Rules


def opponent_shapes(picture: Picture) -> list[Shape]:
    """Return the shapes of the opponent, its sword, its strike, and the ring of maai around it."""
    cos, sin = float(np.cos(picture.heading_rad)), float(np.sin(picture.heading_rad))
    x, y = (float(value) for value in picture.place)
    tip = tuple(float(value) for value in picture.tip)

    # In a long strike the upper body leans forward.
    stretch = float(np.hypot(tip[0] - x, tip[1] - y)) - GUARD_TIP_M
    lean = 0.45 * min(max(stretch, 0.0), 0.9)

    def at(ahead: float, left: float, up: float) -> tuple[float, float, float]:
        """Return a point in the field's frame, shifted forward by the lean of the body at its height."""
        ahead += lean * min(max((up - 0.15) / 0.5, 0.0), 1.0)
        return x + ahead * cos - left * sin, y + ahead * sin + left * cos, up

    def blob(colour: Colour, place: tuple[float, float, float], size: tuple[float, float, float]) -> Shape:
        return Shape("ellipsoid", colour, place, size, heading_rad=picture.heading_rad)

    def rod(
        colour: Colour, radius: float, start: tuple[float, float, float], end: tuple[float, float, float]
    ) -> Shape:
        return Shape("rod", colour, start, (radius, 0.0, 0.0), end)

    anchor = np.array(at(_GRIP_AHEAD_M, 0.0, _GRIP_HEIGHT_M))
    along = (np.array(tip) - anchor) / max(float(np.linalg.norm(np.array(tip) - anchor)), 1e-6)

    def blade(share: float) -> tuple[float, float, float]:
        """Return the point at a share of the sword's length, from pommel to tip."""
        a, b, c = np.array(tip) - SWORD_M * (1.0 - share) * along
        return float(a), float(b), float(c)

    steel = _STRIKING if picture.striking else _BAMBOO
    shapes = [
        blob(_DARK, at(0.0, 0.0, 0.07), (0.19, 0.22, 0.08)),
        blob(_DARK, at(0.0, 0.0, 0.20), (0.14, 0.17, 0.19)),
        blob(_INDIGO, at(0.0, 0.0, 0.36), (0.11, 0.15, 0.12)),
        blob(_INDIGO, at(0.0, 0.0, 0.49), (0.09, 0.16, 0.10)),
        blob(_ARMOUR, at(0.03, 0.0, 0.42), (0.10, 0.12, 0.11)),
        blob(_INDIGO, at(0.0, 0.0, 0.67), (0.085, 0.08, 0.095)),
        blob(_METAL, at(0.055, 0.0, 0.665), (0.045, 0.055, 0.065)),
        rod(_LEATHER, 0.015, blade(0.0), blade(0.27)),
        rod(_LEATHER, 0.034, blade(0.27), blade(0.29)),
        rod(steel, 0.013, blade(0.29), blade(0.92)),
        rod(_LEATHER, 0.014, blade(0.92), blade(1.0)),
    ]
    for side, share in ((-1.0, 0.22), (1.0, 0.06)):
        shoulder, hand = at(0.0, 0.16 * side, 0.53), blade(share)
        elbow = tuple(
            0.5 * (s + h) - (0.07 if i == 2 else 0.0)
            for i, (s, h) in enumerate(zip(shoulder, hand, strict=True))
        )
        shapes += [
            rod(_INDIGO, 0.038, shoulder, (elbow[0], elbow[1], elbow[2])),
            rod(_DARK, 0.034, (elbow[0], elbow[1], elbow[2]), hand),
        ]
    ring = _OPEN if picture.at_maai else _CLOSED
    for angle in 2.0 * np.pi * np.arange(_RING_DOTS) / _RING_DOTS:
        place = (
            x + picture.rules.maai_m * float(np.cos(angle)),
            y + picture.rules.maai_m * float(np.sin(angle)),
            0.004,
        )
        shapes.append(Shape("ellipsoid", ring, place, (0.022, 0.022, 0.003)))
    if picture.lane is not None:
        start, end = ((float(p[0]), float(p[1]), 0.006) for p in picture.lane)
        shapes.append(rod((1.0, 0.35, 0.10, 0.6), 0.012, start, end))
    if picture.hit_at is not None:
        a, b, c = (float(value) for value in picture.hit_at)
        shapes.append(Shape("ellipsoid", _HIT, (a, b, c), (0.09, 0.09, 0.09)))
    return shapes
