"""The bench: one free wheel off the floor, driven by the identified law, replayed in MuJoCo."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mecanum_env.effects.apply import drive_parameters, measured
from mecanum_env.errors import InputError
from mecanum_env.law.drive import simulate_drive
from mecanum_env.mjcf import bench_spec
from mecanum_env.model import Model
from mecanum_env.plugin.layout import set_steady
from mecanum_env.simulator.commands import hold
from mecanum_env.simulator.trajectory import step_through
from mecanum_env.units import RAD_S_PER_RPM, FloatArray


def replay_bench(
    model: Model,
    time_s: FloatArray,
    command_rpm: FloatArray,
    *,
    sample_times_s: FloatArray | None = None,
    initial_rpm: float = 0.0,
    wheel: str | None = None,
    mj_model: mujoco.MjModel | None = None,
) -> FloatArray:
    """Replay a bench log's commands on the free wheel and return its speed [rpm] at the log's samples.

    Unless an effect acts behind the law, the speed is that of the law
    (`mecanum_env.law.drive.simulate_drive`): the servo is fed the wheel's inertia and adds no lag.

    Args:
        model: the wheel to simulate.
        time_s: increasing stamps of the commands, shape (n,); the run starts at the first.
        command_rpm: commanded wheel speed [rpm], shape (n,), held until the next stamp. NaN is a missing
            sample: the previous command holds on, and before the first one `initial_rpm` holds.
        sample_times_s: times on the same clock at which the speed is read, shape (m,); the stamps when None.
        initial_rpm: steady speed [rpm] of the wheel when the run starts.
        wheel: fl, fr, rl or rr to replay that wheel's own law; by default the common one.
        mj_model: `compile_bench` of the same model and wheel, to save compiling.

    The speed, shape (m,), is as measured, and linear between physics steps.

    Raises:
        InputError: arrays of different lengths, stamps that do not increase, times or an initial speed that
            are not finite, samples before the first stamp, or an effect that the bench cannot simulate.
        SimulationDivergedError: the state stopped being finite.
    """
    samples = time_s if sample_times_s is None else sample_times_s
    _check_log(time_s, command_rpm, samples, initial_rpm)
    compiled = compile_bench(model, wheel) if mj_model is None else mj_model
    start = float(time_s[0])
    clock, true = bench_motion(compiled, time_s, command_rpm, float(np.max(samples)) - start, initial_rpm)
    speed = measured(model, clock, {"speed_rpm": true})["speed_rpm"]
    return np.interp(samples - start, clock, speed)


def bench_motion(
    mj_model: mujoco.MjModel,
    time_s: FloatArray,
    command_rpm: FloatArray,
    duration_s: float,
    initial_rpm: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Return the physics clock [s] and the free wheel's true speed [rpm] on it, each of shape (m,).

    `mj_model` is a compiled bench; commands and initial speed are those of `replay_bench`.

    Raises:
        SimulationDivergedError: the state stopped being finite.
    """
    step = mj_model.opt.timestep
    n = max(1, math.ceil(duration_s / step - 1e-9))
    clock = np.arange(n + 1) * step
    ctrl = _held_command(time_s, command_rpm, clock, initial_rpm)
    data = mujoco.MjData(mj_model)
    if initial_rpm != 0.0:
        set_steady(mj_model, data, initial_rpm)
        data.qvel[:] = initial_rpm * RAD_S_PER_RPM
    _, qvel = step_through(mj_model, data, ctrl[:, None])
    return clock, qvel[:, 0] / RAD_S_PER_RPM


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
    held = _held_command(time_s, command_rpm, clock_s, initial_rpm)
    timestep_s = float(clock_s[1] - clock_s[0])
    setpoints = simulate_drive(drive_parameters(model, wheel), held, timestep_s, initial_rpm)
    return np.concatenate([[initial_rpm], setpoints])


def compile_bench(model: Model, wheel: str | None = None, timestep_s: float | None = None) -> mujoco.MjModel:
    """Compile the one-wheel model, without what is only seen.

    The law is that of the wheel fl, fr, rl or rr, by default the common one. `timestep_s` is the upper bound
    of the physics step [s], 1/480 s when None.
    """
    return bench_spec(model, timestep_s, wheel=wheel, visuals=False).compile()


def _held_command(
    time_s: FloatArray, command_rpm: FloatArray, clock_s: FloatArray, initial_rpm: float
) -> FloatArray:
    """Return the command held in each step of the clock; a missing sample leaves the previous one."""
    given = ~np.isnan(command_rpm)
    return hold(time_s[given] - time_s[0], command_rpm[given], clock_s[:-1], before=initial_rpm)


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
