"""The servo of a wheel behind its setpoint, and what loads it: the reference for the plugin's chain.c.

    torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]

as chain.h says. The tests hold both equal bit for bit, so the order of the operations is part of the
definition. Arrays hold many wheels or runs at once; `simulate_wheel` is the bench, one free wheel on a hinge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.drive import DriveParameters
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

_TINY: Final = 1e-15
"""Least inertia of a wheel [kg m^2]."""
_SMOOTHING: Final = 0.1
"""Share of a change of the load that its estimate follows in a substep."""


@dataclass(frozen=True)
class Servo:
    """The numbers of a wheel's velocity servo."""

    servo_n_m_s_rad: float
    """Torque per speed error kv [N m s/rad]."""
    servo_integral_n_m_rad: float = 0.0
    """Torque per integrated speed error ki [N m/rad]."""
    torque_limit_n_m: float = math.inf
    """Largest torque; infinite: none."""
    inertia_kg_m2: float = 0.0
    """Inertia J of the free wheel [kg m^2], rotor not counted."""


class ServoLoop:
    """The servos of wheels of one kind, one substep after the other, on an engine with implicit damping.

    `drive` has the motor's supply and the load, `timestep_s` is the substep h [s], and `speed_rad_s` the
    steady speed at the start, shape (...).
    """

    def __init__(
        self, drive: DriveParameters, servo: Servo, timestep_s: float, speed_rad_s: npt.ArrayLike
    ) -> None:
        self.drive, self.load_parameters, self.servo, self.h = drive, drive.load, servo, timestep_s
        self.rotor = drive.load.answer_s * servo.servo_n_m_s_rad
        self.inertia = servo.inertia_kg_m2 + self.rotor
        speed = np.asarray(speed_rad_s, float)
        self.setpoint, self.speed = speed.copy(), speed.copy()
        nothing = np.zeros(speed.shape)
        self.rise, self.integral, self.change, self.load, self.angle = (nothing,) * 5
        self.gap = np.sign(speed) * self.load_parameters.gap_rad / 2
        self.substeps = 0

    def torques(self, setpoint_rad_s: FloatArray) -> FloatArray:
        """Take the setpoint [rad/s] at the end of the next substep; return the torque to report [N m].

        An implicit integrator subtracts kv times the wheel's change of speed from it.
        """
        self.rise = setpoint_rad_s - self.setpoint
        self.setpoint = setpoint_rad_s
        self._asked = self._asked_torque() + self._ripple()
        self._given = self._limited(self._asked)
        cold = self._coldness()
        back = self.load_parameters.viscous_n_m_s_rad * (1.0 - cold) * self.speed
        self._reported = self._given + (back + self._friction(self._given + back, cold))
        self.substeps += 1
        return self._reported

    def end(self, speed_rad_s: FloatArray) -> None:
        """Take over the wheel's speed [rad/s] at the end of the substep."""
        h, half = self.h, self.load_parameters.gap_rad / 2
        self.change = speed_rad_s - self.speed
        self.angle = self.angle + h * speed_rad_s
        moved = (self.inertia + h * self.servo.servo_n_m_s_rad) * self.change / h
        self.load = self.load + _SMOOTHING * (moved - self._reported - self.load)
        before = self.gap
        self.gap = np.clip(before + h * (self._unloaded() - speed_rad_s), -half, half)
        error = self.setpoint - speed_rad_s - (self.gap - before) / h
        limited = ((self._asked > self._given) & (error > 0)) | ((self._asked < self._given) & (error < 0))
        self.integral = np.where(limited, self.integral, self.integral + h * error)
        self.speed = speed_rad_s

    def _unloaded(self) -> FloatArray:
        ratio = self.servo.servo_integral_n_m_rad / self.servo.servo_n_m_s_rad
        return np.asarray(self.setpoint + ratio * self.integral)

    def _damping(self) -> FloatArray:
        return np.asarray(self.servo.servo_n_m_s_rad * self.change)

    def _asked_torque(self) -> FloatArray:
        h, kv, half = self.h, self.servo.servo_n_m_s_rad, self.load_parameters.gap_rad / 2
        motor = self._unloaded() + self.inertia * self.rise / (h * kv)
        rate = motor - self.speed
        if not half > 0.0:
            return np.asarray(kv * rate)
        kind = self.load_parameters.gap_kind
        position = self.gap + h * (motor if kind == "rest" else rate)
        beyond = position - np.clip(position, -half, half)
        if kind == "rest":
            return np.asarray(kv * (beyond / h - self.speed))
        if kind == "spring":
            taken_up = np.minimum(np.abs(position) / half, 1.0) * (kv * rate)
            return np.where(position * rate > 0.0, taken_up, 0.0)
        return np.where(beyond == 0.0, self._damping(), kv * beyond / h)

    def _limited(self, asked: FloatArray) -> FloatArray:
        limit = self.servo.torque_limit_n_m
        off = self._damping() + self.rotor * self.change / self.h
        forwards = backwards = np.full(asked.shape, limit)
        if math.isfinite(self.drive.supply_rpm) and math.isfinite(limit):
            ratio = self.speed / (self.drive.supply_rpm * RAD_S_PER_RPM)
            forwards, backwards = limit * np.clip(1 - ratio, 0, 1), limit * np.clip(1 + ratio, 0, 1)
        high, low = asked - off > forwards, asked - off < -backwards
        return np.where(high, forwards + off, np.where(low, -backwards + off, asked))

    def _coldness(self) -> float:
        """Share of the bearing's friction that is left."""
        share, seconds = self.load_parameters.friction_warm_share, self.load_parameters.friction_warm_s
        if not (share > 0.0 and seconds > 0.0):
            return 1.0
        return 1.0 - share * (1.0 - math.exp(-(self.substeps * self.h) / seconds))

    def _ripple(self) -> FloatArray:
        load = self.load_parameters
        if not (load.ripple_n_m > 0.0 or load.ripple_share > 0.0):
            return np.zeros(self.speed.shape)
        size = load.ripple_n_m + load.ripple_share * self.servo.servo_n_m_s_rad * self.speed
        return np.asarray(size * _each(math.sin, load.ripple_per_turn * self.angle + load.ripple_phase_rad))

    def _friction(self, torque: FloatArray, cold: float) -> FloatArray:
        load, h = self.load_parameters, self.h
        breakaway, coulomb = load.breakaway_n_m * cold, load.coulomb_n_m * cold
        falling = breakaway > 0.0 and load.stribeck_rad_s > 0.0
        if not (coulomb > 0.0 or falling):
            return np.zeros(torque.shape)
        perstep = max(self.inertia + h * self.servo.servo_n_m_s_rad, _TINY) / h
        left, limit = self.speed, np.full(torque.shape, coulomb)
        stop = torque + self.load + left * perstep
        for _ in range(3 if falling else 0):
            ratio = left / load.stribeck_rad_s
            limit = coulomb + breakaway * _each(math.exp, -ratio * ratio)
            left = (stop - np.clip(stop, -limit, limit)) / perstep
        return np.asarray(-np.clip(stop, -limit, limit))


