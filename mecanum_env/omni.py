"""Kinematics of robots on any number of omni wheels: wheel speeds <-> body twist.

A wheel at the place p of the body drives in the direction u when it turns forwards, and its rollers let the
floor slip freely across their axis a. Without slip along that axis, for the body's velocity v and yaw rate w
(Siegwart, Nourbakhsh and Scaramuzza, Introduction to Autonomous Mobile Robots, 2011, section 3.2, Swedish
wheel):

    R w_wheel (a . u) = a . (v + w z x p)

For an omni wheel, whose rollers turn about the direction in which it drives, a = u; a Mecanum wheel has 45
degrees between them (`mecanum_wheels`). Axes follow REP-103: x forward, y left, yaw counter-clockwise.

All functions work on arrays with any leading axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

_SMALLEST = 1e-6
"""Least singular value of the wheels' rows, over the largest, for wheels that drive all three motions."""


@dataclass(frozen=True)
class OmniWheel:
    """One wheel: where it is, which way it drives, how its rollers lie.

    Raises:
        InputError: a number that is not finite, a size that is not above 0, or rollers across the wheel.
    """

    name: str
    """As in the columns of logs: ``speed_NAME_rpm``."""
    angle_deg: float
    """Bearing of the wheel from the body's centre, counter-clockwise from forward."""
    distance_m: float
    """Distance of the wheel from the body's centre."""
    radius_m: float
    drive_deg: float | None = None
    """Direction in which the wheel drives when it turns forwards, counter-clockwise from the body's forward;
    None: across the line to the centre, so that all wheels forwards turn the body counter-clockwise."""
    roller_deg: float = 0.0
    """Angle of the rollers' axis to that direction, counter-clockwise: 0 for an omni wheel, +-45 for
    Mecanum."""

    def __post_init__(self) -> None:
        where = f"wheel {self.name}"
        for name in ("angle_deg", "distance_m", "radius_m", "roller_deg"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"{where}: {name} = {getattr(self, name)}, must be a finite number")
        for name in ("distance_m", "radius_m"):
            if getattr(self, name) <= 0.0:
                raise InputError(f"{where}: {name} = {getattr(self, name)}, must be above 0")
        if self.drive_deg is not None and not math.isfinite(self.drive_deg):
            raise InputError(f"{where}: drive_deg = {self.drive_deg}, must be a finite number")
        if not abs(self.roller_deg) < 85.0:
            raise InputError(
                f"{where}: roller_deg = {self.roller_deg}, must be within -85 .. 85; such rollers carry "
                "nothing"
            )

    @property
    def heading_deg(self) -> float:
        """Direction in which the wheel drives [deg]."""
        return self.angle_deg + 90.0 if self.drive_deg is None else self.drive_deg


def wheel_rows(wheels: Sequence[OmniWheel]) -> FloatArray:
    """Return what the floor under the wheels moves per unit of body twist, shape (N, 3).

    Row n times (vx, vy [m/s], yaw rate [rad/s]) is the speed of the rim of wheel n of `wheels` [m/s].
    """
    rows = []
    for wheel in wheels:
        forward, left = _cos_sin(wheel.heading_deg)
        slant = math.copysign(1.0, wheel.roller_deg)
        slant *= 1.0 if abs(wheel.roller_deg) == 45.0 else math.tan(math.radians(abs(wheel.roller_deg)))
        along = forward - slant * left, left + slant * forward
        x, y = (wheel.distance_m * part for part in _cos_sin(wheel.angle_deg))
        rows.append((*along, x * along[1] - y * along[0]))
    return np.array(rows)


def require_all_motions(wheels: Sequence[OmniWheel]) -> None:
    """Refuse `wheels` that share a name, or that cannot drive forward, sideways and turning at will.

    Raises:
        InputError: two wheels have one name, there are fewer than three, or they all drive alike.
    """
    names = [wheel.name for wheel in wheels]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"two wheels have the name {name}; give each its own")
    rows = wheel_rows(wheels)
    if len(wheels) >= 3:
        sizes = np.linalg.svd(rows / np.linalg.norm(rows, axis=0).clip(min=_SMALLEST), compute_uv=False)
        if sizes[-1] > _SMALLEST * sizes[0]:
            return
    raise InputError(
        f"the {len(wheels)} wheels ({', '.join(names)}) cannot drive the body forward, sideways and "
        "turning at "
        "will; at least three omni wheels in different directions can. Study other robots wheel by wheel, "
        "as bench logs"
    )


def twist_to_speeds(twist: npt.ArrayLike, wheels: Sequence[OmniWheel]) -> FloatArray:
    """Return speeds [rpm] of `wheels`, shape (..., N), of twists (vx, vy [m/s], wz [rad/s]), (..., 3)."""
    body = np.asarray(twist, float)
    # Summed one by one: a matrix product may round the same row differently in batches of different size.
    ahead, left, turn = (body[..., i, np.newaxis] * column for i, column in enumerate(wheel_rows(wheels).T))
    return np.asarray((ahead + left + turn) / (_radii(wheels) * RAD_S_PER_RPM))


def speeds_to_twist(speeds_rpm: npt.ArrayLike, wheels: Sequence[OmniWheel]) -> FloatArray:
    """Return body twists (vx, vy [m/s], wz [rad/s]), shape (..., 3), of speeds of `wheels` [rpm], (..., N).

    With more than three wheels it is the twist with the least squared slip of the rims; motion of the wheels
    against each other, which the body cannot follow, is dropped.

    Raises:
        InputError: the wheels cannot drive all three motions.
    """
    require_all_motions(wheels)
    rim_m_s = np.asarray(speeds_rpm, float) * (_radii(wheels) * RAD_S_PER_RPM)
    return np.asarray(rim_m_s @ np.linalg.pinv(wheel_rows(wheels)).T)


def _radii(wheels: Sequence[OmniWheel]) -> FloatArray:
    return np.array([wheel.radius_m for wheel in wheels])


def _cos_sin(angle_deg: float) -> tuple[float, float]:
    """Return cosine and sine, exact at multiples of 90 degrees."""
    quarter = math.remainder(angle_deg, 360.0) / 90.0
    if quarter == round(quarter):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter) % 4]
    return math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
