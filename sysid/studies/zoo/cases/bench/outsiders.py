"""Changes that no name of the contract covers: some as close to a name as physics allows, others not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import (
    RAD_S_PER_RPM,
    always,
    friction_torque,
    inertia,
    integrates,
    open_duty,
    spare_torque,
    strength,
    with_controller,
    with_gear,
    with_motor,
    with_sensor,
)
from sysid.studies.zoo.drives.drive import Drive

Rng = np.random.Generator


@dataclass(frozen=True)
class Outsider:
    """A change without a name."""

    words: str
    """What was changed."""
    near: str
    """The name that it is closest to; empty: far from all."""
    possible: Callable[[Drive], bool]
    changed: Callable[[Drive, float, Rng], Drive]
    """(drive, strength, rng) -> changed drive; what is drawn does not depend on the strength."""

    def apply(self, drive: Drive, size: float, rng: Rng) -> Drive:
        """Return the drive at a size of this change from 0 (the drive itself) to 1 (gross).

        `rng` draws what the size does not say, such as a frequency.
        """
        return self.changed(drive, strength(size), rng) if size > 0.0 else drive


def _seconds(low: float, high: float, rng: Rng) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


# --- near ---


def _hysteresis(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_controller(drive, gain_hysteresis=0.4 * strength)


def _seizing(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Let friction grow until the spare torque is nearly used up."""
    half = 0.5 * drive.top_rpm * RAD_S_PER_RPM
    growth = 0.9 * spare_torque(drive) / friction_torque(drive, half)
    return with_gear(drive, friction_warming=-growth * strength, friction_warming_s=_seconds(0.5, 4.0, rng))


def _has_friction(drive: Drive) -> bool:
    return friction_torque(drive, 0.0) > 0.0 and drive.gear.friction_warming == 0.0


def _regulated(drive: Drive) -> bool:
    return drive.controller.kp > 0.0 or drive.controller.ki > 0.0


def _detuned(drive: Drive, strength: float, _rng: Rng) -> Drive:
    share = 1.0 - 0.98 * strength
    control = drive.controller
    return with_controller(drive, kp=control.kp * share, ki=control.ki * share, kd=control.kd * share)


def _limits_current(drive: Drive) -> bool:
    return math.isfinite(drive.motor.current_limit_a)


def _derated(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Let the current limit fall to what friction alone takes at the top speed."""
    motor, top = drive.motor, drive.top_rpm * RAD_S_PER_RPM
    needed = friction_torque(drive, top) / motor.back_emf_v_s / motor.current_limit_a
    fade = max(1.0 - needed, 0.2) * strength
    return with_motor(drive, current_fade=fade, current_fade_s=_seconds(0.3, 3.0, rng))


def _rigid(drive: Drive) -> bool:
    return drive.gear.play_deg == 0.0 and drive.sensor.side == "wheel"


def _coupling(drive: Drive, strength: float, _rng: Rng) -> Drive:
    """Put a shaft between motor and wheel that swings at 1.5 Hz where gross, and faster where stiffer."""
    gear, motor = drive.gear, drive.motor
    reduced = 1.0 / (1.0 / gear.wheel_inertia_kg_m2 + 1.0 / motor.inertia_kg_m2)
    spring = reduced * (2.0 * math.pi * 1.5) ** 2 / strength
    return with_gear(drive, play_deg=3600.0, play_spring_n_m_rad=spring)


def _feels_winding(drive: Drive) -> bool:
    return not integrates(drive) and drive.controller.current_kp == 0.0


def _winding(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_motor(drive, winding_warming=4.0 * strength, warming_s=_seconds(0.5, 5.0, rng))


def _held(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_sensor(drive, held_share=0.95 * strength)


def _air(drive: Drive, strength: float, _rng: Rng) -> Drive:
    half = 0.5 * drive.top_rpm * RAD_S_PER_RPM
    return with_gear(drive, drag_n_m_s2=0.9 * spare_torque(drive) / half**2 * strength)


def _fine_commands(drive: Drive) -> bool:
    return drive.controller.quantum_rpm < 0.05 * drive.top_rpm


def _coarse_commands(drive: Drive, strength: float, _rng: Rng) -> Drive:
    present = drive.controller.quantum_rpm
    return with_controller(drive, quantum_rpm=present + 0.5 * drive.top_rpm * strength)


NEAR_OUTSIDERS: Final = (
    Outsider("gain hysteresis", "direction_asymmetry", always, _hysteresis),
    Outsider("friction that rises with time", "warm_up", _has_friction, _seizing),
    Outsider("slower speed loop", "load_inertia", _regulated, _detuned),
    Outsider("thermal current derating", "acceleration_limit", _limits_current, _derated),
    Outsider("flexible coupling", "backlash", _rigid, _coupling),
    Outsider("warming winding", "battery_sag", _feels_winding, _winding),
    Outsider("held samples", "sensor_latency", always, _held),
    Outsider("air drag", "viscous_friction", always, _air),
    Outsider("coarse command steps", "static_map", _fine_commands, _coarse_commands),
)


# --- far ---


def _glitches(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_sensor(drive, outlier_share=drive.sensor.outlier_share + 0.3 * strength)


def _freezes(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_controller(drive, freeze_share=0.6 * strength, freeze_s=_seconds(0.1, 0.4, rng))


def _swings(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Let the supply of an open-duty drive swing, or the reference of any other."""
    hz = _seconds(0.7, 4.0, rng)
    if open_duty(drive) and not drive.controller.supply_compensation:
        return with_motor(drive, supply_swing=0.5 * strength, supply_swing_hz=hz)
    return with_controller(drive, gain_swing=0.5 * strength, gain_swing_hz=hz)


def _rubs(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Let something brake the wheel for the first fifth of every period."""
    torque = max(spare_torque(drive), inertia(drive) * drive.top_rpm * RAD_S_PER_RPM)
    return with_gear(drive, rub_n_m=0.9 * torque * strength, rub_hz=_seconds(0.7, 3.0, rng))


def _loose_cable(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_sensor(drive, blank_share=0.5 * strength, blank_s=_seconds(0.02, 0.2, rng))


FAR_OUTSIDERS: Final = (
    Outsider("glitches of the sensor", "", always, _glitches),
    Outsider("controller freezes", "", _regulated, _freezes),
    Outsider("swinging supply", "", always, _swings),
    Outsider("rubbing now and then", "", always, _rubs),
    Outsider("loose sensor cable", "", always, _loose_cable),
)
