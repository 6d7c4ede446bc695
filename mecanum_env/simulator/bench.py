"""The bench: one free wheel off the floor, driven by the identified law.

The plugin's own loop simulates it. MuJoCo gives the same bits (`mujoco_bench_motion`); it is needed where an
effect of one's own changes the MuJoCo model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from mecanum_env.effects.apply import drive_parameters, measured
from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.simulator.free_wheel import (
    BenchRun,
    BenchRuns,
    FreeWheel,
    held_command,
    mujoco_bench_motion,
    wheel_motions,
)
from mecanum_env.simulator.supply import Supply
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.inputs import simulate_drive


def replay_bench(
    model: Model,
    time_s: FloatArray,
    command_rpm: FloatArray,
    *,
    sample_times_s: FloatArray | None = None,
    initial_rpm: float = 0.0,
    wheel: str | None = None,
    mj_model: mujoco.MjModel | None = None,
    battery_v: FloatArray | None = None,
    gap_share: float = 0.0,
) -> FloatArray:
    """Replay a bench log's commands on the free wheel and return its speed [rpm] at the log's samples.

    Unless an effect acts behind the law, the speed is that of the law
    (`mecanum_env.wheel_drive.inputs.simulate_drive`): the servo is fed the wheel's inertia and adds no lag.

    Args:
        model: the wheel to simulate.
        time_s: increasing stamps of the commands, shape (n,); the run starts at the first.
        command_rpm: commanded wheel speed [rpm], shape (n,), held until the next stamp. NaN is a missing
            sample: the previous command holds on, and before the first one `initial_rpm` holds.
        sample_times_s: times on the same clock at which the speed is read, shape (m,); the stamps when None.
        initial_rpm: steady speed [rpm] of the wheel when the run starts.
        wheel: fl, fr, rl or rr to replay that wheel's own law; by default the common one.
        mj_model: `compile_bench` of the same model and wheel, if MuJoCo itself is to simulate it.
        battery_v: the supply's voltage [V] at the stamps, shape (n,), NaN where a sample is missing; by
            default it stays what it is at the start.
        gap_share: where the motor of a wheel at rest stands in its backlash at the start, from -1 to 1.

    The speed, shape (m,), is as measured, and linear between physics steps.

    Raises:
        InputError: arrays of different lengths, stamps that do not increase, times or an initial speed that
            are not finite, samples before the first stamp, a place outside of the backlash, or an effect that
            the bench cannot simulate.
        SimulationDivergedError: the state stopped being finite.
    """
    samples = time_s if sample_times_s is None else sample_times_s
    _check_log(time_s, command_rpm, samples, initial_rpm)
    start = float(time_s[0])
    duration = float(np.max(samples)) - start
    supply = Supply.logged(time_s - start, battery_v)
    run = BenchRun(time_s, command_rpm, duration, initial_rpm, supply, gap_share)
    if mj_model is None:
        clock, true = bench_motions([model], [run], wheel=wheel)[0][0]
    else:
        clock, true = mujoco_bench_motion(mj_model, run)
    speed = measured(model, clock, {"speed_rpm": true})["speed_rpm"]
    return np.interp(samples - start, clock, speed)


def bench_motion(
    model: Model,
    time_s: FloatArray,
    command_rpm: FloatArray,
    duration_s: float,
    initial_rpm: float = 0.0,
    *,
    wheel: str | None = None,
    timestep_s: float | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the physics clock [s] and the free wheel's true speed [rpm] on it, each of shape (m,).

    Commands, initial speed and `wheel` are those of `replay_bench`, `timestep_s` is that of `compile_bench`.

    Raises:
        InputError: an effect that the bench cannot simulate, or a value out of range.
        SimulationDivergedError: the state stopped being finite.
    """
    run = BenchRun(time_s, command_rpm, duration_s, initial_rpm)
    return bench_motions([model], [run], wheel=wheel, timestep_s=timestep_s)[0][0]


def bench_motions(
    models: Sequence[Model],
    runs: Sequence[BenchRun],
    *,
    wheel: str | None = None,
    timestep_s: float | None = None,
) -> list[list[tuple[FloatArray, FloatArray]]]:
    """Return `bench_motion` of each of the models in each of the runs: one list per model.

    The wheels are simulated in one call, without MuJoCo but as MuJoCo does it, bit for bit. `wheel` and
    `timestep_s` are those of `bench_motion`.

    Raises:
        InputError: as `bench_motion`.
        SimulationDivergedError: the state of any wheel stopped being finite.
    """
    return wheel_motions([FreeWheel.of(model, wheel, timestep_s) for model in models], BenchRuns(runs))


def law_of_bench(
    model: Model,
    time_s: FloatArray,
    command_rpm: FloatArray,
    clock_s: FloatArray,
    initial_rpm: float = 0.0,
    wheel: str | None = None,
) -> FloatArray:
    """Return the wheel speed [rpm] that the law alone gives, without MuJoCo, shape (m,).

    `clock_s` are the times 0, h, 2 h ... since the start, shape (m,); commands, initial speed and `wheel`
    are those of `replay_bench`.
    """
    held = held_command(time_s, command_rpm, clock_s, initial_rpm)
    timestep_s = float(clock_s[1] - clock_s[0])
    setpoints = simulate_drive(drive_parameters(model, wheel), held, timestep_s, initial_rpm)
    return np.concatenate([[initial_rpm], setpoints])


def _check_log(
    time_s: FloatArray, command_rpm: FloatArray, samples_s: FloatArray, initial_rpm: float
) -> None:
    if time_s.ndim != 1 or time_s.shape != command_rpm.shape or time_s.size == 0:
        raise InputError(
            f"time of shape {time_s.shape}, command of shape {command_rpm.shape}; must be one equal length"
        )
    if samples_s.ndim != 1 or samples_s.size == 0:
        raise InputError(f"sample times of shape {samples_s.shape}, must be a row of at least one time")
    if not (np.all(np.isfinite(time_s)) and np.all(np.isfinite(samples_s)) and math.isfinite(initial_rpm)):
        raise InputError("stamps, sample times and the initial speed must be finite numbers throughout")
    if np.any(np.isinf(command_rpm)):
        raise InputError("a command is infinite; must be a number, or nan where a sample is missing")
    if np.any(np.diff(time_s) <= 0.0):
        at = int(np.argmax(np.diff(time_s) <= 0.0)) + 1
        raise InputError(f"stamp {at + 1} is {time_s[at]:g} s, must be later than {time_s[at - 1]:g} s")
    # Stamps that were converted from another unit or clock have rounding errors.
    if float(np.min(samples_s)) < float(time_s[0]) - 1e-9:
        raise InputError(
            f"a sample at {np.min(samples_s):g} s, must not be before the first stamp, {time_s[0]:g} s"
        )
