"""Free wheels on the bench: what is simulated of a model there, in which runs, and their motion.

The plugin's own loop simulates them, with MuJoCo's bits, and MuJoCo itself where an effect of one's own
changes the MuJoCo model.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeAlias

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import active_effects, changed_drive, changed_model, drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.stability import stability_margins
from mecanum_env.mjcf import bench_spec
from mecanum_env.mjcf.physics import fitting_timestep, wheel_inertia
from mecanum_env.model import Model
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, chain_numbers, drive_numbers, set_steady
from mecanum_env.plugin.library import Counts, HeldCommands, free_wheels, refusal
from mecanum_env.simulator.commands import hold
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import diverged, step_through
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.many import Laws, several
from mecanum_env.wheel_drive.parameters import CHAIN, with_programs

EffectNumbers: TypeAlias = Mapping[str, Mapping[str, FloatArray]]
"""Effect -> parameter -> values of several wheels, shape (m,)."""
_INERTIA: Final = CHAIN.index("inertia_kg_m2")
_BY_RUN: Final = [CHAIN.index(name) for name in ("gap_rad", "gain_per_volt", "supply_per_volt")]
"""Numbers that have a drive depend on where its run starts, or on the supply then."""


@dataclass(frozen=True, eq=False)
class FreeWheel:
    """A wheel on the bench as numbers, or as a MuJoCo model where an effect needs that."""

    timestep_s: float
    parameters: FloatArray
    """In the order of `mecanum_env.wheel_drive.parameters.CHAIN`, shape (P,)."""
    inertia_kg_m2: float
    damping_n_m_s_rad: float
    reads_voltage: bool
    """Whether it depends on the supply's voltage."""
    mj_model: mujoco.MjModel | None = None

    @staticmethod
    def of(model: Model, wheel: str | None = None, timestep_s: float | None = None) -> FreeWheel:
        """Return a model's wheel; `wheel` and `timestep_s` are those of `bench_motion`.

        Raises:
            InputError: an effect that the bench cannot simulate, or a value out of range.
        """
        changed = changed_model(model, "bench")
        step, drive = fitting_timestep(changed, timestep_s), drive_parameters(changed, wheel)
        damping, mj_model = 0.0, None
        for effect, _ in active_effects(changed):
            if effect.damps_joint:
                damping = drive.load.viscous_n_m_s_rad
            elif effect.change_spec is not None and effect.acts_in("bench"):
                mj_model = compile_bench(model, wheel, timestep_s)
        parameters = chain_numbers(changed.robot, drive, NO_TORQUE_LIMIT, wheel_inertia(changed.robot))
        if why := refusal(parameters, step):
            raise InputError(f"the bench: {why}")
        # The drive feeds forward the inertia that it turns, its rotor's included.
        inertia = float(parameters[_INERTIA])
        return FreeWheel(step, parameters, inertia, damping, drive.reads_voltage, mj_model)


