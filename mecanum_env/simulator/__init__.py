"""Simulating a model in MuJoCo: the robot driving through commands, and a bench log replayed on one wheel.

Using these names imports mujoco; programs that draw call `mecanum_env.rendering.backend.use_backend` first.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from mecanum_env.effects.definition import RobotPlant
    from mecanum_env.simulator.bench import compile_bench, replay_bench
    from mecanum_env.simulator.commands import (
        SCRIPTS,
        BodyCommands,
        Commands,
        WheelCommands,
        read_commands,
        scripted,
    )
    from mecanum_env.simulator.robot import RobotSession, compile_plant, drive
    from mecanum_env.simulator.trajectory import SimulationDivergedError, Trajectory, step_through
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "SCRIPTS",
    "BodyCommands",
    "Commands",
    "RobotPlant",
    "RobotSession",
    "SimulationDivergedError",
    "Trajectory",
    "WheelCommands",
    "compile_bench",
    "compile_plant",
    "drive",
    "read_commands",
    "replay_bench",
    "scripted",
    "step_through",
]
