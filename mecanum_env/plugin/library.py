"""The plugin's library as plain functions: its parameters, and plants without MuJoCo.

These are free wheels on the bench, and the robot without slip.

The calls release Python's lock, so threads run side by side.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.plugin import library_path, require_current
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.parameters import with_programs
from mecanum_env.wheel_drive.program import INPUTS, PROGRAM_SIZE, Program

Counts = npt.NDArray[np.int64]
_WHEELS: Final = 4
_BODY: Final = 23  # numbers of a body


@dataclass(frozen=True, eq=False)
class HeldCommands:
    """Commands of some runs, each held until the next."""

    first: Counts
    """Index of each run's first command, and the number of all commands, shape (runs + 1,)."""
    times_s: FloatArray
    """When each command is given, from the start of its run on [s], increasing within a run."""
    values_rpm: FloatArray
    """The commands [rpm], finite, of the same shape."""
    initial_rpm: FloatArray
    """Each run's steady speed before its start, and its command before the first, shape (runs,)."""
    gap_share: FloatArray
    """Where the motor of each run that starts at rest stands in its backlash, from -1 to 1, shape (runs,)."""

    @staticmethod
    def of(
        runs: Sequence[tuple[FloatArray, FloatArray, float]], gap_share: npt.ArrayLike = 0.0
    ) -> HeldCommands:
        """Return the commands of `runs`, each as times (m,) [s], commands (m,) [rpm], initial speed [rpm].

        `gap_share` is one number or one for each run.
        """
        first = np.cumsum([0, *(len(times) for times, _, _ in runs)], dtype=np.int64)
        times, values, initial = zip(*runs, strict=True)
        return HeldCommands(
            first,
            np.concatenate(times, dtype=float),
            np.concatenate(values, dtype=float),
            np.array(initial, float),
            np.array(np.broadcast_to(gap_share, len(initial)), float),
        )


def free_wheels(
    parameters: FloatArray,
    wheels: FloatArray,
    timestep_s: float,
    commands: HeldCommands,
    steps: Counts,
    lost_v: FloatArray | None = None,
) -> tuple[FloatArray, Counts]:
    """Return the speeds of free wheels on hinges, as MuJoCo's integrator "implicitfast" moves them.

    Args:
        parameters: sets of parameters of the drive, shape (sets, P), in the order of `parameter_names`;
            programs of custom effects may follow them.
        wheels: moment of inertia [kg m^2] and viscous damping [N m s/rad] of each set's wheel, (sets, 2).
        timestep_s: physics step [s].
        commands: what each run is commanded.
        steps: number of physics steps of each run, shape (runs,).
        lost_v: voltage that the supply has lost in each step [V], run after run, shape (sum of steps,); none
            by default.

    Returns:
        Speeds [rpm] at the start and after each step, run after run, shape (sets, sum of steps + 1), and the
        steps that each run took before its state stopped being finite, shape (sets, runs); else all of them.
    """
    sets, runs = len(parameters), len(steps)
    rows, bodies = np.ascontiguousarray(with_programs(parameters)), np.ascontiguousarray(wheels, float)
    counts = np.ascontiguousarray(steps, np.int64)
    if bodies.shape != (sets, 2):
        raise ValueError(f"parameters of shape {rows.shape} and wheels of shape {bodies.shape} do not fit")
    lost = None if lost_v is None else np.ascontiguousarray(lost_v, float)
    if lost is not None and lost.shape != (int(np.sum(counts)),):
        raise ValueError(f"lost voltages of shape {lost.shape}, must be one for each of the steps")
    speeds = np.empty((sets, int(np.sum(counts)) + runs))
    reached = np.empty((sets, runs), np.int64)
    given = (commands.first, commands.times_s, commands.values_rpm, counts)
    starts = (commands.initial_rpm, commands.gap_share)
    arrays = (rows, bodies, *given, *starts, lost, speeds, reached)
    pointers = (None if array is None else array.ctypes.data for array in arrays)
    _library().mecanum_bench(sets, runs, timestep_s, *pointers)
    return speeds, reached


