"""Actions of a policy, in [-1, 1]^3, and the commands that the robot takes: V [rpm], theta [deg], VC [rpm].

`TankendoEnv` has the table of the action modes. Commands are rounded as the robot does it: theta to 1 degree,
V and VC to its quantum (1 rpm).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.kinematics import rounded
from mecanum_env.tankendo.numbers import Many, Mathematics, Number
from mecanum_env.units import FloatArray

ActionMode = Literal["cartesian", "polar", "command"]
ACTION_MODES: Final[tuple[ActionMode, ...]] = get_args(ActionMode)
FULL_V_RPM = 135.0
"""V at full action [rpm]: the ceiling of the paper's robot."""
FULL_VC_RPM = 100.0
"""VC at full action [rpm]; this project's choice: 2.1 rad/s for the packaged robot."""

_DEG_PER_RAD, _RAD_PER_DEG = 180.0 / np.pi, np.pi / 180.0


def check_mode(mode: str) -> None:
    """Raise `InputError` unless `mode` is an action mode."""
    require_one_of("action_mode", mode, ACTION_MODES)


def checked_action(action: npt.ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return an action, or the actions of many robots, as an array of the shape that it must have.

    Raises:
        InputError: another shape, or a value that is not a finite number.
    """
    try:
        # Text that spells numbers is text, and of complex numbers NumPy would drop a part.
        given = np.asarray(action)
        if given.dtype.kind not in "fiub":
            raise TypeError(f"they are {given.dtype}")
        array = np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise InputError(f"action must be numbers, an array of shape {shape}: {error}") from error
    if array.shape != shape:
        raise InputError(f"action has shape {array.shape}, must be {shape}")
    # For one robot the sum, which is not finite if one of its numbers is not, takes a tenth of the time.
    sum_is_finite = array.ndim == 1 and isfinite(sum(array.tolist()))
    if not sum_is_finite and not np.isfinite(array).all():
        at = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        index = ", ".join(map(str, at))
        raise InputError(f"action[{index}] = {array[at]}, must be a finite number, -1 .. 1")
    return array


def action_to_command(actions: npt.ArrayLike, mode: ActionMode, quantum_rpm: float = 1.0) -> FloatArray:
    """Return the commands (V rpm, theta deg, VC rpm) of actions, shape (..., 3).

    Args:
        actions: shape (..., 3); values beyond [-1, 1] are clipped.
        mode: how actions are read, see `TankendoEnv`.
        quantum_rpm: V and VC are rounded to multiples of this [rpm]; 0: not rounded.
    """
    given = np.asarray(actions, float)
    command = np.empty(given.shape)
    v, theta, vc = command_numbers(Many(0), [*np.moveaxis(given, -1, 0)], mode, quantum_rpm)
    command[..., 0], command[..., 1], command[..., 2] = v, theta, vc
    return command


def command_numbers(
    math: Mathematics, action: Sequence[Number], mode: ActionMode, quantum_rpm: float
) -> tuple[Number, Number, Number]:
    """Return what `action_to_command` does of the three numbers of an action in a mode, by their `math`."""
    a, b, c = (math.minimum(math.maximum(number, -1.0), 1.0) for number in action)
    if mode == "cartesian":
        v = FULL_V_RPM * math.minimum(math.sqrt(a * a + b * b), 1.0)
        # Adding 0.0 turns -0.0, for which arctan2 returns 180 degrees, into 0.0.
        theta = math.arctan2(b + 0.0, a + 0.0) * _DEG_PER_RAD
    elif mode == "polar":
        v, theta = FULL_V_RPM * 0.5 * (a + 1.0), 180.0 * b
    else:
        v, theta = FULL_V_RPM * a, 180.0 * b
    numbers: tuple[Number, Number, Number] = rounded(math.rint, v, theta, FULL_VC_RPM * c, quantum_rpm)
    return numbers


def command_shares(math: Mathematics, command: Sequence[Number]) -> tuple[Number, Number, Number]:
    """Return a command, V [rpm], theta [deg], VC [rpm], as shares of the full one: forward, left, turn.

    The `math` is that of the command's numbers.
    """
    v, angle = command[0] / FULL_V_RPM, command[1] * _RAD_PER_DEG
    return v * math.cos(angle), v * math.sin(angle), command[2] / FULL_VC_RPM


def command_to_action(command: npt.ArrayLike, mode: ActionMode = "command") -> npt.NDArray[np.float32]:
    """Return the action that asks for a command, shape (..., 3).

    It is exact for whole numbers in the mode "command"; commands beyond full action are clipped.

    Args:
        command: V [rpm], theta [deg], VC [rpm], shape (..., 3); a negative V drives backwards along theta.
        mode: how actions are read, see `TankendoEnv`.
    """
    v, theta, vc = np.moveaxis(np.asarray(command, float), -1, 0)
    turn = vc / FULL_VC_RPM
    if mode == "command":
        first, second = v / FULL_V_RPM, _within_180(theta) / 180.0
    else:
        theta = _within_180(np.where(v < 0.0, theta + 180.0, theta))
        share = np.minimum(np.abs(v) / FULL_V_RPM, 1.0)
        if mode == "polar":
            first, second = 2.0 * share - 1.0, theta / 180.0
        else:
            first, second = share * np.cos(np.deg2rad(theta)), share * np.sin(np.deg2rad(theta))
    return np.asarray(np.clip(np.stack([first, second, turn], axis=-1), -1.0, 1.0), np.float32)


def _within_180(theta: FloatArray) -> FloatArray:
    return np.where(np.abs(theta) <= 180.0, theta, (theta + 180.0) % 360.0 - 180.0)
