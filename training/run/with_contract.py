"""A controller for a robot, if it was made for such a robot."""

from __future__ import annotations

from mecanum_env.model import Model
from training.controllers.interface import Controller
from training.controllers.named import SUFFIX, make_controller
from training.controllers.policy import load_policy, policy_path
from training.export.contract import contract_of


def controller_for(name: str, model: Model, source: str) -> Controller:
    """Return a controller for the robot of a model.

    Args:
        name: a name as for `make_controller`.
        model: the robot, as far as it is known.
        source: where the model is from, for messages.

    Raises:
        InputError: no such controller, or a policy that was not trained for such a robot.
    """
    base, compensated = name.removesuffix(SUFFIX), name.endswith(SUFFIX)
    path = policy_path(base)
    if path is not None:
        contract_of(load_policy(path), str(path)).refuse(model, source, compensated=compensated)
    return make_controller(name, model)
