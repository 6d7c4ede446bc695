"""What a model predicts for a log: the same commands through MuJoCo, read at the log's own samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import check_effects, measured, without_sensors
from mecanum_env.mjcf import bench_spec, planar_spec, robot_spec
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.simulator import BodyCommands, Commands, WheelCommands, drive
from mecanum_env.simulator.bench import bench_motion
from mecanum_env.simulator.body_limits import limits_body, wheel_side
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.units import FloatArray
from sysid.compare.study import Study
from sysid.logs import BodyCommand, Run
from sysid.logs.runs import REST

LEAD_S: Final = 1.5
"""A robot that a log finds moving is taken to have had its first command for this long."""
FIRST_S: Final = 0.05
"""What the channels show in the first so many seconds (at least three samples) is the start."""
_LATE: Final = 3.5
"""Sampling intervals after the beginning of a run from which a sample no longer shows how it began."""
_CLEAR: Final = 4.0
"""Standard deviations of the first samples' mean from which a start in motion is told from noise."""
_TOO_FEW: Final = 20
POSE: Final = ("x_m", "y_m", "yaw_rad")


@dataclass(frozen=True)
class Start:
    """How a run begins, as far as its first samples say."""

    initial_rpm: float = 0.0
    """Bench: the wheel's steady speed."""
    moving: bool = False
    """Robot: it was driving already."""
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    """Robot: where it stood in the world."""


def start_of(run: Run) -> Start:
    """Return how a run begins: at rest unless its first samples clearly say otherwise."""
    first = {name: _first_mean(run, name) for name in run.channels}
    moving = any(
        abs(first[name]) > max(rest, _CLEAR * _noise(run, name))
        for name, rest in REST.items()
        if name in first
    )
    if run.level == "bench":
        return Start(initial_rpm=first.get("speed_rpm", 0.0) if moving else 0.0)
    # A sensor may be biased; what drives a robot is its command.
    moving = moving and bool(np.any(run.command.wheels_rpm[0] != 0.0))
    return Start(0.0, moving, *(first.get(name, 0.0) for name in POSE))


@dataclass(frozen=True, eq=False)
class Motion:
    """What truly happens in a run, before any sensor."""

    time_s: FloatArray
    """Physics clock from the start of the simulation [s], shape (n,)."""
    channels: Mapping[str, FloatArray]
    """Column of a log -> true values, shape (n,)."""
    lead_s: float = 0.0
    """How much of it was before the log begins [s]."""


def compile_for(model: Model, level: str, study: Study = Study()) -> mujoco.MjModel:  # noqa: B008  (frozen)
    """Compile what `predict` simulates: the bench or the robot, without what is only seen.

    Args:
        model: wheel, robot and effects.
        level: "bench" or "robot".
        study: gives the plant and the time step; where that is None, the planar plant takes
            `TRAINING_TIMESTEP_S`, which is accurate enough there.

    Raises:
        InputError: an effect that the plant does not have.
    """
    plant, timestep_s = study.plant, study.timestep_s
    if level == "bench":
        return bench_spec(model, timestep_s, visuals=False).compile()
    check_effects(model, plant)
    spec = robot_spec if plant == "rollers" else planar_spec
    after_limits = wheel_side(model) if limits_body(model) else model
    if plant == "planar" and timestep_s is None:
        timestep_s = TRAINING_TIMESTEP_S
    return spec(after_limits, timestep_s, wheel_quantum=False, visuals=False).compile()


def in_run_frame(model: Model, start: Start) -> Model:
    """Return the model with world headings counted from where a run starts, as the simulation does.

    Args:
        model: whose floor may slope.
        start: the run's yaw counts.
    """
    slope = model.effects.get("floor_slope")
    if slope is None or start.yaw_rad == 0.0:
        return model
    heading = slope.get("heading_deg", 0.0) - math.degrees(start.yaw_rad)
    return replace(model, effects={**model.effects, "floor_slope": {**slope, "heading_deg": heading}})


