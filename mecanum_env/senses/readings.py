"""The readings of a robot's sensors, and how late, noisy and incomplete they are.

Sources of the defaults of `Senses`: stereo cameras of robots deliver 30 to 90 frames a second (Intel
RealSense D435: 848 x 480 at up to 90 Hz, with a depth error below 2 % at 2 m, so 0.01 to 0.03 m at striking
distance). Delay, drop-outs and the noise of the odometry are this project's assumptions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.units import FloatArray

_MOST = {"frame_s": 1.0, "camera_delay_s": 1.0, "lost": 0.9, "own_lost": 0.9}


@dataclass(frozen=True)
class Senses:
    """How well the robot senses; noises are standard deviations.

    Raises:
        InputError: a value that no sensor has.
    """

    frame_s: float = 1 / 30
    """Time from one frame of the camera to the next [s]."""
    camera_delay_s: float = 0.05
    """Age of a frame when it has been evaluated [s]."""
    position_m: float = 0.01
    """Noise of the opponent's and its tip's position in a frame, along each axis [m]."""
    lost: float = 0.03
    """Share of the frames in which the opponent is not found, and independently of those without its tip."""
    lost_frames: float = 2.0
    """Mean number of frames in a row for which either is lost."""
    own_velocity_m_s: float = 0.02
    """Noise of the robot's own velocity, along each axis [m/s]."""
    own_yaw_rate_rad_s: float = 0.02
    """Noise of its yaw rate [rad/s]."""
    place_m: float = 0.02
    """Noise of its place in the field, along each axis [m]."""
    heading_rad: float = 0.01
    """Noise of its heading [rad]."""
    own_lost: float = 0.01
    """Share of the robot's readings of itself that are lost."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value: Any = getattr(self, one.name)
            least = 1.0 if one.name == "lost_frames" else 1e-3 if one.name == "frame_s" else 0.0
            most = _MOST.get(one.name, math.inf)
            if not (isinstance(value, Real) and math.isfinite(value) and least <= float(value) <= most):
                right = f"a number {least:g} .. {most:g}" if most < math.inf else f"a number from {least:g}"
                raise InputError(f"Senses.{one.name} = {value!r}, must be {right}")


@dataclass(frozen=True)
class VariedSenses:
    """A distribution of senses: `base` with the numbers in `ranges` drawn uniformly for each episode.

    `frame_s` cannot be drawn: it decides how many frames a command period has.

    Raises:
        InputError: a number that is none, or ends that senses cannot have.
    """

    base: Senses = Senses()
    ranges: Mapping[str, tuple[float, float]] = field(
        default_factory=lambda: {
            "camera_delay_s": (0.03, 0.10),
            "position_m": (0.005, 0.03),
            "lost": (0.0, 0.15),
            "lost_frames": (1.0, 4.0),
        }
    )
    """Name of a number of `Senses` -> the ends of its draw."""

    def __post_init__(self) -> None:
        known = [one.name for one in fields(Senses) if one.name != "frame_s"]
        for name, ends in self.ranges.items():
            if name not in known:
                raise InputError(
                    f"senses: no number {name!r}{did_you_mean(name, known)}; known: {', '.join(known)}"
                )
            if len(ends) != 2 or not ends[0] <= ends[1]:
                raise InputError(f"senses: {name} = {ends!r}, must be two numbers, the lower first")
            for end in ends:
                replace(self.base, **{name: end})
        ordered = {name: self.ranges[name] for name in sorted(self.ranges)}
        object.__setattr__(self, "ranges", MappingProxyType(ordered))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make a copy; a read-only mapping cannot be copied itself."""
        return type(self), (self.base, dict(self.ranges))

    def draw(self, rng: np.random.Generator) -> Senses:
        """Return senses drawn with the generator `rng`."""
        numbers = {
            name: low + (high - low) * float(rng.random()) for name, (low, high) in self.ranges.items()
        }
        return replace(self.base, **numbers)


@dataclass(frozen=True)
class CameraFrame:
    """What one frame showed to each of n robots, in the body frame at that time (x ahead, y left).

    What it did not find is NaN.
    """

    time_s: FloatArray
    """When it was taken, shape (n,) [s]."""
    opponent_m: FloatArray
    """The opponent's centre: x, y, shape (2, n) [m]."""
    tip_m: FloatArray
    """The tip of its sword: x, y and the height over the floor, shape (3, n) [m]."""


@dataclass(frozen=True)
class OwnReading:
    """What odometry and localisation say of each of n robots itself; NaN: lost."""

    time_s: FloatArray
    """When it was true, shape (n,) [s]."""
    velocity: FloatArray
    """Velocity ahead and left [m/s] and yaw rate [rad/s], shape (3, n)."""
    pose: FloatArray
    """Place x, y [m] in the field and heading [rad], shape (3, n)."""
