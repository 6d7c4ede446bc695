"""Changes of a robot's body, wheels, rollers and floor, and of the computer that commands it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sysid.studies.zoo.cases.bench.change import Parameters, integrates, sign, stiffness
from sysid.studies.zoo.cases.robot.change import (
    RobotChange,
    factor,
    wheel_load_n,
    with_body,
    with_controller,
)
from sysid.studies.zoo.cases.robot.plans import top_speed_m_s, usable_rpm
from sysid.studies.zoo.robots.robot import Robot

Rng = np.random.Generator
_WHEELS = ("fl", "fr", "rl", "rr")


def _payload(robot: Robot, strength: float, rng: Rng) -> Robot:
    mass, height = 2.0 * strength * robot.body.mass_kg, rng.uniform(0.1, 0.4)
    return with_body(robot, payload_kg=robot.body.payload_kg + mass, payload_height_m=height)


def _payload_truth(before: Robot, after: Robot) -> Parameters:
    mass = after.body.payload_kg - before.body.payload_kg
    return {"mass_kg": mass, "height_m": after.body.payload_height_m}


def _com_offset(robot: Robot, strength: float, rng: Rng) -> Robot:
    angle = rng.uniform(-math.pi, math.pi)
    body = robot.body
    x = 0.5 * strength * body.half_wheelbase_m * math.cos(angle)
    y = 0.5 * strength * body.half_track_m * math.sin(angle)
    return with_body(robot, com_x_m=body.com_x_m + x, com_y_m=body.com_y_m + y)


def _com_truth(before: Robot, after: Robot) -> Parameters:
    return {
        "x_m": after.body.com_x_m - before.body.com_x_m,
        "y_m": after.body.com_y_m - before.body.com_y_m,
    }


def _rollers_stick(robot: Robot, strength: float, _rng: Rng) -> Robot:
    force = robot.rollers.coulomb_n + 0.3 * strength * wheel_load_n(robot)
    return replace(robot, rollers=replace(robot.rollers, coulomb_n=force))


def _rollers_drag(robot: Robot, strength: float, _rng: Rng) -> Robot:
    damping = robot.rollers.viscous_n_s_m + 0.3 * strength * wheel_load_n(robot) / top_speed_m_s(robot)
    return replace(robot, rollers=replace(robot.rollers, viscous_n_s_m=damping))


def _low_grip(robot: Robot, strength: float, _rng: Rng) -> Robot:
    return replace(robot, floor=replace(robot.floor, grip=robot.floor.grip / (1.0 + 29.0 * strength)))


def _floor_slope(robot: Robot, strength: float, rng: Rng) -> Robot:
    floor = replace(robot.floor, slope_deg=12.0 * strength, downhill_deg=rng.uniform(-180.0, 180.0))
    return replace(robot, floor=floor)


def _slope_truth(_before: Robot, after: Robot) -> Parameters:
    return {"slope_deg": after.floor.slope_deg, "heading_deg": after.floor.downhill_deg}


def _wheel_radius(robot: Robot, strength: float, rng: Rng) -> Robot:
    scale = factor(rng, 0.3 * strength)
    fl, fr, rl, rr = robot.wheels.radius_scale
    scales = (scale * fl, scale * fr, scale * rl, scale * rr)
    return replace(robot, wheels=replace(robot.wheels, radius_scale=scales))


def _radius_truth(before: Robot, after: Robot) -> Parameters:
    return {"scale": after.wheels.radius_scale[0] / before.wheels.radius_scale[0]}


def _track_width(robot: Robot, strength: float, rng: Rng) -> Robot:
    scale, body = factor(rng, 0.5 * strength), robot.body
    return with_body(
        robot, half_wheelbase_m=scale * body.half_wheelbase_m, half_track_m=scale * body.half_track_m
    )


def _track_truth(before: Robot, after: Robot) -> Parameters:
    return {"scale": after.body.half_track_m / before.body.half_track_m}


def _scaled_gains(robot: Robot, logs: np.ndarray) -> Robot:
    fl, fr, rl, rr = (np.asarray(robot.wheel_gains) * np.exp(logs)).tolist()
    return replace(robot, wheel_gains=(fl, fr, rl, rr))


def _one_wheel_gain(robot: Robot, strength: float, rng: Rng) -> Robot:
    logs = np.zeros(4)
    logs[rng.integers(4)] = sign(rng) * math.log1p(0.5 * strength)
    return _scaled_gains(robot, logs)


def _four_wheel_gains(robot: Robot, strength: float, rng: Rng) -> Robot:
    parts = rng.uniform(-1.0, 1.0, 4)
    # The part that is common to all wheels would be a `speed_gain`.
    parts -= parts.mean()
    return _scaled_gains(robot, parts / np.abs(parts).max() * math.log1p(0.5 * strength))


def _gains_truth(before: Robot, after: Robot) -> Parameters:
    ratios = np.divide(after.wheel_gains, before.wheel_gains).tolist()
    return {f"gain_{wheel}": ratio for wheel, ratio in zip(_WHEELS, ratios, strict=True)}


def _no_limit(robot: Robot) -> bool:
    return math.isinf(robot.path.v_limit_rpm) and math.isinf(robot.path.vc_limit_rpm)


def _no_ramp(robot: Robot) -> bool:
    return math.isinf(robot.path.v_ramp_rpm_s) and math.isinf(robot.path.vc_ramp_rpm_s)


def _speed_limit(robot: Robot, strength: float, rng: Rng) -> Robot:
    limit = usable_rpm(robot) * (1.0 - 0.9 * strength)
    v, vc = _either_or_both(rng, limit)
    return replace(robot, path=replace(robot.path, v_limit_rpm=v, vc_limit_rpm=vc))


def _speed_limit_truth(_before: Robot, after: Robot) -> Parameters:
    return _finite(v_rpm=after.path.v_limit_rpm, vc_rpm=after.path.vc_limit_rpm)


def _acceleration_limit(robot: Robot, strength: float, rng: Rng) -> Robot:
    v, vc = _either_or_both(rng, usable_rpm(robot) / (2.0 * strength))
    return replace(robot, path=replace(robot.path, v_ramp_rpm_s=v, vc_ramp_rpm_s=vc))


def _acceleration_truth(_before: Robot, after: Robot) -> Parameters:
    return _finite(v_rpm_s=after.path.v_ramp_rpm_s, vc_rpm_s=after.path.vc_ramp_rpm_s)


def _either_or_both(rng: Rng, limit: float) -> tuple[float, float]:
    """Return the limits of V and of VC: a platform limits one of them or both, seldom to the same number."""
    which, ratio = rng.integers(4), rng.uniform(0.6, 1.0)
    return (math.inf if which == 0 else limit), (math.inf if which == 1 else ratio * limit)


def _finite(**values: float) -> Parameters:
    return {name: value for name, value in values.items() if math.isfinite(value)}


def _soft_loop(robot: Robot, strength: float, _rng: Rng) -> Robot:
    """Lower the gains of the speed loop; the integral's by the square, which keeps the loop's damping."""
    controller, share = robot.drive.controller, 1.0 / (1.0 + 19.0 * strength)
    return with_controller(
        robot, kp=share * controller.kp, ki=share**2 * controller.ki, kd=share * controller.kd
    )


def _has_loop_to_soften(robot: Robot) -> bool:
    """Hold for a loop that reaches its set-point without load also with lower gains."""
    controller = robot.drive.controller
    return controller.kp > 0.0 and (controller.ki > 0.0 or controller.feed_forward > 0.0)


def _resistive(robot: Robot, strength: float, _rng: Rng) -> Robot:
    motor = robot.drive.motor
    softer = replace(motor, resistance_ohm=motor.resistance_ohm * (1.0 + 9.0 * strength))
    return replace(robot, drive=replace(robot.drive, motor=softer))


def _is_open_loop(robot: Robot) -> bool:
    controller = robot.drive.controller
    return controller.kp == 0.0 and controller.emf_compensation == 0.0


def _stiffness_truth(_before: Robot, after: Robot) -> Parameters:
    # An integral lets no loss of speed last, and has no stiffness of this kind.
    return {} if integrates(after.drive) else {"servo_n_m_s_rad": stiffness(after.drive)}


BODY_CHANGES = (
    RobotChange("payload", "", _payload, _payload_truth),
    RobotChange("com_offset", "", _com_offset, _com_truth),
    RobotChange("roller_friction", "", _rollers_stick, variant="torque"),
    RobotChange("roller_friction", "", _rollers_drag, variant="damping"),
    RobotChange("low_grip", "", _low_grip, lambda _, after: {"friction": after.floor.grip}),
    RobotChange("wheel_radius", "", _wheel_radius, _radius_truth),
    RobotChange("track_width", "", _track_width, _track_truth),
    RobotChange("floor_slope", "", _floor_slope, _slope_truth, lambda robot: robot.floor.slope_deg == 0.0),
    RobotChange("wheel_gain_mismatch", "", _one_wheel_gain, _gains_truth, variant="one"),
    RobotChange("wheel_gain_mismatch", "", _four_wheel_gains, _gains_truth, variant="four"),
    RobotChange("body_speed_limit", "", _speed_limit, _speed_limit_truth, _no_limit),
    RobotChange("body_acceleration_limit", "", _acceleration_limit, _acceleration_truth, _no_ramp),
    RobotChange("weak_servo", "", _soft_loop, _stiffness_truth, _has_loop_to_soften, "loop"),
    RobotChange("weak_servo", "", _resistive, _stiffness_truth, _is_open_loop, "winding"),
)
"""Of everything between the command and the motion that is the robot's and not its drives' alone."""
