from .batch import PlanarBatch, planar_robot
from .effects.catalogue import CATALOGUE, register
from .effects.definition import Effect, Parameter
from .errors import InputError, MecanumError
from .files import asset_path
from .law import WheelLaw
from .law.metrics import law_step_metrics
from .model import CustomEffect, CustomTable, Model, Robot, Wheel, paper_model, read_model, write_model
from .parallel import Workers
from .rendering.backend import use_backend
from .rendering.video import render_frames, write_video
from .rendering.view import View
from .senses import CameraFrame, Estimator, OwnReading, Senses, VariedSenses
from .simulator import BodyCommands, RobotSession, Trajectory, WheelCommands, drive, replay_bench, scripted
from .tankendo import Opponent, Opponents, Rules, command_to_action
from .tankendo.env import TankendoEnv
from .tankendo.sensing import estimated_observation
from .tankendo.vector import TankendoVectorEnv

__all__ = [
    "CATALOGUE",
    "BodyCommands",
    "CameraFrame",
    "CustomEffect",
    "CustomTable",
    "Effect",
    "Estimator",
    "InputError",
    "MecanumError",
    "Model",
    "Opponent",
    "Opponents",
    "OwnReading",
    "Parameter",
    "PlanarBatch",
    "Robot",
    "RobotSession",
    "Rules",
    "Senses",
    "TankendoEnv",
    "TankendoVectorEnv",
    "Trajectory",
    "VariedSenses",
    "View",
    "Wheel",
    "WheelCommands",
    "WheelLaw",
    "Workers",
    "asset_path",
    "command_to_action",
    "drive",
    "estimated_observation",
    "law_step_metrics",
    "paper_model",
    "planar_robot",
    "read_model",
    "register",
    "render_frames",
    "replay_bench",
    "scripted",
    "use_backend",
    "write_model",
    "write_video",
]

__version__: str
