"""Controllers by name: what a command line takes and what tables list."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.tankendo.arena import Arena
from training.controllers.compensation.compensated import Compensated
from training.controllers.interface import Controller
from training.controllers.lqr import Lqr
from training.controllers.mpc import Mpc
from training.controllers.oracle import Oracle
from training.controllers.scripted import RandomMotion, Retreat, SideStep, Still
from training.controllers.tracking import Proportional, Smith

SUFFIX: Final = "+compensated"
"""Behind a name: the controller within `Compensated`."""
_PREDICTS: Final = ("smith", "lqr", "mpc")
"""Controllers that predict over delays themselves, better than a compensation around them could."""


@dataclass(frozen=True)
class Given:
    """What a controller may be made from; see `make_controller`."""

    model: Model
    arena: Arena | None
    row: int
    seed: int


def _proportional(given: Given, gain_per_s: float) -> Proportional:
    model = given.model
    return Proportional(
        gain_per_s=gain_per_s,
        turn_gain_per_s=gain_per_s,
        robot=model.robot,
        limit_rpm=model.wheel.saturation_rpm,
    )


def _oracle(given: Given) -> Controller:
    if given.arena is None:
        raise InputError("the oracle looks into the simulator and needs an arena; a real robot has none")
    return Oracle(given.arena, given.row)


def _bundled(_given: Given) -> Controller:
    from training.controllers.policy import bundled

    return _load(bundled())


CONTROLLERS: Final[Mapping[str, Callable[[Given], Controller]]] = MappingProxyType(
    {
        "random": lambda given: RandomMotion(given.seed),
        "still": lambda _: Still(),
        "p": lambda given: _proportional(given, gain_per_s=4.0),
        "smith": lambda given: Smith(given.model),
        "lqr": lambda given: Lqr(given.model),
        "retreat": lambda given: Retreat(_proportional(given, gain_per_s=2.0)),
        "sidestep": lambda given: SideStep(_proportional(given, gain_per_s=2.0)),
        "mpc": lambda given: Mpc(given.model),
        "oracle": _oracle,
        "policy": _bundled,
    }
)
"""Name -> maker, simplest first; `policy` is the trained policy that is part of the package."""


def make_controller(
    name: str, model: Model, *, arena: Arena | None = None, row: int = 0, seed: int = 0
) -> Controller:
    """Return a new controller, ready for an episode.

    Args:
        name: a key of `CONTROLLERS`, or the path of a trained policy: a folder, or a file `.npz`; with
            `+compensated` behind it, wrapped into a compensation of the model's effects.
        model: what the controller knows of the robot: wheel law, dimensions, named effects.
        arena: the simulator that the oracle looks into.
        row: which of the arena's episodes it plays.
        seed: of a controller that draws by chance.

    Raises:
        InputError: no such name and no such policy, or the oracle without an arena.
    """
    controller: Controller
    if name.endswith(SUFFIX):
        # It drives the robot that compensation makes of this one.
        base = name.removesuffix(SUFFIX)
        if not base or base.endswith(SUFFIX):
            raise InputError(f"controller {name!r}: must be one name or path with {SUFFIX} behind it, once")
        predicts = base in _PREDICTS
        left = {n: v for n, v in model.effects.items() if CATALOGUE[n].undone_by == "prediction"}
        ideal = replace(model, effects=left if predicts else {})
        inner = make_controller(base, ideal, arena=arena, row=row, seed=seed)
        controller = Compensated(inner, model, foresees=predicts)
    elif name in CONTROLLERS:
        controller = CONTROLLERS[name](Given(model, arena, row, seed))
    elif name and (Path(name).suffix == ".npz" or Path(name).is_dir()):
        controller = _load(Path(name))
    else:
        raise InputError(
            f"controller {name!r}: no such name{did_you_mean(name, CONTROLLERS)}; known: "
            f"{', '.join(CONTROLLERS)}, or the path of a trained policy (a folder or a file .npz); "
            f"each may be followed by {SUFFIX}"
        )
    controller.reset()
    return controller


def _load(path: Path) -> Controller:
    # Only who asks for a policy pays for it.
    from training.controllers.policy import load_policy

    return load_policy(path)
