"""A controller for a robot, if it was made for such a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mecanum_env.model import Model
from training.controllers.interface import Controller
from training.controllers.named import SUFFIX, make_controller
from training.controllers.policy import bundled, load_policy
from training.export.contract import contract_of

BUNDLED: Final = ("nominal", "robust", "varied")
"""Bundled policies, which have a short name here."""


def controller_for(name: str, model: Model, source: str) -> Controller:
    """Return a controller for the robot of a model.

    Args:
        name: a bundled policy (nominal, robust, varied), or a name as for `make_controller`.
        model: the robot, as far as it is known.
        source: where the model is from, for messages.

    Raises:
        InputError: no such controller, or a policy that was not trained for such a robot.
    """
    base, compensated = name.removesuffix(SUFFIX), name.endswith(SUFFIX)
    path = bundled(base) if base in BUNDLED else bundled() if base == "policy" else Path(base)
    if path.suffix == ".npz" or path.is_dir():
        contract_of(load_policy(path), str(path)).refuse(model, source, compensated=compensated)
        base = str(path)
    return make_controller(base + SUFFIX * compensated, model)
