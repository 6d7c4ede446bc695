"""The inverse of the drives' effects: the command that makes the robot move as the nominal one would.

Forward, in the steady state: command -> limits of V and VC -> wheels -> dead band, gains, saturation
(`training.controllers.wheel_drives`) -> friction under a servo without integral action, which leaves

    w = (|r| - (coulomb + breakaway exp(-(w / stribeck)^2)) / servo) / (1 + viscous / servo) sign(r)

or 0 where |r| does not break the wheel loose; a bearing that warms up loses a part of all three -> body, with
the wheel radius and track width that the robot has. The inverse scales the wanted motion until every wheel
can follow, which keeps its direction, and solves for the command by fixed-point iteration. Motion that a dead
band suppresses is added to the following commands (error diffusion).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.effects.apply import active_effects
from mecanum_env.kinematics import (
    body_to_wheels,
    clip_wheels,
    command_to_wheels,
    twist_to_wheels,
    wheels_to_body,
    wheels_to_command,
    wheels_to_twist,
)
from mecanum_env.model import Model, Robot
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.program import inputs_of
from mecanum_env.wheel_drive.set_point import unmapped, warm_up_gain
from mecanum_env.wheel_drive.wheel_load import WheelLoad
from training.controllers.interface import Command
from training.controllers.motion_model import changed_robot
from training.controllers.wheel_drives import WheelDrives

_ITERATIONS: Final = 20
_TOLERANCE_RPM: Final = 0.02
"""Of the iteration [rpm]; commands are whole numbers."""
_HUGE_RPM: Final = 1e6


@dataclass(frozen=True)
class _Friction:
    """Speed that wheel friction costs under a servo without integral action, when the bearing is cold."""

    constant_rpm: float = 0.0
    """Droop at any speed."""
    relative: float = 0.0
    """Droop in proportion to the speed."""
    breakaway_rpm: float = 0.0
    """Droop that comes on top at rest."""
    stribeck_rpm: float = 0.0
    """Speed at which 63 % of that is gone."""
    dry_share: float = 0.0
    viscous_share: float = 0.0
    warm_s: float = 0.0
    """Shares that a warm bearing loses of the droop at any speed and of that in proportion to the speed,
    and the time constant; 0 s: it does not warm up."""

    @staticmethod
    def of(robot: Robot, load: WheelLoad) -> _Friction:
        """Return the friction of a wheel; none where integral action makes up for it."""
        if robot.servo_integral_n_m_rad > 0.0:
            return _Friction()
        rpm = 1.0 / (robot.servo_n_m_s_rad * RAD_S_PER_RPM)
        return _Friction(
            load.coulomb_n_m * rpm,
            load.viscous_n_m_s_rad / robot.servo_n_m_s_rad,
            load.breakaway_n_m * rpm,
            load.stribeck_rad_s / RAD_S_PER_RPM,
            load.friction_warm_share,
            load.viscous_warm_share,
            load.friction_warm_s,
        )

    def at(self, seconds: float) -> _Friction:
        """Return the friction that is left at a time since the start."""
        if self.warm_s == 0.0:
            return self
        dry, viscous = (
            float(warm_up_gain(share, self.warm_s, seconds)) for share in (self.dry_share, self.viscous_share)
        )
        return _Friction(
            dry * self.constant_rpm, viscous * self.relative, dry * self.breakaway_rpm, self.stribeck_rpm
        )

    def speed(self, driven_rpm: FloatArray) -> FloatArray:
        """Return the steady speeds of wheels that start from rest."""
        size = np.abs(driven_rpm)
        speed = np.maximum(size - self.constant_rpm, 0.0) / (1.0 + self.relative)
        if self.breakaway_rpm > 0.0:
            # From above, so that it ends at the larger of two steady speeds.
            for _ in range(_ITERATIONS):
                droop = self.constant_rpm + self._extra(speed)
                speed = np.maximum(size - droop, 0.0) / (1.0 + self.relative)
            speed = np.where(size > self.constant_rpm + self.breakaway_rpm, speed, 0.0)
        return np.copysign(speed, driven_rpm)

    def driven(self, speed_rpm: FloatArray) -> FloatArray:
        """Return the setpoints that lead to steady speeds."""
        size = np.abs(speed_rpm) * (1.0 + self.relative) + self.constant_rpm + self._extra(speed_rpm)
        # A wheel at rest, up to rounding, needs no command.
        return np.where(np.abs(speed_rpm) < 1e-9, 0.0, np.copysign(size, speed_rpm))

    def _extra(self, speed_rpm: FloatArray) -> FloatArray:
        if self.breakaway_rpm == 0.0 or self.stribeck_rpm == 0.0:
            return np.full(np.shape(speed_rpm), self.breakaway_rpm)
        return np.asarray(self.breakaway_rpm * np.exp(-((speed_rpm / self.stribeck_rpm) ** 2)))


class DriveInverse:
    """Changes commands so that a robot with the effects of a model moves as the nominal one would.

    Only effects that `undone_by` assigns to commands count, and custom effects of command and set-point that
    follow from the command alone.
    """

    def __init__(self, model: Model) -> None:
        effects = [pair for pair in active_effects(model) if pair[0].undone_by == "command"]
        self._drives = WheelDrives.of(model)
        self.undoes_custom = any(_is_custom(drive) for drive in self._drives.each)
        """Whether the model has custom effects of command and set-point that are inverted."""
        self.is_needed = bool(effects) or self.undoes_custom
        """Whether the model has an effect to invert; otherwise commands stay as they are."""
        self._limit_rpm = model.wheel.saturation_rpm
        self._smooth = self._drives.without_dead_bands
        self._nominal, self._robot = model.robot, changed_robot(model)
        self._friction = _Friction.of(self._robot, self._drives.each[0].load)
        limits: Mapping[str, float] = next((v for e, v in effects if e.name == "body_speed_limit"), {})
        self._v_rpm = min(limits.get("v_rpm", math.inf), FULL_V_RPM)
        self._vc_rpm = min(limits.get("vc_rpm", math.inf), FULL_VC_RPM)
        self._sticks = any(drive.deadband_rpm > 0.0 for drive in self._drives.each)
        self.reset()

    def reset(self) -> None:
        """Forget the motion that is still owed."""
        self._owed = np.zeros(3)

    def command(self, wanted: Command, seconds: float) -> Command:
        """Return the command that moves this robot as the wanted one moves the nominal robot.

        It acts `seconds` after the start, which counts for a sagging battery and for drives that warm up.
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
        received = self._drives.received(wheels, seconds)
        return wheels_to_body(self._friction.at(seconds).speed(received))

    def _smooth_wheels(self, wheels: FloatArray, seconds: float) -> FloatArray:
        """Return the wheel speeds that wheel commands lead to, without dead bands and rounding."""
        return self._friction.at(seconds).speed(self._smooth.received(wheels, seconds))

    def _within_reach(self, body: FloatArray, seconds: float) -> FloatArray:
        """Return the body motion [rpm], scaled until every wheel can follow."""
        wheels = body_to_wheels(body)
        most = np.abs(self._smooth_wheels(np.copysign(_HUGE_RPM, wheels), seconds))
        size = np.abs(wheels)
        share = float(np.min(np.divide(most, size, out=np.ones(4), where=size > most)))
        return body * share

    def _solve(self, body: FloatArray, seconds: float) -> FloatArray:
        """Return the body command that leads to a body motion, shape (3,) [rpm]."""
        driven = self._friction.at(seconds).driven(body_to_wheels(body))
        best = command = wheels_to_body(self._sent(driven, seconds))
        least = math.inf
        for _ in range(_ITERATIONS):
            # One body command drives four wheels of different gains; for gains within (0, 2) this contracts.
            off = body - wheels_to_body(self._smooth_wheels(body_to_wheels(command), seconds))
            if (miss := float(np.max(np.abs(off)))) < least:
                best, least = command, miss
            if miss < _TOLERANCE_RPM:
                break
            command = command + off
        return best

    def _diffused(self, body: FloatArray, seconds: float) -> Command:
        """Return the command that comes nearest to a body motion [rpm] plus the motion owed so far."""
        if not np.any(body):
            self._owed = np.zeros(3)
            return 0, 0, 0
        wanted = body + self._owed
        plain = self._solve(wanted, seconds)
        wheels = np.abs(body_to_wheels(plain))
        # 1 rpm more, so that rounding does not fall below the threshold.
        least = np.array([drive.deadband_rpm for drive in self._drives.each]) + 1.0
        scales = [1.0] + [float(t / w) for t, w in zip(least, wheels, strict=True) if 0.5 < w < t]
        choices: list[Command] = [(0, 0, 0), *(self._rounded(plain * scale) for scale in scales)]
        reached = [self.delivered(choice, seconds) for choice in choices]
        best = int(np.argmin([float(np.sum((one - wanted) ** 2)) for one in reached]))
        self._owed = np.clip(wanted - reached[best], -np.max(least), np.max(least))
        return choices[best]

    def _sent(self, driven_rpm: FloatArray, seconds: float) -> FloatArray:
        """Return the wheel commands of which the drives make these ones within their limits, shape (4,)."""
        pairs = zip(driven_rpm, self._drives.each, strict=True)
        unbent = np.array([unmapped(w, d.knots_rpm, d.values_rpm) for w, d in pairs])
        forward = np.array([d.gain * max(1.0 - d.drop_per_s * seconds, 1e-3) for d in self._drives.each])
        forward *= [
            float(warm_up_gain(d.warm_up_share, d.warm_up_s, seconds)) if d.warms_up else 1.0
            for d in self._drives.each
        ]
        reverse = np.array([d.reverse_ratio for d in self._drives.each])
        sent = unbent / np.where(unbent < 0.0, forward * reverse, forward)
        lost = np.array([d.subtracted_rpm for d in self._drives.each])
        return np.where(unbent == 0.0, 0.0, sent + np.copysign(lost, sent))

    def _rounded(self, body_rpm: FloatArray) -> Command:
        """Return the command nearest to a body command [rpm], scaled into the robot's range."""
        speed, turn = math.hypot(body_rpm[0], body_rpm[1]), abs(float(body_rpm[2]))
        share = min(1.0, self._v_rpm / max(speed, 1e-9), self._vc_rpm / max(turn, 1e-9))
        v, theta, vc = wheels_to_command(body_to_wheels(body_rpm * share))
        return round(float(v)), round(float(theta)), round(float(vc))


def _is_custom(drive: DriveParameters) -> bool:
    """Return whether custom effects change what a drive receives, by what is known of the command alone."""
    programs = drive.command_program, drive.set_point_program
    return any(programs) and all(inputs_of(one) <= {"command", "time"} for one in programs)
