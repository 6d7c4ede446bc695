"""Mecanum kinematics: command (V, theta, VC) <-> wheel speeds <-> body twist.

Wheels are in the order `WHEELS` = fl, fr, rl, rr; positive drives forward. Axes follow REP-103: x forward,
y left, yaw counter-clockwise. The rollers form an X seen from above, so without slip, with
k = half_wheelbase + half_track and wheel radius R (Taheri, Qiao and Ghaeminezhad, Int. J. of Computer
Applications 113(3), 2015):

    w_fl = (vx - vy - k wz) / R        w_fr = (vx + vy + k wz) / R
    w_rl = (vx + vy - k wz) / R        w_rr = (vx - vy + k wz) / R

The command of the robot is V [rpm], theta [deg], VC [rpm]: vx = V cos(theta) and vy = V sin(theta) in wheel
rpm, and VC is added as -, +, -, +. The paper does not print its Eq. 1, so whether its V carries a factor
sqrt(2) is unknown; `_COMMAND_GAIN` is the one place to change that.

Body twists also go to and from the wheels of robots on other omni wheels (`Geometry.wheels`), by the
equations of `mecanum_env.omni`, of which those above are the case of four Mecanum wheels.

All functions work on arrays with any leading axes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.omni import OmniWheel, speeds_to_twist, twist_to_speeds
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

WHEELS: Final = ("fl", "fr", "rl", "rr")
BODY_COMMAND: Final = ("command_v_rpm", "command_theta_deg", "command_vc_rpm")
"""Columns of a command of the robot: V, theta, VC."""
WHEEL_COMMAND: Final = tuple(f"command_{wheel}_rpm" for wheel in WHEELS)
"""Columns of a command of the four wheels."""
WHEEL_SPEEDS: Final = tuple(f"speed_{wheel}_rpm" for wheel in WHEELS)
"""Columns of the measured speeds of the four wheels."""
TWIST: Final = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")
"""Columns of a measured body twist."""
POSE: Final = ("x_m", "y_m", "yaw_rad")
"""Columns of a measured pose in the world."""
ROBOT_CHANNELS: Final = (*WHEEL_SPEEDS, *TWIST, *POSE)
"""All columns that may be measured of a robot's motion."""
_COMMAND_GAIN: Final = 1.0
"""Wheel speed per V [rpm/rpm]; an assumption of this project, see the module docstring."""

# Rows fl, fr, rl, rr; columns: forward, left, counter-clockwise.
_MIXING: Final = np.array([[1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0]])
_MIXING_ROWS: Final[list[list[float]]] = _MIXING.tolist()
_RAD_PER_DEG: Final = math.pi / 180.0


class Geometry(Protocol):
    """Dimensions that the kinematics need; `mecanum_env.model.Robot` has them."""

    @property
    def wheel_radius_m(self) -> float:
        """Radius of a wheel [m]."""

    @property
    def half_wheelbase_m(self) -> float:
        """Half the distance between the axles [m]."""

    @property
    def half_track_m(self) -> float:
        """Half the distance between left and right wheels [m]."""

    @property
    def wheels(self) -> tuple[OmniWheel, ...]:
        """The wheels of a robot that has not the four Mecanum wheels of the dimensions above; else empty."""


def yaw_arm_m(geometry: Geometry) -> float:
    """Return k = half_wheelbase + half_track [m], the lever of each wheel about the yaw axis."""
    return geometry.half_wheelbase_m + geometry.half_track_m


def mecanum_wheels(geometry: Geometry) -> tuple[OmniWheel, ...]:
    """Return the wheels of a geometry as omni wheels: its own list, or four Mecanum wheels fl, fr, rl, rr."""
    if geometry.wheels:
        return geometry.wheels
    x, y = geometry.half_wheelbase_m, geometry.half_track_m
    corners = ((x, y), (x, -y), (-x, y), (-x, -y))
    return tuple(
        OmniWheel(
            name,
            angle_deg=math.degrees(math.atan2(left, ahead)),
            distance_m=math.hypot(ahead, left),
            radius_m=geometry.wheel_radius_m,
            drive_deg=0.0,
            roller_deg=math.copysign(45.0, -ahead * left),
        )
        for name, (ahead, left) in zip(WHEELS, corners, strict=True)
    )


