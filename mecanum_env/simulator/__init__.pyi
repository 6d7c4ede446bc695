from .bench import replay_bench
from .commands import SCRIPTS, BodyCommands, Commands, WheelCommands, read_commands, scripted
from .free_wheel import compile_bench
from .robot import RobotPlant, RobotSession, compile_plant, drive, plant_spec
from .trajectory import SimulationDivergedError, Trajectory, step_through

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
    "plant_spec",
    "read_commands",
    "replay_bench",
    "scripted",
    "step_through",
]
