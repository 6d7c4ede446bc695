"""A robot that is made ready once, to be driven through several runs, one after another."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Final

import mujoco
import numpy as np

from mecanum_env.batch.runs import PlanarDrives, PlanarPath
from mecanum_env.effects.apply import drive_parameters
from mecanum_env.errors import EffectRefusedError
from mecanum_env.kinematics import wheels_to_body
from mecanum_env.mjcf.physics import SIMULATION_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.simulator import (
    BodyCommands,
    Commands,
    RobotPlant,
    Trajectory,
    WheelCommands,
    compile_plant,
    drive,
)
from mecanum_env.simulator.robot import standing
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start
from sysid.compare.predicted.motion import Motion
from sysid.compare.predicted.settings import SimulationSettings
from sysid.logs import BodyCommand, Run

_LEAD_S: Final = 1.5
"""Time for which a robot that moves when its log starts is assumed to have driven as it does then [s]."""

_Drive = Callable[[Commands, float, Supply | None, tuple[float, ...]], Trajectory | PlanarPath]
"""Commands, duration [s], supply, and the angles at which the wheels start [rad], 0 if none -> motion."""


class CompiledRobot:
    """A robot in the frame in which its runs start, on the plant of some `settings`.

    If these give no time step, that is `SIMULATION_TIMESTEP_S`: with twice that the wheels of quick commands
    are off by about the noise of good encoders, and robots that nothing was changed on show a gap.

    Raises:
        InputError: an effect that the plant cannot simulate.
    """

    def __init__(self, model: Model, settings: SimulationSettings) -> None:
        self._model = model
        on_rollers = settings.plant == "rollers"
        self._drive = (
            _in_mujoco(model, "rollers", settings.timestep_s) if on_rollers else _planar(model, settings)
        )

    @cached_property
    def _follows_voltage(self) -> bool:
        return follows_voltage(self._model)

    def motion(self, run: Run, start: Start, wheel_angles_rad: tuple[float, ...] = ()) -> Motion:
        """Return the true motion in a run that it starts with wheels at some angles [rad], 0 if none.

        Raises:
            SimulationDivergedError: the state stopped being finite.
        """
        lead = _LEAD_S if start.moving else 0.0
        supply = supply_of(run)
        path = self._drive(
            commands_of(run, self._model.wheel.command_period_s, lead, self._asked_before(start)),
            run.duration_s + lead,
            supply.later(lead) if supply is not None and self._follows_voltage else None,
            wheel_angles_rad,
        )
        columns = (*path.wheels_rpm.T, *path.twist.T, *path.pose.T)
        return Motion(path.time_s, dict(zip(CHANNELS, columns, strict=True)), lead)

    def _asked_before(self, start: Start) -> tuple[float, ...]:
        """Return the wheel commands [rpm] that would have led to how a robot drives when a run starts."""
        return tuple(speed / self._model.wheel.law.dc_gain for speed in start.wheels_rpm)


def _planar(model: Model, settings: SimulationSettings) -> _Drive:
    """Return how a robot without slip is driven, whose wheels have no angles."""
    step = SIMULATION_TIMESTEP_S if settings.timestep_s is None else settings.timestep_s
    try:
        drives = PlanarDrives(model, step)
    except EffectRefusedError:
        # Effects of one's own may have a form for MuJoCo alone. What the plant refuses, that refuses, too.
        return _in_mujoco(model, "planar", step)
    return lambda commands, duration_s, supply, _: drives.drive(commands, duration_s, supply)


def _in_mujoco(model: Model, plant: RobotPlant, timestep_s: float | None) -> _Drive:
    """Return how a robot is driven in MuJoCo, without visuals and without computing its sensors."""
    compiled = compile_plant(model, plant, timestep_s, visuals=False)
    # The motion is read off positions and velocities; the accelerometer alone takes a sixth of a step.
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    data, stances = mujoco.MjData(compiled), dict[tuple[float, ...], FloatArray]()

    def driven(
        commands: Commands, duration_s: float, supply: Supply | None, wheel_angles_rad: tuple[float, ...]
    ) -> Trajectory:
        if wheel_angles_rad not in stances:
            stances[wheel_angles_rad] = standing(compiled, wheel_angles_rad)
        stance = stances[wheel_angles_rad]
        return drive(model, commands, duration_s, mj_model=compiled, stance=stance, supply=supply, data=data)

    return driven


def follows_voltage(model: Model) -> bool:
    """Return whether the motion of a model depends on the supply's voltage."""
    return drive_parameters(model).reads_voltage


def supply_of(run: Run) -> Supply | None:
    """Return the supply's voltage in a run; None if it was not logged."""
    return Supply.logged(run.time_s, run.channels.get("battery_v"), run.full_v)


@lru_cache(maxsize=256)
def commands_of(
    run: Run, command_period_s: float, lead_s: float = 0.0, before_rpm: tuple[float, ...] = ()
) -> Commands:
    """Return a robot log's commands, without rows that repeat, held as by `Run.held_since`.

    When the run starts, wheel commands (4,) `before_rpm` have been held for `lead_s` [s]; where these are not
    known, it was the first command.
    """
    command = run.command
    rows = command.wheels_rpm
    if isinstance(command, BodyCommand):
        rows = np.stack([command.v_rpm, command.theta_deg, command.vc_rpm], axis=1)
    keep = np.concatenate([[True], np.any(rows[1:] != rows[:-1], axis=1)])
    time, rows = run.held_since(command_period_s)[keep] + lead_s, rows[keep]
    if before_rpm and lead_s > 0.0:
        before = np.array(before_rpm)
        if isinstance(command, BodyCommand):
            forward, left, turn = wheels_to_body(before)
            before = np.array([math.hypot(forward, left), math.degrees(math.atan2(left, forward)), turn])
        time, rows = np.insert(time, 0, 0.0), np.insert(rows, 0, before, axis=0)
    time[0] = 0.0
    return BodyCommands(time, *rows.T) if isinstance(command, BodyCommand) else WheelCommands(time, rows)
