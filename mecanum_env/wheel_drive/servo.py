"""The servo of a wheel behind its setpoint, and what loads it, for many sets of parameters and runs at once.

    torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]

as chain.h says. This is the second half of the reference for mecanum_env/plugin/chain.c, behind
`mecanum_env.wheel_drive.chain`; shapes are as there. The order of the operations is part of the definition,
since tests hold both equal bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.chain import DriveState
from mecanum_env.wheel_drive.custom_load import custom_torque
from mecanum_env.wheel_drive.light_wheel import is_light
from mecanum_env.wheel_drive.motor_bounds import supplied
from mecanum_env.wheel_drive.parameters import Sets
from mecanum_env.wheel_drive.parts import REFERENCE, Parts

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
    friction: FloatArray | None
    """That of the wheel's bearing; None: no bearing has any."""
    custom: FloatArray | None
    """That of a custom effect which loads the wheel; None: there is none."""

    @property
    def reported(self) -> FloatArray:
        """Their sum."""
        total = self.drive
        for torque in (self.friction, self.custom):
            total = total if torque is None else total + torque
        return total


def torques(
    s: DriveState,
    p: Sets,
    speed: FloatArray,
    timestep_s: float,
    lost_v: FloatArray | float = 0.0,
    parts: Parts = REFERENCE,
) -> Torques:
    """Return the torques to report for wheels of a `speed` [rad/s], to an implicit integrator.

    Such an integrator subtracts the servo times the coming change of speed from their sum. `s` is the state
    after `mecanum_env.wheel_drive.chain.begin`; `p` and `lost_v` are as there.
    Only the `parts` that some drive has are computed.
    """
    asked = _asked(s, p, speed, timestep_s, parts)
    if parts.ripple:
        asked = asked + _ripple(s, p, speed, parts)
    drive = _limited(s, p, speed, timestep_s, asked, lost_v, parts)
    custom = _custom(s, p, speed, timestep_s, drive, lost_v) if parts.custom else None
    if not parts.friction:
        return Torques(asked, drive, None, custom)
    cold = _coldness(s, p, timestep_s, p["friction_warm_share"], parts)
    # What a warm bearing has lost of its viscous friction, which the engine's joint holds at its cold value.
    left = _coldness(s, p, timestep_s, p["viscous_warm_share"], parts)
    back = p["viscous_n_m_s_rad"] * (1 - left) * speed
    others = drive + back if custom is None else drive + back + custom
    friction = back + _friction(s, p, speed, timestep_s, others, cold, parts)
    return Torques(asked, drive, friction, custom)


def end(
    s: DriveState,
    p: Sets,
    acted: Torques,
    before: FloatArray,
    speed: FloatArray,
    h: float,
    parts: Parts = REFERENCE,
) -> None:
    """Take over into `s` how torques that `acted` moved the wheels in a substep of `h` [s].

    `p` are the parameters; the wheels' speed was `before` [rad/s], and is `speed` after it. What none of the
    `parts` needs is left as it is.
    """
    s.change = speed - before
    if parts.ripple or parts.custom:
        s.angle = s.angle + h * speed
    if parts.friction:
        s.load = s.load + LOAD_SMOOTHING * (_effective_inertia(p, h) * s.change / h - acted.reported - s.load)
    if not (parts.gap or parts.integral):
        return
    error = s.setpoint - speed
    if parts.gap:
        half = p["gap_rad"] / 2
        moved = parts.xp.clip(s.gap + h * (_unloaded(s, p) - speed), -half, half)
        # A light wheel has crossed it before the servo, whose setpoint is that of the wheel.
        gap, s.gap = s.gap, parts.xp.where(is_light(p), s.gap, moved)
        # The error of the motor, which turns without the wheel inside the gap.
        error = error - (s.gap - gap) / h
    # While the torque is limited, the integral winds up by a share of the error only, mostly by none.
    limited = ((acted.asked > acted.drive) & (error > 0)) | ((acted.asked < acted.drive) & (error < 0))
    s.integral = s.integral + parts.xp.where(limited, p["servo_windup"], 1.0) * h * error


def _unloaded(s: DriveState, p: Sets) -> FloatArray:
    """Return the motors' speed without load, at which the servo's torque is 0."""
    return s.setpoint + p["servo_integral_n_m_rad"] / p["servo_n_m_s_rad"] * s.integral


def _effective_inertia(p: Sets, h: float) -> FloatArray:
    """Return the free wheels' inertia as a reported torque meets it: with that of the implicit damping."""
    return p["inertia_kg_m2"] + h * p["servo_n_m_s_rad"]