def require_mecanum(geometry: Geometry, what: str) -> None:
    """Refuse a geometry with a list of omni wheels where only four Mecanum wheels will do, for `what`.

    Raises:
        InputError: `geometry.wheels` is not empty.
    """
    if geometry.wheels:
        raise InputError(
            f"robot.wheels lists {len(geometry.wheels)} wheels, but {what} of four Mecanum wheels; study "
            "such a "
            "robot wheel by wheel, and its body by `python -m sysid.logs body` (docs/robot.md)"
        )


def command_to_wheels(v_rpm: npt.ArrayLike, theta_deg: npt.ArrayLike, vc_rpm: npt.ArrayLike) -> FloatArray:
    """Return wheel speeds [rpm], shape (..., 4), of commands V [rpm], theta [deg], VC [rpm], shapes (...)."""
    v, theta = _COMMAND_GAIN * np.asarray(v_rpm, float), np.deg2rad(np.asarray(theta_deg, float))
    forward, left, turn = v * np.cos(theta), v * np.sin(theta), np.asarray(vc_rpm, float)
    # Filled rather than stacked: a single environment calls this in each step.
    body = np.empty((*np.broadcast(forward, turn).shape, 3))
    body[..., 0], body[..., 1], body[..., 2] = forward, left, turn
    return body_to_wheels(body)


def command_wheels(v_rpm: float, theta_deg: float, vc_rpm: float) -> list[float]:
    """Return what `command_to_wheels` does of one command, as numbers, in a third of its time."""
    v, theta = _COMMAND_GAIN * v_rpm, theta_deg * _RAD_PER_DEG
    forward, left = v * float(np.cos(theta)), v * float(np.sin(theta))
    return [a * forward + b * left + c * vc_rpm for a, b, c in _MIXING_ROWS]


def body_to_wheels(body_rpm: npt.ArrayLike) -> FloatArray:
    """Return wheel speeds [rpm], (..., 4), of body commands (forward, left, turn) [rpm], shape (..., 3)."""
    return np.asarray(np.asarray(body_rpm, float) @ _MIXING.T)


def wheels_to_body(wheels_rpm: npt.ArrayLike) -> FloatArray:
    """Return body commands (forward, left, turn) [rpm], (..., 3), of wheel speeds [rpm], shape (..., 4).

    The one motion of four wheels that the body cannot follow (front against rear wheels) is
    dropped, as by the pseudo-inverse.
    """
    # The columns of the mixing matrix are orthogonal.
    return np.asarray(np.asarray(wheels_rpm, float) @ _MIXING / 4.0)


