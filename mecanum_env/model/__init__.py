"""`model.json`: the contract between fit, simulator, environment and gap workflow."""

from mecanum_env.model.custom import CustomEffect, CustomTable
from mecanum_env.model.effect_names import EFFECT_PARAMETERS, cause_of, effect_named, form_of, forms_of
from mecanum_env.model.file import (
    FORMAT,
    model_from_dict,
    model_sha256,
    model_to_dict,
    paper_model,
    read_model,
    read_robot,
    robot_from_dict,
    write_model,
)
from mecanum_env.model.model import ROBOT_NUMBERS, Model, Robot, Wheel

__all__ = [
    "EFFECT_PARAMETERS",
    "FORMAT",
    "ROBOT_NUMBERS",
    "CustomEffect",
    "CustomTable",
    "Model",
    "Robot",
    "Wheel",
    "cause_of",
    "effect_named",
    "form_of",
    "forms_of",
    "model_from_dict",
    "model_sha256",
    "model_to_dict",
    "paper_model",
    "read_model",
    "read_robot",
    "robot_from_dict",
    "write_model",
]