def _asked(s: DriveState, p: Sets, speed: FloatArray, h: float, parts: Parts) -> FloatArray:
    """Return the torque that the servo asks for through the gear."""
    kv, xp = p["servo_n_m_s_rad"], parts.xp
    motor = _unloaded(s, p) if parts.integral else s.setpoint
    motor = motor + p["inertia_kg_m2"] * s.rise / (h * kv)
    rate = motor - speed
    if not parts.gap:
        return kv * rate
    half = p["gap_rad"] / 2
    # The motor moves a wheel that coasts on only by the part of its travel that lies beyond the gap.
    position = s.gap + h * rate
    beyond = position - xp.clip(position, -half, half)
    geared = xp.where(beyond == 0.0, kv * s.change, kv * beyond / h)
    torque: FloatArray = xp.where((half > 0.0) & ~is_light(p), geared, kv * rate)
    return torque


def _ripple(s: DriveState, p: Sets, speed: FloatArray, parts: Parts) -> FloatArray:
    """Return the torque that follows the wheels' angle."""
    acts = (p["ripple_n_m"] > 0.0) | (p["ripple_share"] > 0.0)
    if not bool(acts.any()):
        none: FloatArray = parts.xp.zeros_like(speed)
        return none
    size = p["ripple_n_m"] + p["ripple_share"] * p["servo_n_m_s_rad"] * speed
    swing = parts.sines(p["ripple_per_turn"] * s.angle + p["ripple_phase_rad"])
    torque: FloatArray = parts.xp.where(acts, size * swing, 0.0)
    return torque


def _limited(
    s: DriveState,
    p: Sets,
    speed: FloatArray,
    h: float,
    asked: FloatArray,
    lost_v: FloatArray | float,
    parts: Parts,
) -> FloatArray:
    """Return the torque within its limit, and within what the supply leaves at this speed."""
    limit, supply, xp = p["torque_limit_n_m"], p["supply_rpm"], parts.xp
    # The limit is that of the torque which reaches the wheel, if its speed changes as in the last substep.
    off = p["servo_n_m_s_rad"] * s.change
    if parts.rotor:
        off = off + p["rotor_kg_m2"] * s.change / h
    if not parts.supply:
        left = asked - off
        if not parts.integral:
            within: FloatArray = off + xp.clip(left, -limit, limit)
            return within
        # To the bit what is asked where nothing limits it: there the integral goes on.
        held: FloatArray = xp.where(left > limit, limit + off, xp.where(left < -limit, off - limit, asked))
        return held
    falls = (supply > 0.0) & (limit < _UNLIMITED)
    left = supplied(xp.where(falls, supply, 1.0), p["supply_per_volt"], lost_v)
    ratio = speed / (left * RAD_S_PER_RPM)
    forwards = xp.where(falls, limit * xp.clip(1 - ratio, 0, 1), limit)
    backwards = xp.where(falls, limit * xp.clip(1 + ratio, 0, 1), limit)
    high, low = asked - off > forwards, asked - off < -backwards
    torque: FloatArray = xp.where(high, forwards + off, xp.where(low, -backwards + off, asked))
    return torque


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


def _coldness(s: DriveState, p: Sets, h: float, share: FloatArray, parts: Parts) -> FloatArray:
    """Return what is left of a friction of which warm bearings have lost a `share`, both (sets, 1)."""
    xp = parts.xp
    time_s = p["friction_warm_s"]
    warms = (share > 0.0) & (time_s > 0.0)
    if not bool(warms.any()):
        whole: FloatArray = xp.ones_like(share)
        return whole
    elapsed = -((s.substeps - 1) * h) / xp.where(warms, time_s, 1.0)
    left: FloatArray = xp.where(warms, 1 - share * (1 - parts.exponentials(elapsed)), 1.0)
    return left


def _friction(
    s: DriveState,
    p: Sets,
    speed: FloatArray,
    h: float,
    torque: FloatArray,
    cold: FloatArray,
    parts: Parts,
) -> FloatArray:
    """Return the torque that brings wheels to rest in this substep, within Coulomb friction and stiction."""
    breakaway, coulomb, stribeck = p["breakaway_n_m"] * cold, p["coulomb_n_m"] * cold, p["stribeck_rad_s"]
    falling = (breakaway > 0.0) & (stribeck > 0.0)
    xp = parts.xp
    limit = xp.broadcast_to(coulomb, speed.shape)
    inertia: Any = _effective_inertia(p, h)
    left = speed
    # A plain number where all drives agree.
    perstep = (max(inertia, _TINY) if isinstance(inertia, float) else xp.clip(inertia, _TINY, None)) / h
    stop = torque + s.load + left * perstep
    # Friction that falls with speed is that of the speed after the substep, found by iteration.
    for _ in range(3 if bool(falling.any()) else 0):
        ratio = left / xp.where(falling, stribeck, 1.0)
        limit = xp.where(falling, coulomb + breakaway * parts.exponentials(-ratio * ratio), limit)
        left = (stop - xp.clip(stop, -limit, limit)) / perstep
    hold: FloatArray = -xp.clip(stop, -limit, limit)
    return hold