@dataclass(frozen=True, eq=False)
class FreeWheels:
    """Several wheels on the bench whose laws and effects differ in their numbers, computed at once."""

    timestep_s: float
    parameters: FloatArray
    """As of a `FreeWheel`, shape (m, P)."""
    possible: npt.NDArray[np.bool_]
    """Which of them can be simulated, shape (m,): they have a stable law, and numbers that a drive takes."""

    @staticmethod
    def of(
        model: Model, laws: FloatArray, effects: EffectNumbers, timestep_s: float | None = None
    ) -> FreeWheels:
        """Return wheels like that of a `model`, with other `laws` (A-F, shape (6, m)) and other `effects`.

        These are given as effect -> parameter -> its values, shape (m,). They act in the drive alone, as
        delays, gains and limits do. `timestep_s` is as for `FreeWheel.of`.

        Raises:
            ValueError: an effect that changes something else or depends on the run, or custom effects.
        """
        if model.custom or not all(CATALOGUE[name].only_in_drive for name in effects):
            raise ValueError(f"{', '.join(effects)}: must all change nothing but the drive")
        robot, own = model.robot, model.wheel.drive_parameters()
        law = Laws(**{**vars(own.law), **dict(zip(COEFFICIENTS, laws, strict=True))})
        # The formulas of one drive take arrays as well.
        given: Mapping[str, Mapping[str, Any]] = effects
        in_order = (CATALOGUE[name] for name in CATALOGUE if name in given)
        acting = tuple((effect, effect.complete(given[effect.name], model)) for effect in in_order)
        drives = changed_drive(several(own, law=law), acting, None)
        chain = drive_numbers(robot, drives, None, NO_TORQUE_LIMIT, wheel_inertia(robot)).chain
        rows = np.empty((laws.shape[1], len(CHAIN)))
        for column, number in zip(rows.T, chain, strict=True):
            column[:] = number
        if np.any(rows[:, _BY_RUN] > 0.0):
            raise ValueError(
                f"{', '.join(effects)}: must act in every run alike, without a gap or the voltage"
            )
        rows = with_programs(rows)
        step = fitting_timestep(model, timestep_s)
        stable = np.all(stability_margins(laws[:3].T) > 0.0, axis=1)
        possible = [bool(safe) and refusal(row, step) is None for safe, row in zip(stable, rows, strict=True)]
        return FreeWheels(step, rows, np.array(possible))

    def motions(self, runs: BenchRuns) -> Iterator[list[tuple[FloatArray, FloatArray]] | None]:
        """Yield the motion of each wheel in all `runs`, as `wheel_motions` returns it.

        It is None of one that cannot be simulated, or whose state stops being finite.
        """
        clocks = runs.clocks(self.timestep_s)
        rows = self.parameters[self.possible]
        bodies = np.stack([rows[:, _INERTIA], np.zeros(len(rows))], axis=1)
        found = free_wheels(rows, bodies, self.timestep_s, runs.commands, clocks.steps, clocks.lost_v)
        finite = np.array(self.possible)
        finite[finite] = np.all(found[1] >= clocks.steps, axis=1)
        row_of = np.cumsum(self.possible) - 1
        for row, moves in zip(row_of, finite, strict=True):
            yield clocks.split(found[0][row]) if moves else None


def compile_bench(model: Model, wheel: str | None = None, timestep_s: float | None = None) -> mujoco.MjModel:
    """Compile the one-wheel model, without what is only seen.

    The law is that of the wheel fl, fr, rl or rr, by default the common one. `timestep_s` is the upper bound
    of the physics step [s], 1/480 s when None.
    """
    return bench_spec(model, timestep_s, wheel=wheel, visuals=False).compile()


@dataclass(frozen=True, eq=False)
class BenchRun:
    """Commands to replay on the bench, as for `bench_motion`.

    Raises:
        InputError: a place in the backlash that lies outside of it.
    """

    time_s: FloatArray
    command_rpm: FloatArray
    duration_s: float
    initial_rpm: float = 0.0
    supply: Supply | None = None
    """The supply's voltage; None: it stays what it is at the start."""
    gap_share: float = 0.0
    """Where the motor of a wheel at rest stands in its backlash when the run starts, from -1 to 1."""

    def __post_init__(self) -> None:
        if not -1.0 <= self.gap_share <= 1.0:
            raise InputError(f"gap_share = {self.gap_share:g}, must be from -1 to 1")

    @cached_property
    def given(self) -> tuple[FloatArray, FloatArray, float]:
        """Commands that are no missing samples: times since the start [s], commands, initial speed [rpm]."""
        given = ~np.isnan(self.command_rpm)
        return self.time_s[given] - self.time_s[0], self.command_rpm[given], self.initial_rpm


class BenchRuns:
    """Runs that are simulated together, as often as there are models; what they share is made once."""

    def __init__(self, runs: Sequence[BenchRun]) -> None:
        self.runs = tuple(runs)
        self.commands = HeldCommands.of([run.given for run in runs], [run.gap_share for run in runs])
        self._clocks: dict[float, _Clocks] = {}

    def clocks(self, timestep_s: float) -> _Clocks:
        """Return the physics steps of all runs with a step [s]."""
        if timestep_s not in self._clocks:
            self._clocks[timestep_s] = _Clocks.of(self.runs, timestep_s)
        return self._clocks[timestep_s]


