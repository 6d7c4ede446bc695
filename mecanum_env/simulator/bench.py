"""The bench: one free wheel off the floor, driven by the identified law.

The plugin's own loop simulates it. MuJoCo gives the same bits (`mujoco_bench_motion`); it is needed where an
effect of one's own changes the MuJoCo model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import active_effects, changed_model, drive_parameters, measured
from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec
from mecanum_env.mjcf.physics import fitting_timestep, wheel_inertia
from mecanum_env.model import Model
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, chain_parameters, set_steady
from mecanum_env.plugin.library import HeldCommands, free_wheels, refusal
from mecanum_env.simulator.commands import hold
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import diverged, step_through
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.inputs import simulate_drive
from mecanum_env.wheel_drive.parameters import CHAIN

_INERTIA: Final = CHAIN.index("inertia_kg_m2")


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

    The speed, shape (m,), is as measured, and linear between physics steps.

    Raises:
        InputError: arrays of different lengths, stamps that do not increase, times or an initial speed that
            are not finite, samples before the first stamp, or an effect that the bench cannot simulate.
        SimulationDivergedError: the state stopped being finite.
    """
    samples = time_s if sample_times_s is None else sample_times_s
    _check_log(time_s, command_rpm, samples, initial_rpm)
    start = float(time_s[0])
    duration = float(np.max(samples)) - start
    run = BenchRun(time_s, command_rpm, duration, initial_rpm, Supply.logged(time_s - start, battery_v))
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


@dataclass(frozen=True, eq=False)
class BenchRun:
    """Commands to replay on the bench, as for `bench_motion`."""

    time_s: FloatArray
    command_rpm: FloatArray
    duration_s: float
    initial_rpm: float = 0.0
    supply: Supply | None = None
    """The supply's voltage; None: it stays what it is at the start."""

    @cached_property
    def given(self) -> tuple[FloatArray, FloatArray, float]:
        """Commands that are no missing samples: times since the start [s], commands, initial speed [rpm]."""
        given = ~np.isnan(self.command_rpm)
        return self.time_s[given] - self.time_s[0], self.command_rpm[given], self.initial_rpm


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
    found: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    alike: dict[float, list[int]] = {}
    wheels = [_free_wheel(model, wheel, timestep_s) for model in models]
    for index, one in enumerate(wheels):
        if one.mj_model is None:
            alike.setdefault(one.timestep_s, []).append(index)
        else:
            found[index] = [mujoco_bench_motion(one.mj_model, run) for run in runs]
    for step, members in alike.items():
        steps = np.array([_steps(run.duration_s, step) for run in runs])
        clock: FloatArray = step * np.arange(int(np.max(steps)) + 1, dtype=np.float64)
        speeds, reached = free_wheels(
            np.stack([wheels[i].parameters for i in members]),
            np.array([(wheels[i].inertia_kg_m2, wheels[i].damping_n_m_s_rad) for i in members]),
            step,
            HeldCommands.of([run.given for run in runs]),
            steps,
            _lost_voltages(runs, [clock[:n] for n in steps]),
        )
        if np.any(reached < steps):
            raise diverged(float(np.min(reached[reached < steps])) * step)
        ends = np.cumsum(steps + 1)
        for i, row in zip(members, speeds, strict=True):
            parts = np.split(row, ends[:-1])
            found[i] = [(clock[: part.size], part) for part in parts]
    return [found[index] for index in range(len(models))]


def _lost_voltages(runs: Sequence[BenchRun], clocks_s: Sequence[FloatArray]) -> FloatArray | None:
    """Return what the supplies of runs have lost at times (n,) of each, run after run; None if nothing."""
    if all(run.supply is None for run in runs):
        return None
    parts = (
        np.zeros(clock.size) if run.supply is None else run.supply.lost_at(clock)
        for run, clock in zip(runs, clocks_s, strict=True)
    )
    return np.concatenate(list(parts))


def mujoco_bench_motion(mj_model: mujoco.MjModel, run: BenchRun) -> tuple[FloatArray, FloatArray]:
    """Return what `bench_motion` does in a run, simulated by MuJoCo on a compiled bench `mj_model`.

    Raises:
        SimulationDivergedError: the state stopped being finite.
    """
    step = mj_model.opt.timestep
    clock = np.arange(_steps(run.duration_s, step) + 1) * step
    ctrl = _held_command(run.time_s, run.command_rpm, clock, run.initial_rpm)
    data = mujoco.MjData(mj_model)
    if run.initial_rpm != 0.0:
        set_steady(mj_model, data, run.initial_rpm)
        data.qvel[:] = run.initial_rpm * RAD_S_PER_RPM
    lost = None if run.supply is None else run.supply.lost_at(clock[:-1])
    _, qvel = step_through(mj_model, data, ctrl[:, None], lost_v=lost)
    return clock, qvel[:, 0] / RAD_S_PER_RPM


@dataclass(frozen=True, eq=False)
class _FreeWheel:
    """A wheel on the bench as numbers, or as a MuJoCo model where an effect needs that."""

    timestep_s: float
    parameters: FloatArray
    """In the order of `mecanum_env.wheel_drive.parameters.CHAIN`, shape (P,)."""
    inertia_kg_m2: float
    damping_n_m_s_rad: float
    mj_model: mujoco.MjModel | None = None


def _free_wheel(model: Model, wheel: str | None, timestep_s: float | None) -> _FreeWheel:
    changed = changed_model(model, "bench")
    step, damping, mj_model = fitting_timestep(changed, timestep_s), 0.0, None
    for effect, values in active_effects(changed):
        if effect.change_spec is not None and effect.acts_in("bench"):
            if effect.load is None:
                mj_model = compile_bench(model, wheel, timestep_s)
            else:
                damping += effect.load(values).damping_n_m_s_rad
    inertia = wheel_inertia(changed.robot)
    parameters = chain_parameters(changed, wheel, NO_TORQUE_LIMIT, inertia)
    if why := refusal(parameters, step):
        raise InputError(f"the bench: {why}")
    # The drive feeds forward the inertia that it turns, its rotor's included.
    return _FreeWheel(step, parameters, float(parameters[_INERTIA]), damping, mj_model)


def _steps(duration_s: float, timestep_s: float) -> int:
    return max(1, math.ceil(duration_s / timestep_s - 1e-9))


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
