"""A model of the robot's own motion: wheel commands in, body velocities out, for many robots at a time.

Each wheel's setpoint follows the identified law; a servo of limited torque makes the wheel follow it. With
the setpoints s, the body's twist v, its wheel speeds w = J v and its inertia M, each law tick h is

    e = J^+ s(k+1) - v(k)                       the missing twist
    torque = clip(T g e / h, +-limit)           T = J (J'J)^-1 M distributes a force over the wheels
    v(k+1) = v(k) + h M^-1 J' torque

where g = h b / (M + h b), b = servo J'J, is the share of e that a servo of finite stiffness removes in a
tick. Wheel friction f raises the torque that the drive is asked for by g f and is subtracted from the result.
The model's effects on drives, servo, wheel friction, dimensions and mass are included. Not modelled: limits
of V and VC and of the drives' acceleration, backlash, slip, Coriolis forces and external forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.effects.apply import active_effects, added_load
from mecanum_env.effects.definition import Load
from mecanum_env.kinematics import WHEELS, twist_to_wheels, wheels_to_twist
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.mjcf.plants import wheel_armature
from mecanum_env.model import Model, Robot
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.drive import EPS
from training.controllers.wheel_drives import WheelDrives

MEMORY = 5
"""Numbers in the memory of a wheel law: w(k), w(k-1), w(k-2), r(k-1), r(k-2)."""
_SLOW_RAD_S = 0.3
"""Below this wheel speed Coulomb friction falls linearly to 0, so that it does not chatter [rad/s]."""


@dataclass(frozen=True)
class MotionState:
    """The state of n robots between two commands."""

    law: FloatArray
    """Memory of each wheel's law: w(k), w(k-1), w(k-2), r(k-1), r(k-2) [rpm], shape (4, 5, n)."""
    twist: FloatArray
    """Body twist: ahead, left [m/s], turn [rad/s], shape (3, n)."""

    def repeated(self, n: int) -> MotionState:
        """Return the state of one robot for n robots."""
        return MotionState(np.repeat(self.law, n, axis=2), np.repeat(self.twist, n, axis=1))


class MotionModel:
    """Predicts twists from wheel commands; the state is passed in and returned.

    A `command_latency` of the model is ignored.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.tick_s = model.wheel.law.sample_period_s
        self.period_s = model.wheel.command_period_s
        self.drives = WheelDrives.of(model)
        robot, load = changed_robot(model), added_load(model)
        robot = replace(robot, mass_kg=robot.mass_kg + load.mass_kg)
        if robot.servo_integral_n_m_rad > 0.0:
            load = Load(mass_kg=load.mass_kg)  # integral action makes up for friction
        self._coulomb_n_m, self._damping = load.coulomb_n_m, load.damping_n_m_s_rad
        self._has_friction = self._coulomb_n_m > 0.0 or self._damping > 0.0
        most = math.ceil(self.period_s / self.tick_s + EPS) + 1
        # (4, most, 6, 6)
        self._responses = np.array([_law_powers(drive.law, most) for drive in self.drives.each])
        jacobian = twist_to_wheels(np.eye(3), robot).T * RAD_S_PER_RPM  # (4, 3) rad/s per unit of twist
        gram = np.sum(jacobian * jacobian, axis=0)  # J'J is diagonal
        translation, rotation = wheel_armature(robot)
        mass = robot.mass_kg + translation
        inertia = np.array([mass, mass, robot.yaw_inertia_kg_m2 + rotation])
        stiffness = robot.servo_n_m_s_rad * gram
        share = self.tick_s * stiffness / (inertia + self.tick_s * stiffness)
        self._to_torque = jacobian / gram * (inertia * share / self.tick_s)
        self._to_twist = (jacobian / inertia * self.tick_s).T
        self._to_speeds = jacobian
        self._friction_share = float(np.mean(share))
        self._torque_limit = robot.torque_limit_n_m
        self._rpm_to_twist = wheels_to_twist(np.eye(4), robot).T  # (3, 4)

    def rest(self) -> MotionState:
        """Return the state of one robot at rest."""
        return MotionState(np.zeros((len(WHEELS), MEMORY, 1)), np.zeros((3, 1)))

    def ticks(self, command: int) -> int:
        """Return the number of law ticks during a command; commands are counted from 0."""
        first, end = (math.ceil(k * self.period_s / self.tick_s - EPS) for k in (command, command + 1))
        return end - first

    def play(self, state: MotionState, wheels_rpm: FloatArray, ticks: int) -> tuple[FloatArray, MotionState]:
        """Return the twist after each tick of a held command, shape (ticks, 3, n), and the state at the end.

        The wheel commands, shape (4, n), are those that `WheelDrives.received` returns; they last for a
        number of law ticks, at most one more than a command period has.
        """
        before = np.concatenate([state.law, wheels_rpm[:, None, :]], axis=1)  # (4, 6, n)
        setpoints = np.matmul(self._responses[:, :ticks, 0], before)  # (4, ticks, n)
        wanted = np.tensordot(self._rpm_to_twist, setpoints, axes=1)  # (3, ticks, n)
        twist, most = state.twist, self._torque_limit
        twists = np.empty((ticks, *twist.shape))
        for k in range(ticks):
            torque = self._to_torque @ (wanted[:, k] - twist)
            if self._has_friction:
                speeds = self._to_speeds @ twist
                lost = self._coulomb_n_m * np.clip(speeds / _SLOW_RAD_S, -1.0, 1.0) + self._damping * speeds
                torque += self._friction_share * lost
            np.minimum(torque, most, out=torque)
            np.maximum(torque, -most, out=torque)
            if self._has_friction:
                torque -= lost
            twist = twist + self._to_twist @ torque
            twists[k] = twist
        return twists, MotionState(np.matmul(self._responses[:, ticks - 1, :MEMORY], before), twist)


def changed_robot(model: Model) -> Robot:
    """Return the robot of a model with the effects that change its parameters, without added mass."""
    for effect, values in active_effects(model):
        if effect.change_model is not None:
            model = effect.change_model(model, values)
    return model.robot


def _law_powers(law: WheelLaw, ticks: int) -> FloatArray:
    """Return the linear maps of (memory, held command) over 1, 2, ... ticks of a law, shape (ticks, 6, 6)."""
    one = np.zeros((MEMORY + 1, MEMORY + 1))
    one[0] = [law.A, law.B, law.C, law.E, law.F, law.D]
    one[1, 0] = one[2, 1] = 1.0
    one[3, 5] = one[4, 3] = one[5, 5] = 1.0
    powers = [one]
    while len(powers) < ticks:
        powers.append(one @ powers[-1])
    return np.array(powers)
