"""The robot's own motion as the model predicts it: wheel commands in, body velocities out, many at a time.

Each wheel's setpoint follows the identified law; the drives hold it with their servo, as far as their torque
goes. With s the setpoints, v the body's twist, w = J v its wheel speeds and M its inertia, each law tick h is

    e = J^+ s(k+1) - v(k)                       what the twist lacks
    torque = clip(T g e / h, +-limit)           T = J (J'J)^-1 M spreads a force over the wheels
    v(k+1) = v(k) + h M^-1 J' torque

with g = h b / (M + h b), b = servo J'J: the share of e that a servo of finite stiffness makes up in a tick.
The model's effects on drives, servo, friction of the wheels, dimensions and mass count: friction f asks the
drive for g f more and is taken off the torque. Limits of V and VC, backlash, slip, forces of the turning
frame and what pushes from outside are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.effects.apply import active_effects, added_load, drive_parameters
from mecanum_env.kinematics import WHEELS, command_to_wheels, twist_to_wheels, wheels_to_twist
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.drive import EPS, received_command
from mecanum_env.mjcf.plants import wheel_armature
from mecanum_env.model import Model, Robot
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

_MEMORY = 5  # w(k), w(k-1), w(k-2), r(k-1), r(k-2)


@dataclass(frozen=True)
class MotionState:
    """Where n robots are between two commands."""

    law: FloatArray
    """Of each wheel w(k), w(k-1), w(k-2), r(k-1), r(k-2) [rpm], shape (4, 5, n)."""
    twist: FloatArray
    """Body twist: ahead, left [m/s], turn [rad/s], shape (3, n)."""

    def repeated(self, n: int) -> MotionState:
        """Return the state of one robot n times."""
        return MotionState(np.repeat(self.law, n, axis=2), np.repeat(self.twist, n, axis=1))


class MotionModel:
    """Predicts twists on the identified law; holds no state.

    Args:
        model: its wheel laws, robot and effects; a `command_latency` is not put in here.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.tick_s = model.wheel.law.sample_period_s
        self.period_s = model.wheel.command_period_s
        # V, theta and VC are rounded, not the wheels' shares of them.
        self._drives = [replace(drive_parameters(model, w), command_quantum_rpm=0.0) for w in WHEELS]
        robot, friction = _as_it_is(model)
        most = math.ceil(self.period_s / self.tick_s + EPS) + 1
        laws = [model.law_of(wheel) for wheel in WHEELS]
        pairs = [_responses(law, most) for law in laws]
        self._speeds = np.array([speeds for speeds, _ in pairs])  # (4, most, 6)
        self._states = np.array([states for _, states in pairs])  # (4, most, 5, 6)
        jacobian = twist_to_wheels(np.eye(3), robot).T * RAD_S_PER_RPM  # (4, 3) rad/s per unit of twist
        gram = np.sum(jacobian * jacobian, axis=0)  # its columns are orthogonal
        translation, rotation = wheel_armature(robot)
        inertia = np.array(
            [robot.mass_kg + translation, robot.mass_kg + translation, robot.yaw_inertia_kg_m2 + rotation]
        )
        stiffness = robot.servo_n_m_s_rad * gram
        share = self.tick_s * stiffness / (inertia + self.tick_s * stiffness)
        self._to_torque = jacobian / gram * (inertia * share / self.tick_s)
        self._to_twist = (jacobian / inertia * self.tick_s).T
        self._to_speeds = jacobian
        self._friction, self._share = friction, float(np.mean(share))
        self._torque_limit = robot.torque_limit_n_m
        self._rpm_to_twist = wheels_to_twist(np.eye(4), robot).T  # (3, 4)

    def rest(self) -> MotionState:
        """Return the state of one robot that stands."""
        return MotionState(np.zeros((len(WHEELS), _MEMORY, 1)), np.zeros((3, 1)))

    def ticks(self, command: int) -> int:
        """Return the number of law ticks during a command, counted from 0 since the start."""
        return self._first_tick(command + 1) - self._first_tick(command)

    def _first_tick(self, command: int) -> int:
        return math.ceil(command * self.period_s / self.tick_s - EPS)

    def wheels(self, command: tuple[float, float, float]) -> FloatArray:
        """Return the wheel speeds that a command (V, theta, VC) asks for, shape (4,) [rpm]."""
        return command_to_wheels(*command)

    def received(self, wheels_rpm: FloatArray, seconds: float) -> FloatArray:
        """Return what the drives make of wheel commands, shape (4, n) [rpm].

        Args:
            wheels_rpm: shape (4, n).
            seconds: since the start; a battery sags.
        """
        pairs = zip(self._drives, wheels_rpm, strict=True)
        return np.stack([received_command(drive, one, seconds) for drive, one in pairs])

    def play(self, state: MotionState, wheels_rpm: FloatArray, ticks: int) -> tuple[FloatArray, MotionState]:
        """Hold wheel commands for some ticks; return the twist after each, (ticks, 3, n), and the next state.

        Args:
            state: of n robots.
            wheels_rpm: as `received`, shape (4, n).
            ticks: of the law, at most one more than a command period has.
        """
        before = np.concatenate([state.law, wheels_rpm[:, None, :]], axis=1)  # (4, 6, n)
        setpoints = np.matmul(self._speeds[:, :ticks], before)  # (4, ticks, n)
        wanted = np.tensordot(self._rpm_to_twist, setpoints, axes=1)  # (3, ticks, n)
        twist = state.twist
        twists = np.empty((ticks, *twist.shape))
        most = self._torque_limit
        for k in range(ticks):
            torque = self._to_torque @ (wanted[:, k] - twist)
            if self._friction is not None:
                lost = self._friction.torque(self._to_speeds @ twist)
                torque += self._share * lost
            np.minimum(torque, most, out=torque)
            np.maximum(torque, -most, out=torque)
            if self._friction is not None:
                torque -= lost
            twist = twist + self._to_twist @ torque
            twists[k] = twist
        return twists, MotionState(np.matmul(self._states[:, ticks - 1], before), twist)