def predict(
    model: Model,
    run: Run,
    start: Start | None = None,
    mj_model: mujoco.MjModel | None = None,
    study: Study = Study(),  # noqa: B008  (frozen)
) -> dict[str, FloatArray]:
    """Return what a model predicts for a run: channel -> values at the run's rows, each of shape (n,).

    The pose of a robot log starts where the log's does.

    Args:
        model: wheel, robot and effects.
        run: whose commands are replayed.
        start: how it begins; found from its first samples by default.
        mj_model: `compile_for` of the model as `in_run_frame` has it, to save compiling.
        study: gives the plant and the time step of a model that is compiled here.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    start = start_of(run) if start is None else start
    local = in_run_frame(without_sensors(model), start)
    compiled = compile_for(local, run.level, study) if mj_model is None else mj_model
    return sensor_readings(model, run, start, motion_of(local, run, start, compiled))


def motion_of(
    model: Model, run: Run, start: Start, mj_model: mujoco.MjModel, turned_rad: Sequence[float] = ()
) -> Motion:
    """Return what truly happens in a run.

    Args:
        model: without sensors' effects, its floor's slope as `in_run_frame` has it.
        run: whose commands are replayed.
        start: how it begins.
        mj_model: `compile_for` of the model.
        turned_rad: of a robot on rollers, the angles at which its wheels start.
    """
    if run.level == "bench":
        since = run.held_since(model.wheel.command_period_s)
        clock, speed = bench_motion(
            mj_model, since, run.command.wheels_rpm[:, 0], run.duration_s, start.initial_rpm
        )
        return Motion(clock, {"speed_rpm": speed})
    lead = LEAD_S if start.moving else 0.0
    commands = commands_of(run, model.wheel.command_period_s, lead)
    path = drive(model, commands, run.duration_s + lead, mj_model=mj_model, turned_rad=turned_rad)
    columns = (*path.wheels_rpm.T, *path.twist.T, *path.pose.T)
    return Motion(path.time_s, dict(zip(CHANNELS, columns, strict=True)), lead)


def sensor_readings(model: Model, run: Run, start: Start, motion: Motion) -> dict[str, FloatArray]:
    """Return what a model's sensors show of a motion, at a run's rows, each of shape (n,).

    Args:
        model: its sensors' effects count.
        run: its stamps and channels count.
        start: where the pose begins.
        motion: of the run.
    """
    clock = motion.time_s
    channels = measured(model, clock, motion.channels)
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
    """Return a robot log's commands in the simulator's form, rows that repeat left out.

    Args:
        run: a robot log.
        command_period_s: of the robot's clock, see `Run.held_since`.
        lead_s: how long the first command has held when the run starts [s].
    """
    command = run.command
    if isinstance(command, BodyCommand):
        rows = np.stack([command.v_rpm, command.theta_deg, command.vc_rpm], axis=1)
    else:
        rows = command.wheels_rpm
    keep = np.concatenate([[True], np.any(rows[1:] != rows[:-1], axis=1)])
    time, rows = run.held_since(command_period_s)[keep] + lead_s, rows[keep]
    time[0] = 0.0
    return BodyCommands(time, *rows.T) if isinstance(command, BodyCommand) else WheelCommands(time, rows)


def _first_mean(run: Run, name: str) -> float:
    few = _first(run, name)
    return float(np.mean(few)) if few.size else 0.0


def _first(run: Run, name: str) -> FloatArray:
    """Return the samples that show how a run begins; of a pose, which always starts somewhere, the first."""
    finite = run.finite(name)
    time, values = run.time_s[finite], run.channels[name][finite]
    few = values[: max(3, int(np.sum(time <= FIRST_S)))]
    if name in POSE:
        return few
    # After a hole at the beginning the wheel may have been started.
    return few[time[: few.size] <= max(FIRST_S, _LATE * run.median_interval_s)]


def _noise(run: Run, name: str) -> float:
    """Return the standard deviation of the first samples' mean, by second differences of the channel."""
    values = run.channels[name][run.finite(name)]
    if values.size < _TOO_FEW:
        return 0.0
    # A median, which what moves does not reach: that of |normal| is 0.6745; 1 + 4 + 1 is the variance.
    return float(np.median(np.abs(np.diff(values, 2)))) / (
        0.6745 * math.sqrt(6.0 * max(1, _first(run, name).size))
    )
