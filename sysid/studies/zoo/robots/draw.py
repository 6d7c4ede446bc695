"""Robots drawn at random: a chassis of some size, drives that can carry it, and sensors that log it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from sysid.studies.zoo.drives.draw import family_of
from sysid.studies.zoo.drives.drive import Drive, Family
from sysid.studies.zoo.drives.plant import (
    Plant,
    draw_battery,
    draw_link,
    draw_plant,
    draw_sensor,
    log_uniform,
    sometimes,
)
from sysid.studies.zoo.drives.tuning import draw_controller
from sysid.studies.zoo.robots.body import GRAVITY_M_S2
from sysid.studies.zoo.robots.robot import (
    Body,
    BodyCommandPath,
    BodySensors,
    Floor,
    Four,
    Robot,
    Rollers,
    Wheels,
)
from sysid.studies.zoo.robots.trial import try_out

_FEWEST_ROLLERS: Final = 4  # that a model may have
_ATTEMPTS: Final = 400
_STREAM: Final = 10_000
"""First of the random streams of robots; the drives' streams of the same seed are below."""
_RAD_S: Final = 2.0 * math.pi / 60.0
_SPEEDS_M_S: Final = (0.2, 2.5)
"""Slowest and fastest surface of a wheel at its top speed."""
_LOADS: Final = (0.8, 12.0)
"""Least and most inertia that the robot's mass adds to a wheel and its motor, as a share of theirs."""


def draw_robot(seed: int, family: Family | None = None) -> Robot:
    """Return the robot of a seed: always the same, and useful (`trial.Trial.useful`).

    `family` is the topology of its drives; without it the seed draws one.

    Raises:
        RuntimeError: no useful robot was found, which no seed is known to do.
    """
    return draw_with_attempts(seed, family)[0]


def draw_with_attempts(seed: int, family: Family | None = None) -> tuple[Robot, int]:
    """Return the robot of a seed and a `family`, and how many were drawn until one was useful."""
    family = family or family_of(seed)
    for attempt in range(_ATTEMPTS):
        robot = _candidate(np.random.default_rng((seed, _STREAM + attempt)), family)
        if robot is not None and try_out(robot).useful:
            return robot, attempt + 1
    raise RuntimeError(f"no useful robot of family {family} in {_ATTEMPTS} attempts with seed {seed}")


def known(robot: Robot, rng: np.random.Generator) -> dict[str, float]:
    """Return what a ruler and a scale say of a robot: keys of a model's `robot`, with errors.

    A model has four rollers on a wheel or more, so the user of a robot with three leaves their number out.
    """

    def measured(true: float, error: float) -> float:
        return true * (1.0 + error * float(rng.standard_normal()))

    body = robot.body
    rollers = {"rollers_per_wheel": robot.wheels.rollers} if robot.wheels.rollers >= _FEWEST_ROLLERS else {}
    return {
        "wheel_radius_m": measured(robot.wheels.radius_m, 0.003),
        "half_wheelbase_m": measured(body.half_wheelbase_m, 0.005),
        "half_track_m": measured(body.half_track_m, 0.005),
        "mass_kg": measured(body.mass_kg, 0.01),
        **rollers,
    }


def _candidate(rng: np.random.Generator, family: Family) -> Robot | None:
    """Draw a robot that may be of no use; None if its motors do not suit its size."""
    wheels = _draw_wheels(rng)
    body = _draw_body(rng, wheels.radius_m)
    drive = _draw_drive(rng, family, wheels.radius_m, body.mass_kg)
    if drive is None:
        return None
    carried_n = body.mass_kg * GRAVITY_M_S2 / 4.0
    top_m_s = drive.top_rpm * _RAD_S * wheels.radius_m
    return Robot(
        wheels=wheels,
        rollers=Rollers(
            coulomb_n=carried_n * log_uniform(rng, 0.004, 0.05),
            viscous_n_s_m=carried_n * log_uniform(rng, 0.004, 0.05) / top_m_s,
        ),
        body=body,
        floor=Floor(
            grip=rng.uniform(0.5, 1.0),
            creep_m_s=log_uniform(rng, 0.003, 0.03),
            rolling_n=carried_n * log_uniform(rng, 0.003, 0.03),
        ),
        drive=drive,
        path=_draw_path(rng, drive.top_rpm),
        sensors=_draw_sensors(rng, top_m_s, body),
    )


def _draw_wheels(rng: np.random.Generator) -> Wheels:
    radius, rollers = log_uniform(rng, 0.03, 0.1), int(rng.integers(3, 13))
    # A roller spans its part of the rim at 45 degrees, so few rollers make a wide wheel, within reason.
    width = min(max(2.0 * math.pi / rollers * rng.uniform(0.9, 1.2), 0.5), 1.2) * radius
    return Wheels(
        radius_m=radius,
        radius_scale=_four(1.0 + 0.002 * rng.standard_normal(4)),
        width_m=width,
        rollers=rollers,
        handover=rng.uniform(0.05, 0.3),
        toe_deg=_four(0.3 * rng.standard_normal(4)),
    )