@dataclass(frozen=True, eq=False)
class _Clocks:
    """The physics steps of runs that are simulated together."""

    steps: Counts
    """Number of steps of each run, shape (runs,)."""
    times_s: tuple[FloatArray, ...]
    """Times of each run [s], one more than it has steps."""
    parts: tuple[slice, ...]
    """Where the times of each run are if they stand one behind the other."""
    lost_v: FloatArray | None
    """What the supplies have lost in each step, run after run [V]; None if nothing."""

    def split(self, speeds_rpm: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return times [s] and speeds [rpm] of each run, given those of all, one run behind the other."""
        return [(time, speeds_rpm[part]) for time, part in zip(self.times_s, self.parts, strict=True)]

    @staticmethod
    def of(runs: Sequence[BenchRun], timestep_s: float) -> _Clocks:
        steps = np.array([_steps(run.duration_s, timestep_s) for run in runs])
        longest: FloatArray = timestep_s * np.arange(int(np.max(steps)) + 1, dtype=np.float64)
        times = tuple(longest[: count + 1] for count in steps)
        lost = _lost_voltages(runs, [one[:-1] for one in times])
        ends = np.cumsum([0, *steps + 1]).tolist()
        return _Clocks(steps, times, tuple(map(slice, ends[:-1], ends[1:])), lost)


def wheel_motions(wheels: Sequence[FreeWheel], runs: BenchRuns) -> list[list[tuple[FloatArray, FloatArray]]]:
    """Return what `bench_motions` does, of free wheels instead of their models.

    Raises:
        SimulationDivergedError: the state of any wheel stopped being finite.
    """
    found: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    alike: dict[float, list[int]] = {}
    for index, one in enumerate(wheels):
        if one.mj_model is None:
            alike.setdefault(one.timestep_s, []).append(index)
        else:
            found[index] = [mujoco_bench_motion(one.mj_model, run) for run in runs.runs]
    for step, members in alike.items():
        clocks = runs.clocks(step)
        speeds, reached = free_wheels(
            np.stack([wheels[i].parameters for i in members]),
            np.array([(wheels[i].inertia_kg_m2, wheels[i].damping_n_m_s_rad) for i in members]),
            step,
            runs.commands,
            clocks.steps,
            clocks.lost_v,
        )
        if np.any(reached < clocks.steps):
            raise diverged(float(np.min(reached[reached < clocks.steps])) * step)
        for i, row in zip(members, speeds, strict=True):
            found[i] = clocks.split(row)
    return [found[index] for index in range(len(wheels))]


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
    ctrl = held_command(run.time_s, run.command_rpm, clock, run.initial_rpm)
    data = mujoco.MjData(mj_model)
    if run.initial_rpm != 0.0 or run.gap_share != 0.0:
        set_steady(mj_model, data, run.initial_rpm, run.gap_share)
        data.qvel[:] = run.initial_rpm * RAD_S_PER_RPM
    lost = None if run.supply is None else run.supply.lost_at(clock[:-1])
    _, qvel = step_through(mj_model, data, ctrl[:, None], lost_v=lost)
    return clock, qvel[:, 0] / RAD_S_PER_RPM


def _steps(duration_s: float, timestep_s: float) -> int:
    return max(1, math.ceil(duration_s / timestep_s - 1e-9))


def held_command(
    time_s: FloatArray, command_rpm: FloatArray, clock_s: FloatArray, initial_rpm: float
) -> FloatArray:
    """Return the command held in each step of the clock; a missing sample leaves the previous one."""
    given = ~np.isnan(command_rpm)
    return hold(time_s[given] - time_s[0], command_rpm[given], clock_s[:-1], before=initial_rpm)
