"""The model of a drawn drive or robot, fitted to its nominal logs as a user would."""

from __future__ import annotations

import json
from pathlib import Path

from mecanum_env.model import Model, read_model, read_robot, write_model
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import read_dataset


def nominal_model(folder: Path) -> Model:
    """Return the model of a case's `folder`, fitted to `nominal` in it and written to model.json.

    It is what `python -m sysid.fit nominal` gives, with `--robot robot.json` where that file exists.

    Raises:
        InputError: logs to which no law can be fitted.
    """
    robot = folder / "robot.json"
    options = FitOptions()
    if robot.is_file():
        given = tuple(json.loads(robot.read_text(encoding="utf-8")))
        options = FitOptions(robot=read_robot(robot), robot_given=given)
    path = folder / "model.json"
    write_model(fitted_model(fit_dataset(read_dataset(folder / "nominal"), options)), path)
    return read_model(path)
