"""How each effect is measured by itself, without driving: for candidates that no command separates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_DELAYS: Final = (
    "when a command is sent, when the drive acts and when a sensor reads, by time stamps of one clock"
)
_SPEED: Final = "a wheel's true speed, with a tachometer or by counting its turns"
_CURRENT: Final = "the motor's current at several steady speeds and at break-away"
_WEIGHT: Final = "the load under each wheel, on a scale"

DIRECT: Final[Mapping[str, str]] = {
    "command_latency": _DELAYS,
    "sensor_latency": _DELAYS,
    "sensor_lowpass": "the sensor's filter, in its settings or data sheet",
    "command_deadband": "the smallest command that makes the motor draw current",
    "body_speed_limit": "the command that reaches the drives, in the controller's own log",
    "body_acceleration_limit": "the command that reaches the drives, in the controller's own log",
    "acceleration_limit": "the setpoint in the drive's own log",
    "speed_saturation": "the motor's voltage at full speed",
    "speed_gain": _SPEED,
    "wheel_gain_mismatch": "each wheel's true speed, with a tachometer",
    "direction_asymmetry": "a wheel's true speed both ways, with a tachometer",
    "battery_sag": "the battery's voltage, logged as battery_v",
    "weak_servo": "how much a wheel slows down under a known torque",
    "backlash": "how far a wheel turns by hand while its motor is held",
    "coulomb_friction": _CURRENT,
    "stiction": _CURRENT,
    "viscous_friction": _CURRENT,
    "roller_friction": "the force that pushes the robot sideways, with a spring balance",
    "low_grip": "the force at which the robot with locked wheels slides, with a spring balance",
    "payload": _WEIGHT,
    "com_offset": _WEIGHT,
    "wheel_radius": "how far a wheel rolls in ten turns, with a tape",
    "track_width": "wheelbase and track, with a tape",
    "floor_slope": "the floor, with a level",
    "mount_yaw": "the angle between sensor and chassis",
    "sensor_scale": "the sensor against another: a tachometer, a tape, full turns by hand",
    "sensor_bias": "the sensor while the robot stands still",
}
"""Effect -> what to measure."""
