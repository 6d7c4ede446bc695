"""Stepping a compiled model through controls, and reading the robot's motion off MuJoCo's states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import mujoco
import mujoco.rollout
import numpy as np

from mecanum_env.effects.apply import measured
from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import ROBOT_CHANNELS, WHEELS
from mecanum_env.model import Model
from mecanum_env.plugin.layout import LOST_VOLTAGE
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

CHANNELS: Final = ROBOT_CHANNELS
"""Columns of a robot log that a simulation predicts."""

_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


class SimulationDivergedError(MecanumError, RuntimeError):
    """The simulated state stopped being finite or plausible, or MuJoCo ran out of memory."""


@dataclass(frozen=True)
class Trajectory:
    """A simulated drive of the robot, one row per physics step; row 0 is the start."""

    mj_model: mujoco.MjModel
    """The compiled model that was simulated."""
    time_s: FloatArray
    """Time [s], shape (n,)."""
    qpos: FloatArray
    """MuJoCo's generalised positions, for rendering, shape (n, nq)."""
    command: FloatArray
    """Commands as sent: V [rpm], theta [deg], VC [rpm], shape (n, 3), or wheel speeds [rpm], shape (n, 4)."""
    wheels_rpm: FloatArray
    """Actual wheel speeds [rpm] in the order fl, fr, rl, rr, shape (n, 4)."""
    twist: FloatArray
    """Velocity in the body frame: vx [m/s], vy [m/s], yaw rate [rad/s], shape (n, 3)."""
    pose: FloatArray
    """Pose in the world frame: x [m], y [m], unwrapped yaw [rad], shape (n, 3)."""
    model: Model | None = None
    """The model whose sensor effects `channels_at` applies; None: perfect sensors."""

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


def step_through(
    mj_model: mujoco.MjModel,
    data: mujoco.MjData,
    ctrl: FloatArray,
    chunk_steps: int = 4800,
    lost_v: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Step `data` through `ctrl` (n, nu) and return qpos (n+1, nq) and qvel (n+1, nv), the start included.

    `data` ends in the last state, plugin state and solver warm start included, so it can be stepped on.
    `chunk_steps`, the steps whose full states are held at once, changes the memory needed, not the result.
    `lost_v` is the voltage that the supply has lost in each step [V], shape (n,); by default it stays that in
    `data.userdata`.

    Raises:
        SimulationDivergedError: the state stopped being finite or plausible, or MuJoCo ran out of memory.
    """
    n, controls, spec = len(ctrl), ctrl, mujoco.mjtState.mjSTATE_CTRL
    if lost_v is not None:
        userdata = np.zeros((n, mj_model.nuserdata))
        userdata[:, LOST_VOLTAGE] = lost_v
        controls, spec = np.concatenate([ctrl, userdata], axis=1), spec | mujoco.mjtState.mjSTATE_USERDATA
    qpos, qvel = np.empty((n + 1, mj_model.nq)), np.empty((n + 1, mj_model.nv))
    qpos[0], qvel[0] = data.qpos, data.qvel
    state = np.empty(mujoco.mj_stateSize(mj_model, _FULL))
    mujoco.mj_getState(mj_model, data, state, _FULL)
    for start in range(0, n, chunk_steps):
        chunk = controls[start : start + chunk_steps]
        # Without the warm start the contact solver would begin anew, and the last digits would differ.
        states, _ = mujoco.rollout.rollout(
            mj_model,
            data,
            state,
            chunk,
            control_spec=int(spec),
            initial_warmstart=data.qacc_warmstart.copy(),
        )
        states = states[0]
        # A full physics state begins with time, qpos, qvel.
        rows = slice(start + 1, start + 1 + len(chunk))
        qpos[rows] = states[:, 1 : 1 + mj_model.nq]
        qvel[rows] = states[:, 1 + mj_model.nq : 1 + mj_model.nq + mj_model.nv]
        _require_plausible(data, state, states)
        state = states[-1]
    mujoco.mj_setState(mj_model, data, state, _FULL)
    return qpos, qvel


def _require_plausible(data: mujoco.MjData, first: FloatArray, later: FloatArray) -> None:
    """Raise if a rollout warned: it stops there and repeats its last state in all remaining rows.

    It went from the `first` state, shape (s,), to the `later` ones, shape (n, s).
    """
    warnings = [
        mujoco.mjtWarning(i).name for i in range(mujoco.mjtWarning.mjNWARNING) if data.warning[i].number
    ]
    # No sum of squares is finite if a state is not, and it takes a tenth of the time of looking at each.
    if not warnings and math.isfinite(np.vdot(first, first) + np.vdot(later, later)):
        return
    states = np.concatenate([first[None, :], later])
    finite = np.all(np.isfinite(states), axis=1)
    if not warnings and finite.all():
        return
    time = states[:, 0]
    last = int(np.argmax(np.append(np.diff(time) <= 0.0, True)))
    if not finite.all():
        last = min(last, max(int(np.argmin(finite)) - 1, 0))
    raise diverged(float(time[last]), ", ".join(warnings))


def diverged(time_s: float, warnings: str = "") -> SimulationDivergedError:
    """Return the error of a simulation that was sane until `time_s`, with MuJoCo's `warnings`, if any."""
    return SimulationDivergedError(
        f"the simulation diverged after {time_s:.3f} s ({warnings or 'not finite'}); "
        "use a shorter timestep or a less stiff servo"
    )


def read_trajectory(
    mj_model: mujoco.MjModel,
    time_s: FloatArray,
    qpos: FloatArray,
    qvel: FloatArray,
    command: FloatArray,
    model: Model | None = None,
) -> Trajectory:
    """Return the drive that MuJoCo's states qpos (n, nq) and qvel (n, nv) at times (n,) describe.

    The robot on rollers and the planar plant are told apart by the base's joints. The command is as sent,
    shape (n, 3) or (n, 4); `Trajectory.channels_at` applies the sensor effects of `model`.
    """
    if mj_model.joint(0).type[0] == mujoco.mjtJoint.mjJNT_FREE:
        # A free joint's linear velocity is in the world frame, its angular velocity in the body frame.
        w, x, y, z = qpos[:, 3:7].T
        yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        pose = np.stack([qpos[:, 0], qpos[:, 1], yaw], axis=-1)
        twist = _in_body_frame(yaw, qvel[:, 0], qvel[:, 1], qvel[:, 5])
        columns = [int(mj_model.joint(f"wheel_{wheel}").dofadr[0]) for wheel in WHEELS]
        wheels = qvel[:, columns] / RAD_S_PER_RPM
    else:
        joints = [mj_model.joint(name) for name in ("base_x", "base_y", "base_yaw")]
        pose = qpos[:, [int(joint.qposadr[0]) for joint in joints]]
        twist = _in_body_frame(pose[:, 2], *(qvel[:, int(joint.dofadr[0])] for joint in joints))
        # The planar plant's wheels turn as its body moves; the gear of the actuators says how.
        gear = np.array([mj_model.actuator(f"wheel_{wheel}").gear[[0, 1, 5]] for wheel in WHEELS])
        wheels = twist @ gear.T / RAD_S_PER_RPM
    return Trajectory(mj_model, time_s, qpos, command, wheels, twist, pose, model)


def _in_body_frame(yaw: FloatArray, vx: FloatArray, vy: FloatArray, rate: FloatArray) -> FloatArray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * vx + sin * vy, cos * vy - sin * vx, rate], axis=-1)
