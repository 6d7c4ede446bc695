"""Changes of what limits a drive and of what time does to it: ceilings, ramps, currents, battery, warmth."""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import (
    RAD_S_PER_RPM,
    Change,
    Parameters,
    always,
    friction_torque,
    inertia,
    open_duty,
    spare_torque,
    with_controller,
    with_gear,
    with_motor,
)
from sysid.studies.zoo.drives.drive import Drive

Rng = np.random.Generator


# --- limits ---


def _free_ceiling(drive: Drive) -> bool:
    return math.isinf(drive.controller.ceiling_rpm)


def _clip(drive: Drive, strength: float, rng: Rng) -> Drive:
    soft = rng.uniform(0.05, 0.3) if rng.random() < 0.5 else 0.0
    ceiling = drive.top_rpm * (1.0 - 0.7 * strength)
    return with_controller(drive, ceiling_rpm=ceiling, ceiling_softness_rpm=soft * drive.top_rpm * strength)


def _tired_supply(drive: Drive, strength: float, _rng: Rng) -> Drive:
    """Lower the supply, which the firmware knows, to where it carries a third of the top speed."""
    motor, top = drive.motor, drive.top_rpm * RAD_S_PER_RPM
    volts = motor.back_emf_v_s * top
    volts += motor.resistance_ohm * friction_torque(drive, top) / motor.back_emf_v_s
    return with_motor(drive, supply_v=motor.supply_v - max(motor.supply_v - 0.3 * volts, 0.0) * strength)


def _supply_ceiling(_before: Drive, after: Drive) -> Parameters:
    """Return the speed without load at which the back-EMF and the friction's current use up the supply."""
    motor = after.motor
    k, ohm, gear = motor.back_emf_v_s, motor.resistance_ohm, after.gear
    coulomb = gear.motor_coulomb_n_m + gear.wheel_coulomb_n_m
    viscous = gear.motor_viscous_n_m_s + gear.wheel_viscous_n_m_s
    return {"limit_rpm": (motor.supply_v - ohm * coulomb / k) / (k + ohm * viscous / k) / RAD_S_PER_RPM}


_SLOWEST_S: Final = 2.0
"""From rest to the top speed at the gross acceleration limit."""


def _no_ramp(drive: Drive) -> bool:
    return math.isinf(drive.controller.ramp_rpm_s) and math.isinf(drive.controller.jerk_rpm_s2)


def _own_brake(rng: Rng) -> float:
    """Return the ratio of the braking limit to the accelerating one; 1 in two of three draws."""
    ratio = float(rng.choice((rng.uniform(0.3, 0.7), rng.uniform(1.5, 3.0))))
    return ratio if rng.random() < 1.0 / 3.0 else 1.0


def _ramp(drive: Drive, strength: float, rng: Rng) -> Drive:
    brake, ramp = _own_brake(rng), drive.top_rpm / (_SLOWEST_S * strength)
    return with_controller(drive, ramp_rpm_s=ramp, brake_rpm_s=0.0 if brake == 1.0 else brake * ramp)


def _s_curve(drive: Drive, strength: float, rng: Rng) -> Drive:
    seconds = _SLOWEST_S * strength
    ramp = drive.top_rpm / seconds
    jerk = ramp / (rng.uniform(0.2, 0.8) * seconds)
    brake = _own_brake(rng)
    return with_controller(
        drive, ramp_rpm_s=ramp, brake_rpm_s=0.0 if brake == 1.0 else brake * ramp, jerk_rpm_s2=jerk
    )


def _set_point_ramp(_before: Drive, after: Drive) -> Parameters:
    controller = after.controller
    found = {"limit_rpm_s": controller.ramp_rpm_s}
    if controller.brake_rpm_s > 0.0:
        found["brake_rpm_s"] = controller.brake_rpm_s
    if math.isfinite(controller.jerk_rpm_s2):
        found["jerk_rpm_s2"] = controller.jerk_rpm_s2
    return found