_SLOW_RAD_S = 0.3  # friction of a wheel slower than this grows with its speed, or it would chatter


@dataclass(frozen=True)
class _Friction:
    coulomb_n_m: float
    damping_n_m_s_rad: float

    def torque(self, speeds_rad_s: FloatArray) -> FloatArray:
        sign = np.clip(speeds_rad_s / _SLOW_RAD_S, -1.0, 1.0)
        return self.coulomb_n_m * sign + self.damping_n_m_s_rad * speeds_rad_s


def _as_it_is(model: Model) -> tuple[Robot, _Friction | None]:
    """Return the robot with the effects that change its numbers, and the friction of its wheels."""
    changed, load = model, added_load(model)
    for effect, values in active_effects(model):
        if effect.change_model is not None:
            changed = effect.change_model(changed, values)
    robot = replace(changed.robot, mass_kg=changed.robot.mass_kg + load.mass_kg)
    coulomb, damping = load.coulomb_n_m, load.damping_n_m_s_rad
    return robot, _Friction(coulomb, damping) if coulomb > 0.0 or damping > 0.0 else None


def _responses(law: WheelLaw, ticks: int) -> tuple[FloatArray, FloatArray]:
    """Return what a law makes of (its memory, a held command): speeds and memories after 1, 2, ... ticks.

    Linear maps, shapes (ticks, 6) and (ticks, 5, 6).
    """
    one = np.zeros((_MEMORY + 1, _MEMORY + 1))
    one[0] = [law.A, law.B, law.C, law.E, law.F, law.D]
    one[1, 0] = one[2, 1] = 1.0
    one[3, 5] = one[4, 3] = one[5, 5] = 1.0
    power, powers = np.eye(_MEMORY + 1), []
    for _ in range(ticks):
        power = one @ power
        powers.append(power)
    table = np.array(powers)
    return table[:, 0], table[:, :_MEMORY]
