"""Stepping a compiled model through a control sequence and keeping every state."""

from __future__ import annotations

import mujoco
import mujoco.rollout
import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.units import FloatArray

_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
_CHUNK_STEPS = 4800  # bounds the memory of the full states, of which only qpos and qvel are kept


class SimulationDivergedError(MecanumError, RuntimeError):
    """MuJoCo warned about the state (not finite, too fast); the message says when."""


def step_through(
    mj_model: mujoco.MjModel, data: mujoco.MjData, ctrl: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Step `data` through controls (n, nu) and return qpos (n+1, nq) and qvel (n+1, nv), the start included.

    `data` ends in the last state, ready to go on: the plugin's state is part of it.

    Raises:
        SimulationDivergedError: the state stopped being finite or plausible.
    """
    n = len(ctrl)
    qpos, qvel = np.empty((n + 1, mj_model.nq)), np.empty((n + 1, mj_model.nv))
    qpos[0], qvel[0] = data.qpos, data.qvel
    state = np.empty(mujoco.mj_stateSize(mj_model, _FULL))
    mujoco.mj_getState(mj_model, data, state, _FULL)
    for start in range(0, n, _CHUNK_STEPS):
        chunk = ctrl[start : start + _CHUNK_STEPS]
        states, _ = mujoco.rollout.rollout(mj_model, data, state, chunk)
        states = states[0]
        # A full physics state begins with time, qpos, qvel.
        rows = slice(start + 1, start + 1 + len(chunk))
        qpos[rows] = states[:, 1 : 1 + mj_model.nq]
        qvel[rows] = states[:, 1 + mj_model.nq : 1 + mj_model.nq + mj_model.nv]
        state = states[-1]
        _require_sound(data, qvel[rows], start, mj_model.opt.timestep)
    mujoco.mj_setState(mj_model, data, state, _FULL)
    return qpos, qvel


def _require_sound(data: mujoco.MjData, qvel: FloatArray, start: int, timestep: float) -> None:
    bad = [
        mujoco.mjtWarning(i).name
        for i in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
        if data.warning[i].number
    ]
    if bad or not np.all(np.isfinite(qvel)):
        raise SimulationDivergedError(
            f"the simulation diverged after {start * timestep:.3f} s ({', '.join(bad) or 'not finite'}); "
            "use a shorter timestep or a less stiff servo"
        )
