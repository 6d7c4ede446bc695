"""Free wheels on a bench: the reference for the library's loop (mecanum_env/plugin/bench.c)."""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.chain import DriveState, begin
from mecanum_env.wheel_drive.parameters import by_name
from mecanum_env.wheel_drive.servo import end, torques

_LARGEST: Final = 1e10
"""Speeds and accelerations beyond this have diverged, as for MuJoCo."""


def free_wheel_speeds(
    parameters: FloatArray,
    wheels: FloatArray,
    timestep_s: float,
    command_rpm: FloatArray,
    initial_rpm: FloatArray,
    lost_v: FloatArray | None = None,
    gap_share: FloatArray | float = 0.0,
) -> FloatArray:
    """Return the speeds of free wheels [rpm], at the start and after each substep, shape (sets, runs, n + 1).

    The wheels move as MuJoCo's integrator "implicitfast" moves a hinge; speeds are NaN once they diverge.

    Args:
        parameters: of the drives, in the order of `mecanum_env.wheel_drive.parameters.CHAIN`, shape
            (sets, P); programs may follow them.
        wheels: moment of inertia [kg m^2] and viscous damping [N m s/rad] of each wheel, shape (sets, 2).
        timestep_s: the substep [s].
        command_rpm: command in each substep [rpm], shape (runs, n).
        initial_rpm: steady speed before the start [rpm], shape (runs,).
        lost_v: voltage that the supply has lost in each substep [V], shape (runs, n); none by default.
        gap_share: where motors at rest stand in their backlash at the start, from -1 to 1, shape (runs,).
    """
    p, h = by_name(parameters), timestep_s
    inertia, damping = np.asarray(wheels, float).T[:, :, None]
    # The inverse of the inertia that an implicit step moves.
    mobility = 1 / (inertia + h * (p["servo_n_m_s_rad"] + damping))
    s = DriveState.steady(p, np.asarray(initial_rpm, float), gap_share)
    speed = np.broadcast_to(initial_rpm * RAD_S_PER_RPM, s.w0.shape)
    speeds = np.empty((*speed.shape, command_rpm.shape[1] + 1))
    speeds[..., 0] = speed / RAD_S_PER_RPM
    lost = np.zeros(command_rpm.shape) if lost_v is None else lost_v
    for n, (command, below) in enumerate(zip(command_rpm.T, lost.T, strict=True)):
        begin(s, p, command, h, speed, below)
        acted = torques(s, p, speed, h, below)
        torque = acted.reported - damping * speed
        after = speed + h * (torque * mobility)
        sane = (np.abs(torque / inertia) <= _LARGEST) & (np.abs(after) <= _LARGEST)
        after = np.where(sane, after, np.nan)
        end(s, p, acted, speed, after, h)
        speed = after
        speeds[..., n + 1] = speed / RAD_S_PER_RPM
    return speeds
