"""The servo of a wheel behind its setpoint, and what loads it, for many sets of parameters and runs at once.

    torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]

as chain.h says. This is the second half of the reference for mecanum_env/plugin/chain.c, behind
`mecanum_env.law.chain`; shapes are as there. The order of the operations is part of the definition, since
tests hold both equal bit for bit.
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
from mecanum_env.law.motor_bounds import supplied
from mecanum_env.law.parameters import Sets
from mecanum_env.law.wheel_load import GAP_KINDS
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

LOAD_SMOOTHING: Final = 0.1
"""Share of a change of the load that its estimate follows in a substep."""
_TINY: Final = 1e-15  # least inertia of a wheel [kg m^2]
_UNLIMITED: Final = 1e10  # torque limit [N m] that means none


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques on wheels [N m], each of shape (sets, runs)."""

    asked: FloatArray
    """What the servo asks for, and the ripple."""
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


def torques(
    s: DriveState, p: Sets, speed: FloatArray, timestep_s: float, lost_v: FloatArray | float = 0.0
) -> Torques:
    """Return the torques to report for wheels of a `speed` [rad/s], to an implicit integrator.

    Such an integrator subtracts the servo times the coming change of speed from their sum. `s` is the state
    after `mecanum_env.law.chain.begin`; `p` and `lost_v` are as there.
    """
    asked = _asked(s, p, speed, timestep_s) + _ripple(s, p, speed)
    drive = _limited(s, p, speed, timestep_s, asked, lost_v)
    cold = _coldness(s, p, timestep_s)
    # What a warm bearing has lost of its viscous friction, which the engine's joint holds at its cold value.
    back = p["viscous_n_m_s_rad"] * (1 - cold) * speed
    custom = _custom(s, p, speed, timestep_s, drive, lost_v)
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


def _asked(s: DriveState, p: Sets, speed: FloatArray, h: float) -> FloatArray:
    """Return the torque that the servo asks for through the gear."""
    kv, half = p["servo_n_m_s_rad"], p["gap_rad"] / 2
    rests, springs = (p["gap_kind"] == GAP_KINDS.index(kind) for kind in ("rest", "spring"))
    motor = _unloaded(s, p) + p["inertia_kg_m2"] * s.rise / (h * kv)
    rate = motor - speed
    # The motor moves the wheel only by the part of its travel that lies beyond the gap.
    position = s.gap + h * np.where(rests, motor, rate)
    beyond = position - np.clip(position, -half, half)
    geared = np.where(beyond == 0.0, kv * s.change, kv * beyond / h)
    geared = np.where(rests, kv * (beyond / h - speed), geared)
    taken_up = np.minimum(np.abs(position) / np.where(half > 0.0, half, 1.0), 1.0) * (kv * rate)
    geared = np.where(springs, np.where(position * rate > 0.0, taken_up, 0.0), geared)
    return np.where(half > 0.0, geared, kv * rate)


def _ripple(s: DriveState, p: Sets, speed: FloatArray) -> FloatArray:
    """Return the torque that follows the wheels' angle."""
    acts = (p["ripple_n_m"] > 0.0) | (p["ripple_share"] > 0.0)
    if not np.any(acts):
        return np.zeros(speed.shape)
    size = p["ripple_n_m"] + p["ripple_share"] * p["servo_n_m_s_rad"] * speed
    swing = _each(math.sin, p["ripple_per_turn"] * s.angle + p["ripple_phase_rad"])
    return np.where(acts, size * swing, 0.0)


def _limited(
    s: DriveState, p: Sets, speed: FloatArray, h: float, asked: FloatArray, lost_v: FloatArray | float
) -> FloatArray:
    """Return the torque within its limit, and within what the supply leaves at this speed."""
    limit, supply = p["torque_limit_n_m"], p["supply_rpm"]
    # The limit is that of the torque which reaches the wheel, if its speed changes as in the last substep.
    off = p["servo_n_m_s_rad"] * s.change + p["rotor_kg_m2"] * s.change / h
    falls = (supply > 0.0) & (limit < _UNLIMITED)
    left = supplied(np.where(falls, supply, 1.0), p["supply_per_volt"], lost_v)
    ratio = speed / (left * RAD_S_PER_RPM)
    forwards = np.where(falls, limit * np.clip(1 - ratio, 0, 1), limit)
    backwards = np.where(falls, limit * np.clip(1 + ratio, 0, 1), limit)
    high, low = asked - off > forwards, asked - off < -backwards
    return np.where(high, forwards + off, np.where(low, -backwards + off, asked))


def _custom(
    s: DriveState, p: Sets, speed: FloatArray, h: float, drive: FloatArray, lost_v: FloatArray | float
) -> FloatArray:
    """Return the torque of a custom effect that loads the wheels."""
    if not np.any(p["load_program"]):
        return np.zeros(speed.shape)
    seconds = (s.substeps - 1) * h  # `begin` has counted this substep
    now: dict[str, npt.ArrayLike] = {"command": s.r1, "angle": s.angle, "time": seconds}
    now["voltage"] = lost_v
    per_torque = h / np.maximum(_effective_inertia(p, h), _TINY)
    return custom_torque(p["load_program"], now, p["servo_n_m_s_rad"], per_torque, speed, drive)


def _coldness(s: DriveState, p: Sets, h: float) -> FloatArray:
    """Return the shares of the bearings' friction that are left, shape (sets, 1)."""
    share, time_s = p["friction_warm_share"], p["friction_warm_s"]
    warms = (share > 0.0) & (time_s > 0.0)
    if not np.any(warms):
        return np.ones(share.shape)
    elapsed = -((s.substeps - 1) * h) / np.where(warms, time_s, 1.0)
    return np.where(warms, 1 - share * (1 - _each(math.exp, elapsed)), 1.0)


def _friction(
    s: DriveState, p: Sets, speed: FloatArray, h: float, torque: FloatArray, cold: FloatArray
) -> FloatArray:
    """Return the torque that brings wheels to rest in this substep, within Coulomb friction and stiction."""
    breakaway, coulomb, stribeck = p["breakaway_n_m"] * cold, p["coulomb_n_m"] * cold, p["stribeck_rad_s"]
    falling = (breakaway > 0.0) & (stribeck > 0.0)
    limit = np.broadcast_to(coulomb, speed.shape)
    perstep, left = np.maximum(_effective_inertia(p, h), _TINY) / h, speed
    stop = torque + s.load + left * perstep
    # Friction that falls with speed is that of the speed after the substep, found by iteration.
    for _ in range(3 if np.any(falling) else 0):
        ratio = left / np.where(falling, stribeck, 1.0)
        limit = np.where(falling, coulomb + breakaway * _each(math.exp, -ratio * ratio), limit)
        left = (stop - np.clip(stop, -limit, limit)) / perstep
    return -np.clip(stop, -limit, limit)


def _each(function: Callable[[float], float], values: FloatArray) -> FloatArray:
    """Return a function of the C library for each value: numpy's own differ from it in the last bit."""
    return np.array([function(x) for x in values.ravel().tolist()], float).reshape(values.shape)
