"""The servo of a wheel behind its setpoint, and what loads it, for many sets of parameters and runs at once.

    torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]

This is the second half of the reference for the plugin that `mecanum_env.law.chain` begins; chain.h and
chain.c tell what each step is, and why. Arrays have the shape (sets, runs), parameters (sets, 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.chain import DriveState
from mecanum_env.law.custom_load import custom_torque
from mecanum_env.law.parameters import Sets
from mecanum_env.law.wheel_load import GAP_KINDS
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

LOAD_SMOOTHING: Final = 0.1
"""Share of a change of the load that its estimate follows in a substep."""
_TINY: Final = 1e-15  # least inertia of a wheel [kg m^2]
_UNLIMITED: Final = 1e10  # torque limit that means none [N m]


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques on wheels [N m], each of shape (sets, runs)."""

    asked: FloatArray
    """What the servo asks for."""
    drive: FloatArray
    """The same, limited."""
    friction: FloatArray
    """That of the wheel's bearing."""
    custom: FloatArray
    """That of a custom effect which loads the wheel."""

    @property
    def reported(self) -> FloatArray:
        """Their sum."""
        return self.drive + self.friction + self.custom


def torques(s: DriveState, p: Sets, speed: FloatArray, timestep_s: float) -> Torques:
    """Return the torques to report for wheels of a `speed` [rad/s], to an implicit integrator.

    Such an integrator subtracts the servo times the coming change of speed from their sum. `s` is the state
    after `begin`, and `p` are the parameters.
    """
    asked = _servo_torque(s, p, speed, timestep_s) + _ripple(s, p, speed)
    drive = _limited(s, p, speed, timestep_s, asked)
    cold = _cold(s, p, timestep_s)
    # What a warm bearing has lost of its viscous friction; the engine's damping holds it at its cold value.
    back = p["viscous_n_m_s_rad"] * (1 - cold) * speed
    custom = _custom(s, p, speed, timestep_s, drive)
    friction = back + _friction(s, p, speed, timestep_s, drive + back + custom, cold)
    return Torques(asked, drive, friction, custom)


def end(s: DriveState, p: Sets, acted: Torques, before: FloatArray, speed: FloatArray, h: float) -> None:
    """Take over into `s` how torques that `acted` moved the wheels in a substep of `h` [s].

    `p` are the parameters; the wheels' speed was `before` [rad/s], and is `speed` after it.
    """
    half = p["gap_rad"] / 2
    s.change = speed - before
    s.angle = s.angle + h * speed
    s.load = s.load + LOAD_SMOOTHING * (_effective_inertia(p, h) * s.change / h - acted.reported - s.load)
    gap, s.gap = s.gap, np.clip(s.gap + h * (_unloaded(s, p) - speed), -half, half)
    # The error of the motor, which turns without the wheel inside the gap.
    error = s.setpoint - speed - (s.gap - gap) / h
    # The integral does not wind up while the torque is limited.
    limited = ((acted.asked > acted.drive) & (error > 0)) | ((acted.asked < acted.drive) & (error < 0))
    s.integral = np.where(limited, s.integral, s.integral + h * error)


def _unloaded(s: DriveState, p: Sets) -> FloatArray:
    """Return the motors' speed without load, at which the servo's torque is 0."""
    return s.setpoint + p["servo_integral_n_m_rad"] / p["servo_n_m_s_rad"] * s.integral


def _effective_inertia(p: Sets, h: float) -> FloatArray:
    """Return the free wheels' inertia as a reported torque meets it: with that of the implicit damping."""
    return p["inertia_kg_m2"] + h * p["servo_n_m_s_rad"]


def _servo_torque(s: DriveState, p: Sets, speed: FloatArray, h: float) -> FloatArray:
    """Return the torque of the servos through their gears, without its limit."""
    kv, half, kind = p["servo_n_m_s_rad"], p["gap_rad"] / 2, p["gap_kind"]
    motor = _unloaded(s, p) + p["inertia_kg_m2"] * s.rise / (h * kv)
    rate = motor - speed
    # The motor moves the wheel only by the part of its travel that lies beyond the gap: of its travel
    # relative to a wheel that would coast on, or to one that would rest.
    rests = kind == GAP_KINDS.index("rest")
    position = s.gap + h * np.where(rests, motor, rate)
    beyond = position - np.clip(position, -half, half)
    coasting = np.where(beyond == 0.0, kv * s.change, kv * beyond / h)
    resting = kv * (beyond / h - speed)
    taken_up = np.minimum(np.abs(position) / np.where(half > 0.0, half, 1.0), 1.0) * (kv * rate)
    sprung = np.where(position * rate > 0.0, taken_up, 0.0)
    geared = np.where(rests, resting, np.where(kind == GAP_KINDS.index("spring"), sprung, coasting))
    return np.where(half > 0.0, geared, kv * rate)


