"""Changes of the wheel's load, of the gear and of the sensor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import (
    RAD_S_PER_RPM,
    Change,
    Parameters,
    always,
    inertia,
    integrates,
    sign,
    spare_torque,
    stiffness,
    with_gear,
    with_sensor,
)
from sysid.studies.zoo.drives.drive import Drive

Rng = np.random.Generator


# --- friction ---


def _coulomb(drive: Drive, strength: float, _rng: Rng) -> Drive:
    torque = 0.9 * spare_torque(drive) * strength
    return with_gear(drive, wheel_coulomb_n_m=drive.gear.wheel_coulomb_n_m + torque)


def _sticking(drive: Drive, strength: float, rng: Rng) -> Drive:
    speed = drive.top_rpm * RAD_S_PER_RPM * rng.uniform(0.02, 0.15)
    torque = 0.9 * spare_torque(drive) * strength
    return with_gear(
        drive,
        wheel_sticking_n_m=drive.gear.wheel_sticking_n_m + torque,
        sticking_rad_s=speed if drive.gear.wheel_sticking_n_m == 0.0 else drive.gear.sticking_rad_s,
    )


def _viscous(drive: Drive, strength: float, _rng: Rng) -> Drive:
    damping = 1.8 * spare_torque(drive) / (drive.top_rpm * RAD_S_PER_RPM) * strength
    return with_gear(drive, wheel_viscous_n_m_s=drive.gear.wheel_viscous_n_m_s + damping)


def _droop(drive: Drive, torque_n_m: float) -> Parameters:
    """Speed that a lasting torque takes from a drive without integral action."""
    return {} if integrates(drive) else {"droop_rpm": torque_n_m / stiffness(drive) / RAD_S_PER_RPM}


def _coulomb_truth(before: Drive, after: Drive) -> Parameters:
    torque = after.gear.wheel_coulomb_n_m - before.gear.wheel_coulomb_n_m
    return {"torque_n_m": torque} | _droop(before, torque)


def _sticking_truth(before: Drive, after: Drive) -> Parameters:
    torque = after.gear.wheel_sticking_n_m - before.gear.wheel_sticking_n_m
    found = {"breakaway_n_m": torque, "stribeck_rpm": after.gear.sticking_rad_s / RAD_S_PER_RPM}
    return found | _droop(before, torque)


def _viscous_truth(before: Drive, after: Drive) -> Parameters:
    damping = after.gear.wheel_viscous_n_m_s - before.gear.wheel_viscous_n_m_s
    return {"damping_n_m_s_rad": damping}


def _droops(drive: Drive) -> bool:
    return not integrates(drive)


def _frictions() -> tuple[Change, ...]:
    """Return the three frictions in both forms, which follow from the drive's integral action."""
    forms: dict[str, Callable[[Drive], bool]] = {"droop": _droops, "washed_out": integrates}
    return tuple(
        Change(name, form, possible, changed, truth)
        for name, changed, truth in (
            ("coulomb_friction", _coulomb, _coulomb_truth),
            ("stiction", _sticking, _sticking_truth),
            ("viscous_friction", _viscous, _viscous_truth),
        )
        for form, possible in forms.items()
    )


# --- inertia, ripple, play ---


def _heavier(drive: Drive, strength: float, _rng: Rng) -> Drive:
    more = 20.0 * inertia(drive) * strength
    return with_gear(drive, wheel_inertia_kg_m2=drive.gear.wheel_inertia_kg_m2 + more)


def _even_load(drive: Drive) -> bool:
    return drive.gear.cogging_n_m == 0.0


