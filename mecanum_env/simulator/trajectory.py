"""What a simulated drive gives back, and how it is read off MuJoCo's states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import measured
from mecanum_env.kinematics import WHEELS
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

_SPEEDS: Final = tuple(f"speed_{wheel}_rpm" for wheel in WHEELS)
_TWIST: Final = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")
_POSE: Final = ("x_m", "y_m", "yaw_rad")
CHANNELS: Final = (*_SPEEDS, *_TWIST, *_POSE)
"""What a robot log may measure and a simulation gives back, by the names of a log's columns."""


@dataclass(frozen=True)
class Trajectory:
    """A simulated drive of the robot, one row a physics step; row 0 is the start."""

    mj_model: mujoco.MjModel
    """The compiled model that was simulated."""
    time_s: FloatArray
    """(n,)"""
    qpos: FloatArray
    """(n, nq), MuJoCo's generalised positions, for rendering."""
    command: FloatArray
    """(n, 3) for body commands (V rpm, theta deg, VC rpm) or (n, 4) for wheel commands (rpm), as sent."""
    wheels_rpm: FloatArray
    """(n, 4) actual wheel speeds in the order fl, fr, rl, rr."""
    twist: FloatArray
    """(n, 3) body velocity in the body frame: vx [m/s], vy [m/s], yaw rate [rad/s]."""
    pose: FloatArray
    """(n, 3) pose in the world frame: x [m], y [m], yaw [rad], yaw unwrapped."""

    model: Model | None = None
    """Whose sensors `channels_at` reads; without one it shows the motion as it is."""

    def channels_at(self, time_s: FloatArray) -> dict[str, FloatArray]:
        """Return every channel of a robot log as measured, linear between the steps, at times (m,) [s].

        The keys are `CHANNELS`: speed_fl_rpm ... speed_rr_rpm, vx_m_s, vy_m_s, yaw_rate_rad_s, x_m, y_m,
        yaw_rad.
        """
        columns = (*self.wheels_rpm.T, *self.twist.T, *self.pose.T)
        channels = dict(zip(CHANNELS, columns, strict=True))
        if self.model is not None:
            channels = measured(self.model, self.time_s, channels)
        return {name: np.interp(time_s, self.time_s, column) for name, column in channels.items()}


def read_trajectory(
    mj_model: mujoco.MjModel,
    time_s: FloatArray,
    qpos: FloatArray,
    qvel: FloatArray,
    command: FloatArray,
    model: Model | None = None,
) -> Trajectory:
    """Read wheel speeds, body twist and pose off MuJoCo states.

    Args:
        mj_model: the roller robot or the planar plant, told apart by the base's joints.
        time_s: (n,) [s].
        qpos: (n, nq).
        qvel: (n, nv).
        command: (n, 3) or (n, 4), kept as it is.
        model: whose sensors `Trajectory.channels_at` reads.
    """
    if mj_model.joint(0).type[0] == mujoco.mjtJoint.mjJNT_FREE:
        pose, twist = _free_base(qpos, qvel)
        columns = [int(mj_model.joint(f"wheel_{wheel}").dofadr[0]) for wheel in WHEELS]
        wheels = qvel[:, columns] / RAD_S_PER_RPM
    else:
        pose, twist = _planar_base(mj_model, qpos, qvel)
        # The planar plant's wheels turn as its body moves; the actuators' site transmission says how.
        gear = np.array([mj_model.actuator(f"wheel_{wheel}").gear[[0, 1, 5]] for wheel in WHEELS])
        wheels = twist @ gear.T / RAD_S_PER_RPM
    return Trajectory(mj_model, time_s, qpos, command, wheels, twist, pose, model)


def _free_base(qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Read off a free joint, whose linear velocity is in the world frame and whose angular in the body."""
    w, x, y, z = qpos[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    pose = np.stack([qpos[:, 0], qpos[:, 1], yaw], axis=-1)
    return pose, _in_body_frame(yaw, qvel[:, 0], qvel[:, 1], qvel[:, 5])


def _planar_base(
    mj_model: mujoco.MjModel, qpos: FloatArray, qvel: FloatArray
) -> tuple[FloatArray, FloatArray]:
    joints = [mj_model.joint(name) for name in ("base_x", "base_y", "base_yaw")]
    pose = qpos[:, [int(joint.qposadr[0]) for joint in joints]]
    vx, vy, rate = (qvel[:, int(joint.dofadr[0])] for joint in joints)
    return pose, _in_body_frame(pose[:, 2], vx, vy, rate)


def _in_body_frame(yaw: FloatArray, vx: FloatArray, vy: FloatArray, rate: FloatArray) -> FloatArray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * vx + sin * vy, cos * vy - sin * vx, rate], axis=-1)