def _four(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Four:
    fl, fr, rl, rr = values.tolist()
    return (fl, fr, rl, rr)


def _draw_body(rng: np.random.Generator, radius_m: float) -> Body:
    half_track = radius_m * log_uniform(rng, 1.6, 4.0)
    half_wheelbase = half_track * log_uniform(rng, 0.7, 1.6)
    # Wheels are sold by the load they carry, which grows a little faster than their area.
    mass = min(max(80.0 * (radius_m / 0.1) ** 2.5 * log_uniform(rng, 0.2, 1.0), 1.0), 80.0)
    return Body(
        half_wheelbase_m=half_wheelbase,
        half_track_m=half_track,
        mass_kg=mass,
        yaw_inertia_kg_m2=mass * (half_wheelbase**2 + half_track**2) / 3.0 * rng.uniform(0.7, 1.6),
        com_x_m=0.06 * half_wheelbase * rng.standard_normal(),
        com_y_m=0.04 * half_track * rng.standard_normal(),
        com_height_m=radius_m * rng.uniform(0.8, 2.0),
        payload_height_m=radius_m * rng.uniform(2.0, 4.0),
        twist=0.05 * rng.standard_normal(),
    )


def _draw_drive(rng: np.random.Generator, family: Family, radius_m: float, mass_kg: float) -> Drive | None:
    """Draw a drive that is scaled to a robot and tuned to carry it; None if its speed does not suit it."""
    plant = draw_plant(rng)
    top_m_s = plant.top_rpm * _RAD_S * radius_m
    stall_n_m = plant.motor.back_emf_v_s * plant.motor.supply_v / plant.motor.resistance_ohm
    # Four motors together push with this share of the robot's weight.
    push = log_uniform(rng, 0.2, 1.2)
    plant = scaled(plant, push * mass_kg * GRAVITY_M_S2 * radius_m / 4.0 / stall_n_m)
    carried = mass_kg * radius_m**2 / 4.0
    load = carried / (plant.motor.inertia_kg_m2 + plant.gear.wheel_inertia_kg_m2)
    if not (_SPEEDS_M_S[0] <= top_m_s <= _SPEEDS_M_S[1] and _LOADS[0] <= load <= _LOADS[1]):
        return None
    # Tuned on the floor, or between floor and stand.
    felt = plant.gear.wheel_inertia_kg_m2 + rng.uniform(0.4, 1.0) * carried
    loaded = replace(plant, gear=replace(plant.gear, wheel_inertia_kg_m2=felt))
    controller = draw_controller(rng, family, loaded)
    return Drive(
        motor=plant.motor,
        gear=plant.gear,
        controller=controller,
        sensor=draw_sensor(rng, plant.top_rpm, controller.encoder_counts),
        link=draw_link(rng),
        battery=draw_battery(rng, plant.motor.supply_v),
        top_rpm=plant.top_rpm,
    )


def scaled(plant: Plant, factor: float) -> Plant:
    """Return a plant with all torques, currents and inertias times a factor; it moves as before."""
    motor, gear = plant.motor, plant.gear
    return replace(
        plant,
        motor=replace(
            motor,
            resistance_ohm=motor.resistance_ohm / factor,
            inductance_h=motor.inductance_h / factor,
            inertia_kg_m2=motor.inertia_kg_m2 * factor,
            current_limit_a=motor.current_limit_a * factor,
            brake_current_a=motor.brake_current_a * factor,
            supply_resistance_ohm=motor.supply_resistance_ohm / factor,
        ),
        gear=replace(
            gear,
            wheel_inertia_kg_m2=gear.wheel_inertia_kg_m2 * factor,
            motor_coulomb_n_m=gear.motor_coulomb_n_m * factor,
            motor_viscous_n_m_s=gear.motor_viscous_n_m_s * factor,
            wheel_coulomb_n_m=gear.wheel_coulomb_n_m * factor,
            wheel_viscous_n_m_s=gear.wheel_viscous_n_m_s * factor,
            wheel_sticking_n_m=gear.wheel_sticking_n_m * factor,
            play_spring_n_m_rad=gear.play_spring_n_m_rad * factor,
            cogging_n_m=gear.cogging_n_m * factor,
        ),
    )


def _draw_path(rng: np.random.Generator, top_rpm: float) -> BodyCommandPath:
    """Draw the platform's own ramps, which few platforms have."""
    if rng.random() < 0.75:
        return BodyCommandPath()
    return BodyCommandPath(
        v_ramp_rpm_s=top_rpm / log_uniform(rng, 0.2, 1.5), vc_ramp_rpm_s=top_rpm / log_uniform(rng, 0.2, 1.5)
    )


def _draw_sensors(rng: np.random.Generator, top_m_s: float, body: Body) -> BodySensors:
    """Draw odometry or motion capture, or both, calibrated as well as one does."""
    velocity, pose = bool(rng.random() < 0.85), bool(rng.random() < 0.5)
    reach = math.hypot(body.half_wheelbase_m, body.half_track_m)
    return BodySensors(
        velocity=velocity or not pose,
        pose=pose,
        noise_m_s=top_m_s * log_uniform(rng, 0.002, 0.02),
        noise_rad_s=top_m_s / reach * log_uniform(rng, 0.002, 0.02),
        noise_m=log_uniform(rng, 0.0003, 0.004),
        noise_rad=log_uniform(rng, 0.0005, 0.005),
        turned_deg=0.3 * rng.standard_normal(),
        lever_x_m=0.02 * reach * rng.standard_normal(),
        lever_y_m=0.02 * reach * rng.standard_normal(),
        late_s=sometimes(rng, 0.5, 0.001, 0.03),
        pose_late_s=sometimes(rng, 0.5, 0.003, 0.03),
        filter_s=sometimes(rng, 0.4, 0.002, 0.05),
        window_s=sometimes(rng, 0.2, 0.01, 0.05),
        linear_scale=1.0 + 0.003 * rng.standard_normal(),
        yaw_scale=1.0 + 0.003 * rng.standard_normal(),
        bias_yaw_rate_rad_s=0.001 * rng.standard_normal(),
        drop_outs=sometimes(rng, 0.4, 0.005, 0.1),
        drop_out_s=log_uniform(rng, 0.05, 0.4),
    )
