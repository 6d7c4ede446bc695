"""From the commands V, theta, VC that a user sends to the set-points of the four drives."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.drives.set_point import followed, received
from sysid.studies.zoo.robots.robot import Robot

_MIXING: Final = np.array([[1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0]])
"""Rows fl, fr, rl, rr; columns forward, left, turn: rollers in an X seen from above."""


def wheel_set_points(
    robot: Robot, commands: FloatArray, ticks_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return what the speed loops follow at their ticks, shape (4, n), in rad/s.

    The link carries V [rpm], theta [deg] and VC [rpm], rows of `commands`, shape (m, 3), one every
    `drive.link.period_s`; all four wheels share its luck. The platform's computer limits them and turns them
    into wheel commands, and each drive treats its own by its set-point's path.
    """
    changed = np.any(np.diff(commands, axis=0, prepend=np.full((1, 3), np.nan)) != 0.0, axis=1)
    number = np.cumsum(changed)  # of the change that a message belongs to; the link moves whole changes
    known = received(robot.drive.link, number.astype(float), ticks_s, rng).astype(np.intp)
    body = np.vstack([np.zeros((1, 3)), body_rpm(commands[changed])])[known]
    path = robot.path
    limited = _limited(
        body,
        1.0 / robot.drive.controller.loop_hz,
        np.array([path.v_limit_rpm, path.vc_limit_rpm]),
        np.array([path.v_ramp_rpm_s, path.vc_ramp_rpm_s]),
    )
    control = robot.drive.controller
    drives = [
        replace(robot.drive, controller=replace(control, gain=gain * control.gain))
        for gain in robot.wheel_gains
    ]
    wheels = (limited @ _MIXING.T).T
    return np.stack([followed(drive, wheel, ticks_s) for drive, wheel in zip(drives, wheels, strict=True)])


def body_rpm(commands: FloatArray) -> FloatArray:
    """Return forward, left and turn in rpm of `commands` V [rpm], theta [deg], VC [rpm], both (m, 3)."""
    v, theta, vc = commands[:, 0], np.radians(commands[:, 1]), commands[:, 2]
    return np.column_stack([v * np.cos(theta), v * np.sin(theta), vc])


@compiled
def _limited(body: FloatArray, tick_s: float, limits_rpm: FloatArray, ramps_rpm_s: FloatArray) -> FloatArray:
    """Limit the speed (as a vector) and the turn of (forward, left, turn), shape (n, 3), and ramp both."""
    shown = np.empty_like(body)
    value = np.zeros(3)
    for n in range(len(body)):
        size = np.hypot(body[n, 0], body[n, 1])
        share = min(1.0, limits_rpm[0] / size) if size > 0.0 else 1.0
        away_x, away_y = share * body[n, 0] - value[0], share * body[n, 1] - value[1]
        away_turn = min(max(body[n, 2], -limits_rpm[1]), limits_rpm[1]) - value[2]
        away = np.hypot(away_x, away_y)
        share = min(1.0, ramps_rpm_s[0] * tick_s / away) if away > 0.0 else 1.0
        value[0] += share * away_x
        value[1] += share * away_y
        most = ramps_rpm_s[1] * tick_s
        value[2] += min(max(away_turn, -most), most)
        shown[n] = value
    return shown