def _current(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Lower the current limit: what friction takes at the top speed, and the rest accelerates."""
    motor, top = drive.motor, drive.top_rpm * RAD_S_PER_RPM
    brake = _own_brake(rng)
    hold = 1.1 * friction_torque(drive, top) / motor.back_emf_v_s
    push = inertia(drive) * top / (_SLOWEST_S * strength) / motor.back_emf_v_s
    return with_motor(
        drive,
        current_limit_a=min(motor.current_limit_a, hold + push),
        brake_current_a=min(motor.brake_current_a, math.inf if brake == 1.0 else brake * push),
    )


def _torque_ramp(_before: Drive, after: Drive) -> Parameters:
    """Return the acceleration by the limited current at half of the top speed, with friction."""
    motor, rpm_s = after.motor, 1.0 / (inertia(after) * RAD_S_PER_RPM)
    loss = friction_torque(after, 0.5 * after.top_rpm * RAD_S_PER_RPM)
    brake_a = min(motor.brake_current_a, motor.current_limit_a)
    return {
        "limit_rpm_s": (motor.back_emf_v_s * motor.current_limit_a - loss) * rpm_s,
        "brake_rpm_s": (motor.back_emf_v_s * brake_a + loss) * rpm_s,
    }


# --- battery and temperature ---


_GROSS_FALL_PER_S: Final = 0.3
"""Share that is lost per second; more than half of the speed within a short run."""


def _falls(drive: Drive, strength: float, _rng: Rng) -> Drive:
    """Let the supply of an open-duty drive fall, or the analogue reference of any other."""
    if open_duty(drive) and not drive.controller.supply_compensation:
        return with_motor(
            drive, supply_fall_per_s=drive.motor.supply_fall_per_s + _GROSS_FALL_PER_S * strength
        )
    return with_controller(
        drive, gain_fall_per_s=drive.controller.gain_fall_per_s + _GROSS_FALL_PER_S * strength
    )


def _fall_per_s(before: Drive, after: Drive) -> Parameters:
    supply = after.motor.supply_fall_per_s - before.motor.supply_fall_per_s
    return {"drop_per_s": supply + after.controller.gain_fall_per_s - before.controller.gain_fall_per_s}


def _logs_battery(drive: Drive) -> bool:
    return drive.battery.logged


def _runs_down(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Let the logged battery fall, and with it the analogue reference of a drive that is not at open duty."""
    battery, share = drive.battery, float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    fall = battery.fall_v_per_s + _GROSS_FALL_PER_S * strength * battery.full_v
    drive = dataclasses.replace(drive, battery=dataclasses.replace(battery, fall_v_per_s=fall))
    if open_duty(drive) and not drive.controller.supply_compensation:
        return drive
    return with_controller(drive, gain_per_volt=drive.controller.gain_per_volt + share / battery.full_v)


def _share_per_volt(before: Drive, after: Drive) -> Parameters:
    """Return what a volt costs: of a motor at open duty, the supply's share; else that of the reference."""
    reference = after.controller.gain_per_volt - before.controller.gain_per_volt
    return {"per_volt": reference if reference > 0.0 else 1.0 / after.battery.full_v}


def _warms(drive: Drive, strength: float, rng: Rng) -> Drive:
    seconds = float(np.exp(rng.uniform(np.log(0.4), np.log(10.0))))
    return with_controller(drive, gain_warming=0.5 * strength, gain_warming_s=seconds)


def _cold_gain(drive: Drive) -> bool:
    return drive.controller.gain_warming == 0.0


def _eases(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Start with a cold gear, whose friction takes up to the spare torque and falls to what it was."""
    gear, half = drive.gear, 0.5 * drive.top_rpm * RAD_S_PER_RPM
    more = 1.0 + 0.9 * spare_torque(drive) / friction_torque(drive, half) * strength
    seconds = float(np.exp(rng.uniform(np.log(0.4), np.log(10.0))))
    return with_gear(
        drive,
        motor_coulomb_n_m=more * gear.motor_coulomb_n_m,
        motor_viscous_n_m_s=more * gear.motor_viscous_n_m_s,
        wheel_coulomb_n_m=more * gear.wheel_coulomb_n_m,
        wheel_viscous_n_m_s=more * gear.wheel_viscous_n_m_s,
        wheel_sticking_n_m=more * gear.wheel_sticking_n_m,
        friction_warming=1.0 - 1.0 / more,
        friction_warming_s=seconds,
    )


def _cold_friction(drive: Drive) -> bool:
    top = drive.top_rpm * RAD_S_PER_RPM
    return drive.gear.friction_warming == 0.0 and friction_torque(drive, top) > 0.0


def _more_when_cold(before: Drive, after: Drive) -> Parameters:
    """Return what the cold gear adds to its frictions."""
    at_rest, at_1_rad_s = (friction_torque(after, w) - friction_torque(before, w) for w in (0.0, 1.0))
    sticking = after.gear.wheel_sticking_n_m - before.gear.wheel_sticking_n_m
    return {
        "torque_n_m": at_rest + sticking,
        "damping_n_m_s_rad": at_1_rad_s - at_rest,
        "time_constant_s": after.gear.friction_warming_s,
    }


LIMIT_CHANGES: Final = (
    Change(
        "speed_saturation",
        "clip",
        _free_ceiling,
        _clip,
        lambda _, after: {
            "limit_rpm": after.controller.ceiling_rpm,
            "softness_rpm": after.controller.ceiling_softness_rpm,
        },
    ),
    Change("speed_saturation", "supply", lambda drive: not open_duty(drive), _tired_supply, _supply_ceiling),
    Change("acceleration_limit", "set_point", _no_ramp, _ramp, _set_point_ramp),
    Change("acceleration_limit", "drive", always, _current, _torque_ramp),
    Change("acceleration_limit", "s_curve", _no_ramp, _s_curve, _set_point_ramp),
    Change("battery_sag", "time", always, _falls, _fall_per_s),
    Change("battery_sag", "voltage", _logs_battery, _runs_down, _share_per_volt),
    Change(
        "warm_up",
        "gain",
        _cold_gain,
        _warms,
        lambda _, after: {
            "share": after.controller.gain_warming,
            "time_constant_s": after.controller.gain_warming_s,
        },
    ),
    Change(
        "warm_up",
        "cold_friction",
        _cold_friction,
        _eases,
        _more_when_cold,
    ),
)
