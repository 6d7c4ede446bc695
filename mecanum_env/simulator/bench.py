"""The bench: one free wheel, driven by the identified law, replayed in MuJoCo."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mecanum_env.mjcf import bench_spec
from mecanum_env.model import Model
from mecanum_env.plugin.state import set_steady
from mecanum_env.simulator.commands import hold
from mecanum_env.simulator.stepping import step_through
from mecanum_env.units import RAD_S_PER_RPM, FloatArray


def replay_bench(
    model: Model,
    time_s: FloatArray,
    command_rpm: FloatArray,
    *,
    sample_times_s: FloatArray | None = None,
    initial_rpm: float = 0.0,
    mj_model: mujoco.MjModel | None = None,
) -> FloatArray:
    """Replay a bench log's commands on the free wheel and return its speed [rpm] at the log's samples.

    Args:
        model: the wheel to simulate.
        time_s: (n,) stamps [s] of the commands, increasing; the run starts at the first.
        command_rpm: (n,) commanded wheel speed [rpm], held until the next stamp.
        sample_times_s: (m,) times [s] at which the speed is read; the command stamps when None.
        initial_rpm: speed [rpm] at which the wheel turns steadily when the run starts.
        mj_model: a compiled bench of the same model, to save compiling.

    Returns:
        (m,) simulated wheel speed [rpm], linear between physics steps.
    """
    compiled = compile_bench(model) if mj_model is None else mj_model
    samples = time_s if sample_times_s is None else sample_times_s
    step = compiled.opt.timestep
    start = float(time_s[0])
    n = max(1, math.ceil((float(np.max(samples)) - start) / step - 1e-9))
    clock = np.arange(n + 1) * step
    ctrl = hold(time_s - start, command_rpm, clock[:-1])
    data = mujoco.MjData(compiled)
    if initial_rpm != 0.0:
        set_steady(compiled, data, np.array([initial_rpm]))
        data.qvel[:] = initial_rpm * RAD_S_PER_RPM
    _, qvel = step_through(compiled, data, ctrl[:, None])
    return np.interp(samples - start, clock, qvel[:, 0] / RAD_S_PER_RPM)


def compile_bench(model: Model) -> mujoco.MjModel:
    """Compile the one-wheel model."""
    return bench_spec(model).compile()


def servo_lag(model: Model, wheel_inertia_kg_m2: float) -> float:
    """Return the time constant [s] that the servo adds on a free wheel: inertia over stiffness."""
    return wheel_inertia_kg_m2 / model.robot.servo_n_m_s_rad


