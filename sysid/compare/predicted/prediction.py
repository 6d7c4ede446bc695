"""What a model predicts for a log: its commands simulated, sampled at the times of the log."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeVar

import mujoco
import numpy as np

from mecanum_env.effects.apply import Sensors, drive_parameters, in_turned_axes, sensors_of, without_sensors
from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.kinematics import POSE
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.parallel import map_in_threads
from mecanum_env.simulator import (
    BodyCommands,
    Commands,
    RobotPlant,
    WheelCommands,
    compile_plant,
    drive,
)
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, FreeWheel
from mecanum_env.simulator.robot import standing
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start, start_of
from sysid.compare.predicted.gap_start import SeenSpeed, motions_from_gap, starts_in_gap
from sysid.compare.predicted.motion import Motion, bench_motions_of
from sysid.logs import BodyCommand, Run

_LEAD_S: Final = 1.5
"""Time for which a robot that moves when its log starts is assumed to have had its first command [s]."""

T = TypeVar("T")
U = TypeVar("U")


@dataclass(frozen=True)
class SimulationSettings:
    """How models are simulated throughout a study: search, held-out comparison, design of experiments."""

    plant: RobotPlant = "rollers"
    """How a robot is simulated; the bench has one plant only."""
    jobs: int = 1
    """Simulations that run at the same time; results do not depend on it."""
    timestep_s: float | None = None
    """Upper bound of the physics step [s]; None: the choice of the MJCF generator."""
    seed: int = 0
    """Seed of simulated thresholds, of the bootstrap and of the design of experiments."""
    scale: Scale = REFERENCE
    """What the ranges of a search are in proportion to, from `sysid.compare.search_space.scale`."""

    def map(self, work: Callable[[T], U], items: Iterable[T]) -> list[U]:
        """Return `work` of each of the `items`, in order, `jobs` at a time."""
        return map_in_threads(work, items, self.jobs)


def compile_robot(model: Model, settings: SimulationSettings) -> mujoco.MjModel:
    """Compile the robot that `motion_of` simulates, without visuals and without computing its sensors.

    If the settings give no time step, the planar plant takes `TRAINING_TIMESTEP_S`, accurate enough there.

    Raises:
        InputError: an effect that the plant cannot simulate.
    """
    plant, timestep_s = settings.plant, settings.timestep_s
    if plant == "planar" and timestep_s is None:
        timestep_s = TRAINING_TIMESTEP_S
    compiled = compile_plant(model, plant, timestep_s, visuals=False)
    # The motion is read off positions and velocities; the accelerometer alone takes a sixth of a step.
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    return compiled


def in_run_frame(model: Model, start: Start) -> Model:
    """Return the model with a sloping floor's heading relative to the initial yaw."""
    return in_turned_axes(model, start.yaw_rad)


def predict(
    model: Model, run: Run, start: Start | None = None, settings: SimulationSettings = SimulationSettings()
) -> dict[str, FloatArray]:
    """Return what a model predicts for a run: channel -> values at the run's rows, each of shape (n,).

    A robot's predicted pose starts at the measured one, and the motor of a gear with backlash where the run
    shows it to start. The default start is `start_of` the run.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    return predict_all(model, [run], None if start is None else [start], settings)[0]


def predict_all(
    model: Model,
    runs: Sequence[Run],
    starts: Sequence[Start] | None = None,
    settings: SimulationSettings = SimulationSettings(),
) -> list[dict[str, FloatArray]]:
    """Return what a model predicts for each of the `runs`, as `predict` does; repeats are simulated once.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    begun = [start_of(run) for run in runs] if starts is None else starts
    sensors, pairs = sensors_of(model), list(zip(runs, begun, strict=True))
    motions = _motions_of(without_sensors(model), pairs, settings, sensors)
    return [
        readings(motion.seen_by(sensors), run, start)
        for motion, (run, start) in zip(motions, pairs, strict=True)
    ]


