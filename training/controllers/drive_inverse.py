"""The inverse of the drives' effects: the command that makes the robot move as the nominal one would.

Forward, in the steady state: command -> limits of V and VC -> wheels -> dead band, gains, saturation
(`mecanum_env.law.drive.received_command`) -> friction under a servo without integral action, which leaves

    w = (|r| - coulomb / servo) / (1 + viscous / servo) sign(r), or 0 where that is negative

-> body, with the wheel radius and track width that the robot has. The inverse scales the wanted motion until
every wheel can follow, which keeps its direction, and solves for the command by fixed-point iteration. Motion
that a dead band suppresses is added to the following commands (error diffusion).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects.apply import active_effects, added_load
from mecanum_env.kinematics import (
    body_to_wheels,
    clip_wheels,
    command_to_wheels,
    twist_to_wheels,
    wheels_to_body,
    wheels_to_command,
    wheels_to_twist,
)
from mecanum_env.model import Model
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from training.controllers.interface import Command
from training.controllers.motion_model import changed_robot, received_wheels, wheel_drives

_ITERATIONS: Final = 20
_TOLERANCE_RPM: Final = 0.02
"""Of the iteration [rpm]; commands are whole numbers."""
_HUGE_RPM: Final = 1e6


@dataclass(frozen=True)
class _Friction:
    """Speed that wheel friction costs under a servo without integral action."""

    constant_rpm: float
    relative: float

    def speed(self, driven_rpm: FloatArray) -> FloatArray:
        size = np.abs(driven_rpm)
        return np.copysign(np.maximum(size - self.constant_rpm, 0.0) / (1.0 + self.relative), driven_rpm)

    def driven(self, speed_rpm: FloatArray) -> FloatArray:
        size = np.abs(speed_rpm) * (1.0 + self.relative) + self.constant_rpm
        # A wheel at rest, up to rounding, needs no command.
        return np.where(np.abs(speed_rpm) < 1e-9, 0.0, np.copysign(size, speed_rpm))


class DriveInverse:
    """Changes commands so that a robot with the effects of a model moves as the nominal one would.

    Only effects that `undone_by` assigns to commands count.
    """

    def __init__(self, model: Model) -> None:
        effects = [pair for pair in active_effects(model) if pair[0].undone_by == "command"]
        self.is_needed = bool(effects)
        """Whether the model has an effect to invert; otherwise commands stay as they are."""
        self._limit_rpm = model.wheel.saturation_rpm
        self._drives = wheel_drives(model)
        self._smooth = [replace(drive, deadband_rpm=0.0) for drive in self._drives]
        self._nominal, self._robot = model.robot, changed_robot(model)
        load, servo = added_load(model), self._robot.servo_n_m_s_rad
        self._friction = _Friction(0.0, 0.0)
        if self._robot.servo_integral_n_m_rad <= 0.0:
            rpm = 1.0 / (servo * RAD_S_PER_RPM)
            self._friction = _Friction(load.coulomb_n_m * rpm, load.damping_n_m_s_rad / servo)
        limits: Mapping[str, float] = next((v for e, v in effects if e.name == "body_speed_limit"), {})
        self._v_rpm = min(limits.get("v_rpm", math.inf), FULL_V_RPM)
        self._vc_rpm = min(limits.get("vc_rpm", math.inf), FULL_VC_RPM)
        self._sticks = any(drive.deadband_rpm > 0.0 for drive in self._drives)
        self.reset()

    def reset(self) -> None:
        """Forget the motion that is still owed."""
        self._owed = np.zeros(3)

    def command(self, wanted: Command, seconds: float) -> Command:
        """Return the command that moves this robot as the wanted one moves the nominal robot.

        It acts `seconds` after the start, which counts for a sagging battery.
        """
        if not self.is_needed:
            return wanted
        wheels = clip_wheels(command_to_wheels(*wanted), self._limit_rpm)
        twist = wheels_to_twist(wheels, self._nominal)
        body = self._within_reach(wheels_to_body(twist_to_wheels(twist, self._robot)), seconds)
        return self._diffused(body, seconds) if self._sticks else self._rounded(self._solve(body, seconds))

    def delivered(self, command: Command, seconds: float) -> FloatArray:
        """Return the body motion (ahead, left, turn) [rpm], shape (3,), that a command leads to at a time."""
        v = min(max(command[0], -self._v_rpm), self._v_rpm)
        vc = min(max(command[2], -self._vc_rpm), self._vc_rpm)
        wheels = command_to_wheels(v, command[1], vc)
        return wheels_to_body(self._friction.speed(received_wheels(self._drives, wheels, seconds)))

    def _smooth_wheels(self, wheels: FloatArray, seconds: float) -> FloatArray:
        """Return the wheel speeds that wheel commands lead to, without dead bands and rounding."""
        return self._friction.speed(received_wheels(self._smooth, wheels, seconds))

    def _within_reach(self, body: FloatArray, seconds: float) -> FloatArray:
        """Return the body motion [rpm], scaled until every wheel can follow."""
        wheels = body_to_wheels(body)
        most = np.abs(self._smooth_wheels(np.copysign(_HUGE_RPM, wheels), seconds))
        size = np.abs(wheels)
        share = float(np.min(np.divide(most, size, out=np.ones(4), where=size > most)))
        return body * share

    def _solve(self, body: FloatArray, seconds: float) -> FloatArray:
        """Return the body command that leads to a body motion, shape (3,) [rpm]."""
        driven = self._friction.driven(body_to_wheels(body))
        command = wheels_to_body(driven / self._gains(driven, seconds))
        for _ in range(_ITERATIONS):
            # One body command drives four wheels of different gains; for gains within (0, 2) this contracts.
            off = body - wheels_to_body(self._smooth_wheels(body_to_wheels(command), seconds))
            if np.max(np.abs(off)) < _TOLERANCE_RPM:
                break
            command = command + off
        return command

    def _diffused(self, body: FloatArray, seconds: float) -> Command:
        """Return the command that comes nearest to a body motion [rpm] plus the motion owed so far."""
        if not np.any(body):
            self._owed = np.zeros(3)
            return 0, 0, 0
        wanted = body + self._owed
        plain = self._solve(wanted, seconds)
        wheels = np.abs(body_to_wheels(plain))
        # 1 rpm more, so that rounding does not fall below the threshold.
        least = np.array([drive.deadband_rpm for drive in self._drives]) + 1.0
        scales = [1.0] + [float(t / w) for t, w in zip(least, wheels, strict=True) if 0.5 < w < t]
        choices: list[Command] = [(0, 0, 0), *(self._rounded(plain * scale) for scale in scales)]
        reached = [self.delivered(choice, seconds) for choice in choices]
        best = int(np.argmin([float(np.sum((one - wanted) ** 2)) for one in reached]))
        self._owed = np.clip(wanted - reached[best], -np.max(least), np.max(least))
        return choices[best]

    def _gains(self, driven_rpm: FloatArray, seconds: float) -> FloatArray:
        """Return the gain of each wheel's drive in the direction in which it is driven, shape (4,)."""
        forward = np.array([d.gain * max(1.0 - d.drop_per_s * seconds, 1e-3) for d in self._drives])
        reverse = np.array([d.reverse_ratio for d in self._drives])
        return np.where(driven_rpm < 0.0, forward * reverse, forward)

    def _rounded(self, body_rpm: FloatArray) -> Command:
        """Return the command nearest to a body command [rpm], scaled into the robot's range."""
        speed, turn = math.hypot(body_rpm[0], body_rpm[1]), abs(float(body_rpm[2]))
        share = min(1.0, self._v_rpm / max(speed, 1e-9), self._vc_rpm / max(turn, 1e-9))
        v, theta, vc = wheels_to_command(body_to_wheels(body_rpm * share))
        return round(float(v)), round(float(theta)), round(float(vc))
