"""Setting and reading what a wheel drive remembers, which is part of MuJoCo's state (`plugin_state`).

`mujoco.mj_resetData` and keyframes put every drive at rest. `mjSTATE_FULLPHYSICS` saves and restores it.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.plugin.layout import COMMANDS, GAP, STATE, state_slice, wheel_actuators
from mecanum_env.units import RAD_S_PER_RPM, FloatArray


def set_steady(mjmodel: mujoco.MjModel, data: mujoco.MjData, speeds_rpm: npt.ArrayLike) -> None:
    """Put every wheel drive in steady motion, as if it had followed a constant command for long.

    The clocks start anew: the next substep latches a command and ticks the law. The integral of the servo is
    emptied. Joint speeds are not touched; set `data.qvel` to match.

    Args:
        mjmodel: the compiled model.
        data: its data, written in place.
        speeds_rpm: one speed [rpm] for all wheel drives, or one each in the order of the actuators.

    Raises:
        InputError: a number of speeds that does not fit, or a speed that is not finite.
    """
    actuators = wheel_actuators(mjmodel)
    speeds = np.asarray(speeds_rpm, float)
    if speeds.shape not in ((), (len(actuators),)):
        raise InputError(f"speeds of shape {speeds.shape}, must be one or {len(actuators)} numbers")
    if not np.all(np.isfinite(speeds)):
        raise InputError(f"speeds {speeds.tolist()} rpm, must be finite numbers")
    for actuator, speed in zip(actuators, np.broadcast_to(speeds, (len(actuators),)), strict=True):
        state = data.plugin_state[state_slice(mjmodel, actuator)]
        state[:] = 0.0
        for name in ("w0", "w1", "w2", "r1", "r2", "ramp"):
            state[STATE.index(name)] = speed
        state[STATE.index("setpoint")] = speed * RAD_S_PER_RPM
        state[COMMANDS] = speed
        if mjmodel.nuser_actuator > GAP:
            # What turns has closed its backlash.
            state[STATE.index("gap")] = np.sign(speed) * mjmodel.actuator_user[actuator, GAP] / 2


def drive_state(mjmodel: mujoco.MjModel, data: mujoco.MjData) -> dict[str, FloatArray]:
    """Return the drives' state by name, each of shape (n_wheels,); the names are `layout.STATE`."""
    starts = [state_slice(mjmodel, actuator).start for actuator in wheel_actuators(mjmodel)]
    return {name: data.plugin_state[np.array(starts) + i] for i, name in enumerate(STATE)}