def _ripple(s: DriveState, p: Sets, speed: FloatArray) -> FloatArray:
    """Return the torque that follows the wheels' angle."""
    if not np.any((p["ripple_n_m"] > 0.0) | (p["ripple_share"] > 0.0)):
        return np.zeros(speed.shape)
    size = p["ripple_n_m"] + p["ripple_share"] * p["servo_n_m_s_rad"] * speed
    return size * _each(math.sin, p["ripple_per_turn"] * s.angle + p["ripple_phase_rad"])


def _limited(s: DriveState, p: Sets, speed: FloatArray, h: float, asked: FloatArray) -> FloatArray:
    """Return torques whose limit is that of what reaches the wheel, if its speed changes as it did last."""
    limit, supply = p["torque_limit_n_m"], p["supply_rpm"]
    off = p["servo_n_m_s_rad"] * s.change + p["rotor_kg_m2"] * s.change / h
    falls = (supply > 0.0) & (limit < _UNLIMITED)
    ratio = np.where(falls, speed / (np.where(falls, supply, 1.0) * RAD_S_PER_RPM), 0.0)
    forwards, backwards = limit * np.clip(1 - ratio, 0, 1), limit * np.clip(1 + ratio, 0, 1)
    low = np.where(asked - off < -backwards, -backwards + off, asked)
    return np.where(asked - off > forwards, forwards + off, low)


def _custom(s: DriveState, p: Sets, speed: FloatArray, h: float, drive: FloatArray) -> FloatArray:
    """Return the torque of a custom effect that loads the wheels."""
    if not np.any(p["load_program"]):
        return np.zeros(speed.shape)
    seconds = (s.substeps - 1) * h  # `begin` has counted this substep
    now: dict[str, npt.ArrayLike] = {"command": s.r1, "angle": s.angle, "time": seconds}
    per_torque = h / np.maximum(_effective_inertia(p, h), _TINY)
    return custom_torque(p["load_program"], now, p["servo_n_m_s_rad"], per_torque, speed, drive)


def _cold(s: DriveState, p: Sets, h: float) -> FloatArray:
    """Return the share of the bearings' friction that is left, of shape (sets, 1)."""
    share, seconds = p["friction_warm_share"], p["friction_warm_s"]
    warms = (share > 0.0) & (seconds > 0.0)
    if not np.any(warms):
        return np.ones(share.shape)
    now = (s.substeps - 1) * h  # `begin` has counted this substep
    warmth = 1 - _each(math.exp, -now / np.where(warms, seconds, 1.0))
    return np.where(warms, 1 - share * warmth, 1.0)


def _friction(
    s: DriveState, p: Sets, speed: FloatArray, h: float, drive: FloatArray, cold: FloatArray
) -> FloatArray:
    """Return the torque that brings wheels to rest in this substep, within Coulomb friction and stiction."""
    breakaway, stribeck, coulomb = p["breakaway_n_m"] * cold, p["stribeck_rad_s"], p["coulomb_n_m"] * cold
    falling = (breakaway > 0.0) & (stribeck > 0.0)
    limit = np.broadcast_to(coulomb, speed.shape)
    perstep, left = np.maximum(_effective_inertia(p, h), _TINY) / h, speed
    stop = drive + s.load + left * perstep
    # Friction that falls with speed is that of the speed after the substep, found by iteration.
    for _ in range(3 if np.any(falling) else 0):
        ratio = left / np.where(falling, stribeck, 1.0)
        limit = np.where(falling, coulomb + breakaway * _each(math.exp, -ratio * ratio), limit)
        left = (stop - np.clip(stop, -limit, limit)) / perstep
    return -np.clip(stop, -limit, limit)


def _each(function: Callable[[float], float], values: FloatArray) -> FloatArray:
    """Return a function of each value as the C library rounds it; numpy's own differ in the last bit."""
    return np.array([function(x) for x in values.ravel().tolist()]).reshape(values.shape)
