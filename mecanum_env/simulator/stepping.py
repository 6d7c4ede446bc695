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
    """MuJoCo warned about the state (not finite, too fast, out of memory); the message says when."""


def step_through(
    mj_model: mujoco.MjModel, data: mujoco.MjData, ctrl: FloatArray, chunk_steps: int = _CHUNK_STEPS
) -> tuple[FloatArray, FloatArray]:
    """Step `data` through controls (n, nu) and return qpos (n+1, nq) and qvel (n+1, nv), the start included.

    `data` ends in the last state, ready to go on: the plugin's state and the solver's warm start are part of
    it.

    Args:
        mj_model: the compiled model.
        data: its data, at the start; written in place.
        ctrl: the controls of each step.
        chunk_steps: steps at a time; changes memory, not the result.

    Raises:
        SimulationDivergedError: the state stopped being finite or plausible, or MuJoCo ran out of memory.
    """
    n = len(ctrl)
    qpos, qvel = np.empty((n + 1, mj_model.nq)), np.empty((n + 1, mj_model.nv))
    qpos[0], qvel[0] = data.qpos, data.qvel
    state = np.empty(mujoco.mj_stateSize(mj_model, _FULL))
    mujoco.mj_getState(mj_model, data, state, _FULL)
    for start in range(0, n, chunk_steps):
        chunk = ctrl[start : start + chunk_steps]
        # Without the warm start a chunk would begin its contact solver anew, and differ in the last digits.
        states, _ = mujoco.rollout.rollout(
            mj_model, data, state, chunk, initial_warmstart=data.qacc_warmstart.copy()
        )
        states = states[0]
        # A full physics state begins with time, qpos, qvel.
        rows = slice(start + 1, start + 1 + len(chunk))
        qpos[rows] = states[:, 1 : 1 + mj_model.nq]
        qvel[rows] = states[:, 1 + mj_model.nq : 1 + mj_model.nq + mj_model.nv]
        _require_sound(data, np.concatenate([state[None, :], states]))
        state = states[-1]
    mujoco.mj_setState(mj_model, data, state, _FULL)
    return qpos, qvel


def _require_sound(data: mujoco.MjData, states: FloatArray) -> None:
    """Raise if a rollout warned: it stops there, and repeats its last state in all remaining rows."""
    warnings = [
        mujoco.mjtWarning(i).name for i in range(mujoco.mjtWarning.mjNWARNING) if data.warning[i].number
    ]
    sound = np.all(np.isfinite(states), axis=1)
    if not warnings and sound.all():
        return
    time = states[:, 0]
    last = int(np.argmax(np.append(np.diff(time) <= 0.0, True)))
    if not sound.all():
        last = min(last, max(int(np.argmin(sound)) - 1, 0))
    raise SimulationDivergedError(
        f"the simulation diverged after {time[last]:.3f} s ({', '.join(warnings) or 'not finite'}); "
        "use a shorter timestep or a less stiff servo"
    )