def simulate_wheel(
    drive: DriveParameters,
    servo: Servo,
    setpoints_rpm: FloatArray,
    timestep_s: float,
    initial_rpm: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return the speeds of free wheels [rpm] at the start and after each substep, shape (..., n + 1).

    Args:
        drive: the drive's parameters; its viscous friction is the joint's.
        servo: the servo and the free wheel's inertia.
        setpoints_rpm: setpoints at the end of each substep, as `simulate_drive` returns them, shape (..., n).
        timestep_s: the substep [s].
        initial_rpm: steady speed before the start, shape (...).
    """
    n = setpoints_rpm.shape[-1]
    start = np.broadcast_to(np.asarray(initial_rpm, float), setpoints_rpm.shape[:-1])
    loop = ServoLoop(drive, servo, timestep_s, start * RAD_S_PER_RPM)
    damping = drive.load.viscous_n_m_s_rad
    moved = loop.inertia + timestep_s * (servo.servo_n_m_s_rad + damping)
    speeds = np.empty((*start.shape, n + 1))
    speeds[..., 0] = loop.speed / RAD_S_PER_RPM
    for k in range(n):
        torque = loop.torques(setpoints_rpm[..., k] * RAD_S_PER_RPM) - damping * loop.speed
        loop.end(loop.speed + timestep_s * (torque * (1.0 / moved)))
        speeds[..., k + 1] = loop.speed / RAD_S_PER_RPM
    return speeds


def _each(function: Callable[[float], float], values: FloatArray) -> FloatArray:
    """Return a function of the C library for each value: numpy's own differ from it in the last bit."""
    flat = [function(value) for value in values.ravel().tolist()]
    return np.array(flat, float).reshape(values.shape)
