"""Controllers by name: the names that command lines accept and tables list."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.arena import Arena
from training.controllers.compensation import Compensated
from training.controllers.interface import Controller
from training.controllers.lqr import Lqr
from training.controllers.mpc import Mpc
from training.controllers.oracle import Oracle
from training.controllers.scripted import Creep, RandomMotion, Retreat, SideStep, Still
from training.controllers.tracking import Proportional, Smith

SUFFIX: Final = "+compensated"
"""After a name: the controller inside `Compensated`."""
_PREDICT_LATENCY: Final = ("smith", "lqr", "mpc")
"""Controllers that compensate `command_latency` themselves, better than `Compensated` could."""


@dataclass(frozen=True)
class ControllerArguments:
    """What a controller may be made from; see `make_controller`."""

    model: Model
    rules: Rules
    arena: Arena | None
    row: int
    seed: int


def _proportional(given: ControllerArguments, gain_per_s: float) -> Proportional:
    model, maai_m = given.model, given.rules.maai_m
    return Proportional(maai_m, gain_per_s, gain_per_s, model.robot, model.wheel.saturation_rpm)


def _oracle(given: ControllerArguments) -> Oracle:
    if given.arena is None:
        raise InputError("the oracle reads from the simulator and needs an arena; a real robot has none")
    return Oracle(given.arena, given.row)


def _policy(name: str, rules: Rules) -> Controller:
    # Imported here, so that only those who use a policy wait for it.
    from training.controllers.policy import load_policy, policy_names, policy_path

    path = policy_path(name)
    if path is None:
        known = dict.fromkeys((*CONTROLLERS, *policy_names()))
        raise InputError(
            f"controller {name!r}: no such name{did_you_mean(name, known)}; known: "
            f"{', '.join(known)}, or the path of a trained policy (a folder or a file .npz); "
            f"each may be followed by {SUFFIX}"
        )
    return load_policy(path, rules)


CONTROLLERS: Final[Mapping[str, Callable[[ControllerArguments], Controller]]] = MappingProxyType(
    {
        "random": lambda given: RandomMotion(given.seed),
        "still": lambda _: Still(),
        "p": lambda given: _proportional(given, gain_per_s=4.0),
        "smith": lambda given: Smith(given.model, given.rules.maai_m),
        "lqr": lambda given: Lqr(given.model, given.rules.maai_m),
        "retreat": lambda given: Retreat(_proportional(given, gain_per_s=2.0)),
        "sidestep": lambda given: SideStep(_proportional(given, gain_per_s=2.0)),
        "creep": lambda given: Creep(_proportional(given, gain_per_s=2.0)),
        "mpc": lambda given: Mpc(given.model, rules=given.rules),
        "oracle": _oracle,
        "policy": lambda given: _policy("policy", given.rules),
    }
)
"""Name -> factory, simplest first; `policy` is the trained policy that comes with the package."""


def make_controller(
    name: str,
    model: Model,
    *,
    arena: Arena | None = None,
    row: int = 0,
    seed: int = 0,
    rules: Rules | None = None,
) -> Controller:
    """Return a new controller, ready for an episode.

    Args:
        name: a key of `CONTROLLERS`, the name of a bundled policy, or the path of a trained one (a folder or
            a file `.npz`); followed by `+compensated`, the controller is wrapped into a compensation of the
            model's effects.
        model: what the controller knows of the robot: wheel law, dimensions, effects.
        arena: the simulator that it plays in; only the oracle needs it.
        row: index of its episode in the arena.
        seed: of a controller that draws at random.
        rules: rules that it plays by; by default those of the arena, or the usual ones.

    Raises:
        InputError: there is no such name and no such policy, or the oracle has no arena.
    """
    if rules is None:
        rules = Rules() if arena is None else arena.setting.rules
    controller: Controller
    if name.endswith(SUFFIX):
        base = name.removesuffix(SUFFIX)
        if not base or base.endswith(SUFFIX):
            raise InputError(f"controller {name!r}: must be one name or path, followed by {SUFFIX} once")
        predicts = base in _PREDICT_LATENCY
        left = {n: v for n, v in model.effects.items() if predicts and CATALOGUE[n].undone_by == "prediction"}
        # The controller knows the robot that remains after compensation.
        inner = make_controller(
            base, replace(model, effects=left), arena=arena, row=row, seed=seed, rules=rules
        )
        controller = Compensated(inner, model, predicts_latency=predicts)
    elif name in CONTROLLERS:
        controller = CONTROLLERS[name](ControllerArguments(model, rules, arena, row, seed))
    else:
        controller = _policy(name, rules)
    controller.reset()
    return controller
