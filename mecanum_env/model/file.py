"""Reading and writing model files, whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from mecanum_env.asset_files import asset_path
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.model.codec import model_from_dict, model_to_dict, robot_from_dict
from mecanum_env.model.records import Model, Robot


def read_model(path: str | os.PathLike[str]) -> Model:
    """Read a `model.json` from a path.

    Raises:
        InputError: no such file, not JSON, another format, a missing, misspelt or impossible value.
        UnstableLawError: the wheel law is unstable; the message lists the poles.
    """
    path = Path(path)
    value = _read_json(path, "make a model with `python -m sysid.fit LOGS`")
    try:
        return model_from_dict(value)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def read_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a JSON file with any of the keys of a model's "robot" section; packaged values fill in the rest.

    Raises:
        InputError: no such file, not JSON, an unknown name or an impossible value.
    """
    path = Path(path)
    value = _read_json(path, "it holds any keys of a model's robot section, such as wheel_radius_m")
    try:
        return robot_from_dict(value)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def write_model(model: Model, path: str | os.PathLike[str]) -> None:
    """Write a model to a path, whole or not at all, in full precision: `read_model` gives it back equal.

    Raises:
        UnstableLawError: a law is unstable, and `read_model` would refuse it.
        InputError: the path cannot be written, or `uncertainty`, `provenance`, `extra` hold NaN or infinity.
    """
    for law in (model.wheel.law, *model.wheels.values()):
        law.require_stable()
    write_json(path, model_to_dict(model))


def paper_model() -> Model:
    """Return the packaged model of the paper (coefficients renormalised; sample period inferred)."""
    return read_model(asset_path("models/paper.json"))


def _refuse_constant(name: str) -> float:
    raise InputError(f"{name} is not valid JSON; an absent limit is null")


def _read_json(path: Path, hint: str) -> Any:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {hint}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file, must be JSON; {hint}") from error
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line {error.lineno}: not valid JSON ({error.msg})") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
