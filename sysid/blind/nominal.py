"""The model of each nominal plant: fitted once to effect-free logs, by the same program that users run."""

from __future__ import annotations

import json
from pathlib import Path

from mecanum_env.model import Model, read_model, read_robot, write_model
from sysid.blind.case import BlindTests
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import read_dataset


def nominal_model(tests: BlindTests, plant: str, folder: Path) -> Model:
    """Return the model of a plant; made where `folder` does not have it yet.

    Args:
        tests: which write its logs.
        plant: its name.
        folder: of this plant; gets logs, robot.json and model.json.
    """
    path = folder / "model.json"
    if not path.is_file():
        tests.write_nominal(plant, folder)
        robot = folder / "robot.json"
        options = FitOptions(
            robot=read_robot(robot), robot_given=tuple(json.loads(robot.read_text(encoding="utf-8")))
        )
        write_model(fitted_model(fit_dataset(read_dataset(folder / "logs"), options)), path)
    return read_model(path)
