"""A four-wheel Mecanum robot in MuJoCo whose wheels behave as measured.

This module is imported while ``import mujoco`` loads the wheel plugin, so importing it imports neither
mujoco, gymnasium, numpy nor scipy: each public name is loaded on first use.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports
from mecanum_env.registration import register_when_gymnasium_is_there

if TYPE_CHECKING:
    from mecanum_env.effects import CATALOGUE
    from mecanum_env.errors import InputError, MecanumError
    from mecanum_env.law import WheelLaw
    from mecanum_env.mjcf import write_models
    from mecanum_env.model import Model, Robot, Wheel, paper_model, read_model, read_robot, write_model
    from mecanum_env.simulator import (
        BodyCommands,
        RobotSession,
        SimulationDivergedError,
        Trajectory,
        WheelCommands,
        drive,
        read_commands,
        replay_bench,
    )
    from mecanum_env.tankendo import action_to_command, command_to_action, read_observation
    from mecanum_env.tankendo.env import TankendoEnv
    from mecanum_env.tankendo.vector import TankendoVectorEnv
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "CATALOGUE",
    "BodyCommands",
    "InputError",
    "MecanumError",
    "Model",
    "Robot",
    "RobotSession",
    "SimulationDivergedError",
    "TankendoEnv",
    "TankendoVectorEnv",
    "Trajectory",
    "Wheel",
    "WheelCommands",
    "WheelLaw",
    "action_to_command",
    "command_to_action",
    "drive",
    "paper_model",
    "read_commands",
    "read_model",
    "read_observation",
    "read_robot",
    "replay_bench",
    "write_model",
    "write_models",
]

__version__ = "0.1.0"

register_when_gymnasium_is_there()