def _cogging(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_gear(
        drive,
        cogging_n_m=0.7 * spare_torque(drive) * strength,
        cogging_per_turn=int(rng.choice((1, 2, 3, 5, 7, 12, 18, 24))),
        cogging_phase_deg=float(rng.uniform(-180.0, 180.0)),
    )


def _seen_play(drive: Drive) -> bool:
    """Return whether the log's sensor is on the wheel, which alone sees what the forms of play describe."""
    return drive.sensor.side == "wheel" and drive.gear.play_spring_n_m_rad == 0.0


def _wheel_stops_s(drive: Drive) -> float:
    """Return the time in which the wheel's own friction stops it from a fifth of the top speed [s]."""
    gear, speed = drive.gear, 0.2 * drive.top_rpm * RAD_S_PER_RPM
    friction = gear.wheel_coulomb_n_m + 0.5 * gear.wheel_viscous_n_m_s * speed
    return gear.wheel_inertia_kg_m2 * speed / max(friction, 1e-12)


_RESTS_S: Final = 0.15
"""A wheel that its friction stops faster than this rests in the gap, because reversing takes as long."""


def _rests(drive: Drive) -> bool:
    return _seen_play(drive) and _wheel_stops_s(drive) < _RESTS_S


def _coasts(drive: Drive) -> bool:
    return _seen_play(drive) and _wheel_stops_s(drive) >= _RESTS_S


def _play(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_gear(drive, play_deg=drive.gear.play_deg + 30.0 * strength)


def _tight(drive: Drive) -> bool:
    return _seen_play(drive) and drive.gear.play_deg == 0.0


def _elastic_play(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Give the gap an elastic filling, on which the wheel alone would swing at some hertz."""
    gear, play_deg = drive.gear, 30.0 * strength
    swing_hz = rng.uniform(2.0, 8.0)
    spring = gear.wheel_inertia_kg_m2 * (2.0 * np.pi * swing_hz) ** 2
    return with_gear(drive, play_deg=play_deg, play_spring_n_m_rad=float(spring))


def _gap(_before: Drive, after: Drive) -> Parameters:
    return {"gap_deg": after.gear.play_deg}


# --- the sensor ---


def _late(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_sensor(drive, late_s=drive.sensor.late_s + 0.4 * strength)


def _unfiltered(drive: Drive) -> bool:
    return drive.sensor.filter_s == 0.0


def _lag(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_sensor(drive, filter_s=0.5 * strength)


def _window(drive: Drive, strength: float, _rng: Rng) -> Drive:
    """Widen the window; an encoder without one counts from sample to sample."""
    sensor = drive.sensor
    present = sensor.window_s or (sensor.sample_s if sensor.counts else 0.0)
    return with_sensor(drive, window_s=present + 0.5 * strength)


def _scale(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_sensor(drive, scale=drive.sensor.scale * (1.0 + 0.4 * strength * sign(rng)))


def _centred(drive: Drive) -> bool:
    return drive.sensor.eccentricity == 0.0


def _eccentric(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_sensor(
        drive,
        eccentricity=0.4 * strength,
        eccentricity_per_turn=int(rng.choice((1, 1, 2))),
        eccentricity_phase_deg=float(rng.uniform(-180.0, 180.0)),
    )


LOAD_CHANGES: Final = (
    *_frictions(),
    Change(
        "load_inertia",
        "",
        always,
        _heavier,
        lambda before, after: {"ratio": inertia(after) / inertia(before)},
    ),
    Change(
        "torque_ripple",
        "load",
        _even_load,
        _cogging,
        lambda _, after: {
            "per_turn": float(after.gear.cogging_per_turn),
            "torque_n_m": after.gear.cogging_n_m,
        },
    ),
    Change("backlash", "rest", _rests, _play, _gap),
    Change("backlash", "coast", _coasts, _play, _gap),
    Change("backlash", "spring", _tight, _elastic_play, _gap),
)

SENSOR_CHANGES: Final = (
    Change(
        "encoder_eccentricity",
        "sensor",
        _centred,
        _eccentric,
        lambda _, after: {
            "per_turn": float(after.sensor.eccentricity_per_turn),
            "share": after.sensor.eccentricity,
        },
    ),
    Change(
        "sensor_latency",
        "all",
        always,
        _late,
        lambda before, after: {"delay_s": after.sensor.late_s - before.sensor.late_s},
    ),
    Change(
        "sensor_lowpass",
        "lag",
        _unfiltered,
        _lag,
        lambda _, after: {"time_constant_s": after.sensor.filter_s},
    ),
    Change("sensor_lowpass", "window", always, _window, lambda _, after: {"window_s": after.sensor.window_s}),
    Change(
        "sensor_scale",
        "",
        always,
        _scale,
        lambda before, after: {"wheel": after.sensor.scale / before.sensor.scale},
    ),
)
