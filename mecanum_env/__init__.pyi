from .effects.catalogue import CATALOGUE
from .errors import InputError, MecanumError
from .law import WheelLaw
from .mjcf import write_models
from .model import Model, Robot, Wheel, paper_model, read_model, read_robot, write_model
from .simulator import (
    BodyCommands,
    RobotSession,
    SimulationDivergedError,
    Trajectory,
    WheelCommands,
    drive,
    read_commands,
    replay_bench,
)
from .tankendo import action_to_command, command_to_action, read_observation
from .tankendo.env import TankendoEnv
from .tankendo.vector import TankendoVectorEnv

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

__version__: str
