"""What a model predicts for a log: its commands simulated, sampled at the times of the log."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np

from mecanum_env.effects.apply import Sensors, in_turned_axes, sensors_of, without_sensors
from mecanum_env.kinematics import POSE
from mecanum_env.model import Model
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, FreeWheel
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start, start_of
from sysid.compare.predicted.gap_start import SeenSpeed, motions_from_gap, starts_in_gap
from sysid.compare.predicted.motion import Motion, bench_motions_of
from sysid.compare.predicted.robot import CompiledRobot, follows_voltage, supply_of
from sysid.compare.predicted.settings import SimulationSettings
from sysid.logs import Run


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
            return motions_from_gap(wheel, asked, [SeenSpeed.of([run]) for run, _ in runs], sensors).motions
        return bench_motions_of(wheel, BenchRuns(asked))
    by_voltage = any(supply_of(run) for run, _ in runs) and follows_voltage(model)
    robots: dict[float, CompiledRobot] = {}
    motions: dict[Hashable, Motion] = {}
    found = []
    for run, start in runs:
        local = in_run_frame(model, start)
        heading = 0.0 if local is model else start.yaw_rad
        columns = (run.time_s, *run.command.columns().values())
        voltage = run.file if by_voltage and supply_of(run) else ""
        key = heading, start.moving, start.wheels_rpm, voltage, *(values.tobytes() for values in columns)
        if key not in motions:
            if heading not in robots:
                robots[heading] = CompiledRobot(local, settings)
            motions[key] = robots[heading].motion(run, start)
        found.append(motions[key])
    return found


def bench_run(run: Run, start: Start, command_period_s: float, supply: Supply | None = None) -> BenchRun:
    """Return a bench log's commands as a drive may have held them, see `Run.held_since`.

    The drive has the `supply`, by default a constant one.
    """
    since = run.held_since(command_period_s)
    return BenchRun(since, run.command.wheels_rpm[:, 0], run.duration_s, start.initial_rpm, supply)


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
