"""The columns a log may have, with their units; the one list that reader, writer and importer share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mecanum_env.kinematics import WHEELS

TIME: Final = "time_s"
BENCH_COMMAND: Final = ("command_rpm",)
BODY_COMMAND: Final = ("command_v_rpm", "command_theta_deg", "command_vc_rpm")
WHEEL_COMMAND: Final = tuple(f"command_{wheel}_rpm" for wheel in WHEELS)
COMMANDS: Final = (*BENCH_COMMAND, *BODY_COMMAND, *WHEEL_COMMAND)

WHEEL_SPEEDS: Final = tuple(f"speed_{wheel}_rpm" for wheel in WHEELS)

UNITS: Final[Mapping[str, str]] = {
    "speed_rpm": "rpm",
    **dict.fromkeys(WHEEL_SPEEDS, "rpm"),
    "vx_m_s": "m/s",
    "vy_m_s": "m/s",
    "yaw_rate_rad_s": "rad/s",
    "x_m": "m",
    "y_m": "m",
    "yaw_rad": "rad",
    "battery_v": "V",
}
"""Measured columns and their units."""

BENCH_CHANNELS: Final = ("speed_rpm", "battery_v")
ROBOT_CHANNELS: Final = tuple(name for name in UNITS if name != "speed_rpm")
ROBOT_MOTION: Final = tuple(name for name in ROBOT_CHANNELS if name != "battery_v")
"""A robot log needs at least one of these."""

KNOWN: Final = (TIME, *COMMANDS, *UNITS)

REST: Final[Mapping[str, float]] = {
    "speed_rpm": 1.0,
    **dict.fromkeys(WHEEL_SPEEDS, 1.0),
    "vx_m_s": 0.02,
    "vy_m_s": 0.02,
    "yaw_rate_rad_s": 0.05,
}
"""Speeds up to which a channel counts as at rest, in its own unit: about 1 rpm of a wheel, sensor noise."""