def planar_motion(
    parameters: FloatArray,
    body: FloatArray,
    timestep_s: float,
    ctrl: FloatArray,
    lost_v: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Return how a robot without slip moves from rest at the origin, as MuJoCo's planar plant does.

    Args:
        parameters: those of the drives of its four wheels, shape (4, P), in the order of `parameter_names`;
            programs of custom effects may follow them.
        body: numbers of its body, in the order of `mecanum_env.batch.numbers.BODY`.
        timestep_s: physics step [s].
        ctrl: what the wheels are commanded in each step [rpm], shape (n, 4).
        lost_v: voltage that the supply has lost in each step [V], shape (n,); none by default.

    Returns:
        At the start and after each step, the pose x, y [m], yaw [rad] in the world and the velocity in the
        body's axes (m/s, m/s, rad/s), shape (n + 1, 3) each, and the wheels' speeds [rpm], (n + 1, 4); and
        the steps that were taken before the state stopped being finite, else all of them.
    """
    steps, rows = len(ctrl), np.ascontiguousarray(with_programs(parameters))
    numbers, given = np.ascontiguousarray(body, float), np.ascontiguousarray(ctrl, float)
    lost = None if lost_v is None else np.ascontiguousarray(lost_v, float)
    if rows.shape[0] != _WHEELS or numbers.shape != (_BODY,) or given.shape != (steps, _WHEELS):
        raise ValueError(
            f"parameters of shape {rows.shape}, body {numbers.shape} and ctrl {given.shape} do not fit"
        )
    if lost is not None and lost.shape != (steps,):
        raise ValueError(f"lost voltages of shape {lost.shape}, must be one for each of the steps")
    pose, twist = np.empty((steps + 1, 3)), np.empty((steps + 1, 3))
    speeds = np.empty((steps + 1, _WHEELS))
    arrays = (rows, numbers, given, lost, pose, twist, speeds)
    pointers = (None if array is None else array.ctypes.data for array in arrays)
    return pose, twist, speeds, int(_library().mecanum_planar(steps, timestep_s, *pointers))


def evaluate_program(program: Program, inputs: FloatArray) -> FloatArray:
    """Return the values of a program, shape (n,), as `mecanum_env.wheel_drive.program.evaluate` does.

    `inputs` are in the order of `mecanum_env.wheel_drive.program.INPUTS`, shape (n, 5).
    """
    numbers, given = np.zeros(PROGRAM_SIZE), np.ascontiguousarray(inputs, float)
    if given.ndim != 2 or given.shape[1] != len(INPUTS) or len(program) > PROGRAM_SIZE:
        raise ValueError(f"inputs of shape {given.shape} and {len(program)} instructions do not fit")
    numbers[: len(program)] = program
    values = np.empty(len(given))
    _library().mecanum_evaluate(numbers.ctypes.data, len(given), given.ctypes.data, values.ctypes.data)
    return values


@cache
def parameter_names() -> tuple[str, ...]:
    """Return the names of the drive's parameters in the library's order."""
    found: list[str] = []
    while (name := _library().mecanum_parameter(len(found))) is not None:
        found.append(name.decode())
    return tuple(found)


def refusal(parameters: FloatArray, timestep_s: float) -> str | None:
    """Return why a drive refuses `parameters` (P,) with a physics step [s]; None if it does not."""
    row, message = (
        np.ascontiguousarray(with_programs(np.atleast_2d(parameters))),
        ctypes.create_string_buffer(400),
    )
    refused = _library().mecanum_refuses(row.ctypes.data, timestep_s, message, len(message))
    return message.value.decode() if refused else None


@cache
def _library() -> ctypes.CDLL:
    # The library needs MuJoCo's own, which `import mujoco` has loaded.
    path = library_path(mujoco.mj_versionString())
    require_current(path)
    library = ctypes.CDLL(str(path))
    count, real, array = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
    library.mecanum_bench.argtypes = [count, count, real, *[array] * 11]
    library.mecanum_bench.restype = None
    library.mecanum_planar.argtypes = [count, real, *[array] * 7]
    library.mecanum_planar.restype = count
    library.mecanum_evaluate.argtypes, library.mecanum_evaluate.restype = [array, count, array, array], None
    library.mecanum_parameter.argtypes, library.mecanum_parameter.restype = [count], ctypes.c_char_p
    library.mecanum_refuses.argtypes = [array, real, ctypes.c_char_p, count]
    library.mecanum_refuses.restype = ctypes.c_int32
    return library