def wheels_to_command(wheels_rpm: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return V >= 0 [rpm], theta in (-180, 180] [deg] and VC [rpm], shapes (...), of wheel speeds (..., 4).

    Wheel motion that the body cannot follow is dropped, see `wheels_to_body`. If V is 0, so is theta.
    """
    body = wheels_to_body(wheels_rpm)
    v = np.hypot(body[..., 0], body[..., 1]) / _COMMAND_GAIN
    # Adding 0.0 turns -0.0 into 0.0; arctan2 would give it a direction (-180 or 180 degrees).
    theta = np.rad2deg(np.arctan2(body[..., 1] + 0.0, body[..., 0] + 0.0))
    return v, theta, body[..., 2]


def twist_to_wheels(twist: npt.ArrayLike, geometry: Geometry) -> FloatArray:
    """Return wheel speeds [rpm], shape (..., N), of body twists (vx, vy [m/s], wz [rad/s]), (..., 3).

    N is 4, or the number of `geometry.wheels` where it lists any.
    """
    if geometry.wheels:
        return twist_to_speeds(twist, geometry.wheels)
    scale = np.array([1.0, 1.0, yaw_arm_m(geometry)])
    surface_m_s: FloatArray = (np.asarray(twist, float) * scale) @ _MIXING.T
    return surface_m_s / (geometry.wheel_radius_m * RAD_S_PER_RPM)


def wheels_to_twist(wheels_rpm: npt.ArrayLike, geometry: Geometry) -> FloatArray:
    """Return body twists (vx, vy [m/s], wz [rad/s]), shape (..., 3), of wheel speeds [rpm], (..., N).

    N is 4, or the number of `geometry.wheels` where it lists any.
    """
    if geometry.wheels:
        return speeds_to_twist(wheels_rpm, geometry.wheels)
    surface_m_s = np.asarray(wheels_rpm, float) * (geometry.wheel_radius_m * RAD_S_PER_RPM)
    return np.asarray(surface_m_s @ _MIXING / 4.0 / np.array([1.0, 1.0, yaw_arm_m(geometry)]))


def command_to_twist(
    v_rpm: npt.ArrayLike, theta_deg: npt.ArrayLike, vc_rpm: npt.ArrayLike, geometry: Geometry
) -> FloatArray:
    """Return the body twist (vx, vy [m/s], wz [rad/s]), (..., 3), that a command asks for on a geometry.

    Saturation and dynamics are left out.

    Raises:
        InputError: the geometry is not of four Mecanum wheels.
    """
    require_mecanum(geometry, "the commands V, theta, VC are")
    return wheels_to_twist(command_to_wheels(v_rpm, theta_deg, vc_rpm), geometry)


def twist_to_command(twist: npt.ArrayLike, geometry: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the command V [rpm], theta [deg], VC [rpm], shapes (...), for a body twist, shape (..., 3).

    Raises:
        InputError: the geometry is not of four Mecanum wheels.
    """
    require_mecanum(geometry, "the commands V, theta, VC are")
    return wheels_to_command(twist_to_wheels(twist, geometry))


def round_command(
    v_rpm: npt.ArrayLike, theta_deg: npt.ArrayLike, vc_rpm: npt.ArrayLike, quantum_rpm: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Round V and VC to multiples of the quantum [rpm] and theta to 1 degree, as the robot does.

    A quantum of 0 means that the platform takes real numbers: nothing is rounded.
    """
    v, theta, vc = (np.asarray(x, float) for x in (v_rpm, theta_deg, vc_rpm))
    numbers: tuple[FloatArray, FloatArray, FloatArray] = rounded(np.rint, v, theta, vc, quantum_rpm)
    return numbers


def rounded(rint: Callable[[Any], Any], v_rpm: Any, theta_deg: Any, vc_rpm: Any, quantum_rpm: float) -> Any:
    """Do what `round_command` does, with numbers of any kind that the function `rint` rounds."""
    if quantum_rpm == 0.0:
        return v_rpm, theta_deg, vc_rpm
    return rint(v_rpm / quantum_rpm) * quantum_rpm, rint(theta_deg), rint(vc_rpm / quantum_rpm) * quantum_rpm


def clip_wheels(wheels_rpm: npt.ArrayLike, limit_rpm: float) -> FloatArray:
    """Clip each wheel by itself to +-limit [rpm], as the hardware does; the direction may change."""
    return np.asarray(np.clip(np.asarray(wheels_rpm, float), -limit_rpm, limit_rpm))


def scale_wheels(wheels_rpm: npt.ArrayLike, limit_rpm: float) -> FloatArray:
    """Scale all four wheels by one factor into +-limit [rpm]; the direction is kept."""
    wheels = np.asarray(wheels_rpm, float)
    largest = np.max(np.abs(wheels), axis=-1, keepdims=True)
    factor = np.divide(limit_rpm, largest, out=np.ones_like(largest), where=largest > limit_rpm)
    return clip_wheels(wheels * factor, limit_rpm)  # the product may exceed the limit by one rounding
