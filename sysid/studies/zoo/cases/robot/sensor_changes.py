"""Changes of what a robot's logs show of a motion that stays the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sysid.studies.zoo.cases.bench.change import Parameters, sign
from sysid.studies.zoo.cases.robot.change import RobotChange, factor, has_velocity, with_sensors
from sysid.studies.zoo.cases.robot.plans import RUN_S, top_speed_m_s
from sysid.studies.zoo.robots.robot import Robot

Rng = np.random.Generator
_LATE_S, _LAG_S, _WINDOW_S = 0.3, 0.3, 0.5
"""Gross delays."""


def _has_pose(robot: Robot) -> bool:
    return robot.sensors.pose


def _has_body_channel(robot: Robot) -> bool:
    return robot.sensors.velocity or robot.sensors.pose


def _top_yaw_rate_rad_s(robot: Robot) -> float:
    return top_speed_m_s(robot) / (robot.body.half_wheelbase_m + robot.body.half_track_m)


def _turned(robot: Robot, strength: float, rng: Rng) -> Robot:
    return with_sensors(robot, turned_deg=robot.sensors.turned_deg + 30.0 * strength * sign(rng))


def _turned_truth(before: Robot, after: Robot) -> Parameters:
    return {"angle_deg": after.sensors.turned_deg - before.sensors.turned_deg}


def _late(*fields: str) -> RobotChange:
    """Return the latency of the channels whose delays are these fields."""

    def changed(robot: Robot, strength: float, _rng: Rng) -> Robot:
        return with_sensors(
            robot, **{field: getattr(robot.sensors, field) + _LATE_S * strength for field in fields}
        )

    def truth(before: Robot, after: Robot) -> Parameters:
        return {"delay_s": getattr(after.sensors, fields[0]) - getattr(before.sensors, fields[0])}

    forms = {"wheels_late_s": "wheels", "late_s": "body", "pose_late_s": "pose"}
    needs = {"wheels": _has_body_channel, "body": has_velocity, "pose": _has_pose, "all": _has_body_channel}
    form = "all" if len(fields) > 1 else forms[fields[0]]
    return RobotChange("sensor_latency", form, changed, truth, needs[form])


def _lag(robot: Robot, strength: float, _rng: Rng) -> Robot:
    wheels = replace(robot.drive.sensor, filter_s=robot.drive.sensor.filter_s + _LAG_S * strength)
    lagged = with_sensors(robot, filter_s=robot.sensors.filter_s + _LAG_S * strength)
    return replace(lagged, drive=replace(robot.drive, sensor=wheels))


def _lag_truth(before: Robot, after: Robot) -> Parameters:
    return {"time_constant_s": after.sensors.filter_s - before.sensors.filter_s}


def _window(robot: Robot, strength: float, _rng: Rng) -> Robot:
    sensor = robot.drive.sensor
    # An encoder without a window counts over one sample.
    present = sensor.window_s or (sensor.sample_s if sensor.counts else 0.0)
    wheels = replace(sensor, window_s=present + _WINDOW_S * strength)
    averaged = with_sensors(robot, window_s=robot.sensors.window_s + _WINDOW_S * strength)
    return replace(averaged, drive=replace(robot.drive, sensor=wheels))


def _window_truth(before: Robot, after: Robot) -> Parameters:
    return {"window_s": after.sensors.window_s - before.sensors.window_s}


def _scaled(what: str) -> RobotChange:
    """Return the wrong scale of one kind of channel: wheel, linear or yaw."""
    field = f"{what}_scale"

    def changed(robot: Robot, strength: float, rng: Rng) -> Robot:
        return with_sensors(robot, **{field: getattr(robot.sensors, field) * factor(rng, 0.4 * strength)})

    def truth(before: Robot, after: Robot) -> Parameters:
        return {what: getattr(after.sensors, field) / getattr(before.sensors, field)}

    needs = _has_body_channel if what == "wheel" else has_velocity
    return RobotChange("sensor_scale", "", changed, truth, needs, what)


def _bias(robot: Robot, strength: float, rng: Rng) -> Robot:
    vx, vy, yaw = (0.3 * strength * rng.uniform(0.2, 1.0, 3) * rng.choice([-1.0, 1.0], 3)).tolist()
    sensors, top = robot.sensors, top_speed_m_s(robot)
    return with_sensors(
        robot,
        bias_vx_m_s=sensors.bias_vx_m_s + top * vx,
        bias_vy_m_s=sensors.bias_vy_m_s + top * vy,
        bias_yaw_rate_rad_s=sensors.bias_yaw_rate_rad_s + _top_yaw_rate_rad_s(robot) * yaw,
    )


def _bias_truth(before: Robot, after: Robot) -> Parameters:
    old, new = before.sensors, after.sensors
    return {
        "vx_m_s": new.bias_vx_m_s - old.bias_vx_m_s,
        "vy_m_s": new.bias_vy_m_s - old.bias_vy_m_s,
        "yaw_rate_rad_s": new.bias_yaw_rate_rad_s - old.bias_yaw_rate_rad_s,
    }


def _drift(robot: Robot, strength: float, rng: Rng) -> Robot:
    rate = 0.5 * strength * sign(rng) * _top_yaw_rate_rad_s(robot) / RUN_S
    return with_sensors(robot, drift_yaw_rate_rad_s2=robot.sensors.drift_yaw_rate_rad_s2 + rate)


def _drift_truth(before: Robot, after: Robot) -> Parameters:
    return {"per_s": after.sensors.drift_yaw_rate_rad_s2 - before.sensors.drift_yaw_rate_rad_s2}


SENSOR_CHANGES = (
    RobotChange("mount_yaw", "", _turned, _turned_truth, _has_body_channel),
    _late("wheels_late_s", "late_s", "pose_late_s"),
    _late("wheels_late_s"),
    _late("late_s"),
    _late("pose_late_s"),
    RobotChange("sensor_lowpass", "lag", _lag, _lag_truth, has_velocity),
    RobotChange("sensor_lowpass", "window", _window, _window_truth, has_velocity),
    _scaled("wheel"),
    _scaled("linear"),
    _scaled("yaw"),
    RobotChange("sensor_bias", "constant", _bias, _bias_truth, has_velocity),
    RobotChange("sensor_bias", "drift", _drift, _drift_truth, has_velocity),
)
"""Of the sensors of the wheels, the body's velocity and its pose."""
