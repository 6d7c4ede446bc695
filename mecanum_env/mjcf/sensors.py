"""Sensors that every robot model has, by the same names in the roller model and the planar plant."""

from __future__ import annotations

import mujoco

from mecanum_env.kinematics import WHEELS

_SITE = mujoco.mjtObj.mjOBJ_SITE


def add_sensors(spec: mujoco.MjSpec) -> None:
    """Add wheel speeds and the motion of the site "base".

    | sensor | value |
    |---|---|
    | `wheel_fl_speed` .. `wheel_rr_speed` | wheel speed [rad/s] |
    | `base_velocity` | velocity in the body's frame [m/s] |
    | `base_gyro` | angular velocity in the body's frame [rad/s] |
    | `base_accelerometer` | acceleration in the body's frame, gravity included [m/s^2] |
    | `base_position`, `base_orientation` | pose in the world [m, quaternion] |
    """
    for wheel in WHEELS:
        spec.add_sensor(
            name=f"wheel_{wheel}_speed",
            type=mujoco.mjtSensor.mjSENS_ACTUATORVEL,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=f"wheel_{wheel}",
        )
    for name, kind in (
        ("base_velocity", mujoco.mjtSensor.mjSENS_VELOCIMETER),
        ("base_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("base_accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ("base_position", mujoco.mjtSensor.mjSENS_FRAMEPOS),
        ("base_orientation", mujoco.mjtSensor.mjSENS_FRAMEQUAT),
    ):
        spec.add_sensor(name=name, type=kind, objtype=_SITE, objname="base")