def motion_of(
    model: Model, run: Run, start: Start, settings: SimulationSettings = SimulationSettings()
) -> Motion:
    """Return the true motion in a run of a model that has no effects of sensors.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    return _motions_of(model, [(run, start)], settings, sensors_of(model))[0]


def _motions_of(
    model: Model, runs: Sequence[tuple[Run, Start]], settings: SimulationSettings, sensors: Sensors
) -> list[Motion]:
    if runs[0][0].level == "bench":
        period, wheel = model.wheel.command_period_s, FreeWheel.of(model, timestep_s=settings.timestep_s)
        asked = [bench_run(run, start, period, supply_of(run)) for run, start in runs]
        if starts_in_gap(wheel):
            return motions_from_gap(wheel, asked, [SeenSpeed.of([run]) for run, _ in runs], sensors)
        return bench_motions_of(wheel, BenchRuns(asked))
    by_voltage = follows_voltage(model)
    robots: dict[float, CompiledRobot] = {}
    motions: dict[Hashable, Motion] = {}
    found = []
    for run, start in runs:
        local = in_run_frame(model, start)
        heading = 0.0 if local is model else start.yaw_rad
        columns = (run.time_s, *run.command.columns().values())
        voltage = run.file if by_voltage and supply_of(run) else ""
        key = heading, start.moving, voltage, *(values.tobytes() for values in columns)
        if key not in motions:
            if heading not in robots:
                robots[heading] = CompiledRobot(local, settings)
            motions[key] = robots[heading].motion(run, start)
        found.append(motions[key])
    return found


def follows_voltage(model: Model) -> bool:
    """Return whether the motion of a model depends on the supply's voltage."""
    return drive_parameters(model).reads_voltage


def supply_of(run: Run) -> Supply | None:
    """Return the supply's voltage in a run; None if it was not logged."""
    return Supply.logged(run.time_s, run.channels.get("battery_v"), run.full_v)


def bench_run(run: Run, start: Start, command_period_s: float, supply: Supply | None = None) -> BenchRun:
    """Return a bench log's commands as a drive may have held them, see `Run.held_since`.

    The drive has the `supply`, by default a constant one.
    """
    since = run.held_since(command_period_s)
    return BenchRun(since, run.command.wheels_rpm[:, 0], run.duration_s, start.initial_rpm, supply)


class CompiledRobot:
    """A robot that is `in_run_frame`, compiled once to be driven through several runs, one after another."""

    def __init__(self, model: Model, settings: SimulationSettings) -> None:
        self._model, self._compiled = model, compile_robot(model, settings)
        self._data = mujoco.MjData(self._compiled)
        self._stances: dict[tuple[float, ...], FloatArray] = {}

    @cached_property
    def _follows_voltage(self) -> bool:
        return follows_voltage(self._model)

    def motion(self, run: Run, start: Start, wheel_angles_rad: tuple[float, ...] = ()) -> Motion:
        """Return `motion_of` the robot in a run that it starts with wheels at some angles [rad], 0 if none.

        Raises:
            SimulationDivergedError: the state stopped being finite.
        """
        if wheel_angles_rad not in self._stances:
            self._stances[wheel_angles_rad] = standing(self._compiled, wheel_angles_rad)
        lead = _LEAD_S if start.moving else 0.0
        supply = supply_of(run)
        path = drive(
            self._model,
            commands_of(run, self._model.wheel.command_period_s, lead),
            run.duration_s + lead,
            mj_model=self._compiled,
            stance=self._stances[wheel_angles_rad],
            supply=supply.later(lead) if supply is not None and self._follows_voltage else None,
            data=self._data,
        )
        columns = (*path.wheels_rpm.T, *path.twist.T, *path.pose.T)
        return Motion(path.time_s, dict(zip(CHANNELS, columns, strict=True)), lead)


def readings(motion: Motion, run: Run, start: Start) -> dict[str, FloatArray]:
    """Return a motion, as its sensors see it, at a run's rows: channel -> values, shape (n,)."""
    clock, channels = motion.time_s, motion.channels
    at = {name: np.interp(run.time_s + motion.lead_s, clock, values) for name, values in channels.items()}
    if run.level == "bench":
        return at
    begin = {name: float(np.interp(motion.lead_s, clock, channels[name])) for name in POSE}
    x, y, yaw = (at[name] - (begin[name] if motion.lead_s else 0.0) for name in POSE)
    turn = start.yaw_rad - (begin["yaw_rad"] if motion.lead_s else 0.0)
    at["x_m"] = start.x_m + math.cos(turn) * x - math.sin(turn) * y
    at["y_m"] = start.y_m + math.sin(turn) * x + math.cos(turn) * y
    at["yaw_rad"] = start.yaw_rad + yaw
    return {name: at[name] for name in CHANNELS if name in run.channels}


def commands_of(run: Run, command_period_s: float, lead_s: float = 0.0) -> Commands:
    """Return a robot log's commands, without rows that repeat, held as by `Run.held_since`.

    When the run starts, the first command has been held for `lead_s` [s].
    """
    command = run.command
    rows = command.wheels_rpm
    if isinstance(command, BodyCommand):
        rows = np.stack([command.v_rpm, command.theta_deg, command.vc_rpm], axis=1)
    keep = np.concatenate([[True], np.any(rows[1:] != rows[:-1], axis=1)])
    time, rows = run.held_since(command_period_s)[keep] + lead_s, rows[keep]
    time[0] = 0.0
    return BodyCommands(time, *rows.T) if isinstance(command, BodyCommand) else WheelCommands(time, rows)
