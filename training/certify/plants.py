"""The plants of a certificate: variants of the robot, which are the model, its uncertainty and added effects.

| group | plants |
|---|---|
| `nominal` | the model with all its effects |
| `effects` | each of the model's effects alone, and none of them (`bare`) |
| `posterior` | for each episode a robot drawn from the model's uncertainty |
| `robot-level` | the model with the losses and the rise time that the paper measured of its robot |
| `latency` | the model with commands that act 0.1 s later |
| `what-if` | the model with one more effect of the catalogue, each in turn, at a realistic size |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal, get_args

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import delayed
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model, cause_of
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import Opponent, Opponents

RobotGroup = Literal["nominal", "effects", "posterior", "robot-level", "latency", "what-if"]
Group = RobotGroup | Literal["opponents", "senses", "adversary", "held-out"]
GROUPS: Final[tuple[RobotGroup, ...]] = get_args(RobotGroup)
"""Groups of robots, in the order in which they are listed; `variations` has those of opponents and senses."""
HELD_OUT: Final[Literal["held-out"]] = "held-out"
"""Group of what no training has seen, which the verdict judges apart and every certificate plays."""
ADVERSARY: Final[Literal["adversary"]] = "adversary"
"""Group and name of the opponent that is searched against the controller, which the verdict leaves out."""
APART: Final = (HELD_OUT, ADVERSARY)
"""Groups among which the worst plant is not sought."""

EXTRA_LATENCY_S: Final = 0.1
"""Latency that the group `latency` adds to the model's own [s]: one command period."""

_FRICTION_OVER_SERVO_RAD_S: Final = 0.767 / 5.0
ROBOT_LEVEL: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "speed_saturation": {"limit_rpm": 97.1, "softness_rpm": 73.0},
        "track_width": {"scale": 0.887},
        "sensor_bias": {"vx_m_s": -0.00317, "yaw_rate_rad_s": -0.0107},
    }
)
"""Effects that, with Coulomb friction of 0.153 rad/s times the servo, reproduce the six numbers that the
paper prints of its robot: losses of .186, .0689, .156 and .310 at 10, 40, 80 and 130 rpm, .0306 in rotation,
rise time .19 s. Of the sets that do (docs/results/paper_gap.md) it attributes the least to the sensors: the
robot really moves as slowly as it was measured to."""


@dataclass(frozen=True)
class RobotVariant:
    """A variant of the robot to play on."""

    name: str
    """Unique, such as "with-backlash"."""
    group: Group
    summary: str
    """Description in one line."""
    model: Model
    """Wheel, robot and effects; with `randomize="posterior"` the centre of the distribution."""
    physics: RobotPlant = "planar"
    """Simulated system; "rollers" for effects that the planar plant cannot simulate."""
    randomize: Literal["none", "posterior"] = "none"
    """Argument of the environments."""
    opponent: Opponent | Opponents | None = None
    """The opponent; None: that of the difficulty."""
    senses: Senses | VariedSenses | None = None
    """The robot's senses; None: the usual sensors."""


def robot_variants(model: Model, physics: RobotPlant = "planar") -> tuple[RobotVariant, ...]:
    """Return all variants of a model, in the order of `GROUPS`; `posterior` only if it has an uncertainty.

    Variants run on the given physics, except on rollers if the planar plant refuses one of their effects.
    """
    found = [RobotVariant("nominal", "nominal", "the model with all its effects", model)]
    bare = replace(model, effects={})
    if model.effects:
        found.append(RobotVariant("bare", "effects", "the model without its effects", bare))
    if len(model.effects) > 1:
        for name, values in model.effects.items():
            summary = f"of the model's effects {name} alone"
            found.append(RobotVariant(f"only-{name}", "effects", summary, bare.with_effect(name, **values)))
    if knows_uncertainty(model):
        drawn = "for each episode a robot drawn from the model's uncertainty"
        found.append(RobotVariant("posterior", "posterior", drawn, model, randomize="posterior"))
    losses = "losses and rise time that the paper measured of its robot, in place of the model's effects"
    found += [
        RobotVariant("robot-level", "robot-level", losses, robot_level(model)),
        RobotVariant(
            f"latency+{EXTRA_LATENCY_S:g}s",
            "latency",
            f"every command acts {EXTRA_LATENCY_S:g} s later",
            delayed(model, EXTRA_LATENCY_S),
        ),
    ]
    for name, values in realistic_sizes(model).items():
        if not any(cause_of(own) == name for own in model.effects):
            size = ", ".join(f"{key} {value:g}" for key, value in values.items())
            changed = model.with_effect(name, **values)
            found.append(RobotVariant(f"with-{name}", "what-if", f"the model with {name}: {size}", changed))
    return tuple(
        replace(one, physics="rollers")
        if any(physics in CATALOGUE[name].refused_by for name in one.model.effects)
        else replace(one, physics=physics)
        for one in found
    )


def select_variants(found: Sequence[RobotVariant], wanted: Sequence[str]) -> tuple[RobotVariant, ...]:
    """Return the wanted ones of the found variants, or all if none is wanted.

    The nominal one and those that are held out are always wanted.

    Raises:
        InputError: a wanted name is neither that of a variant nor of a group.
    """
    names = [variant.name for variant in found]
    groups = list(dict.fromkeys([*GROUPS, *(variant.group for variant in found)]))
    for name in wanted:
        if name == "posterior" and name not in names:
            raise InputError(
                "plants: posterior: the model holds no uncertainty; `python -m sysid.fit LOGS` writes one "
                "that does"
            )
        if name not in (*names, *groups):
            raise InputError(
                f"plants: no plant {name!r}{did_you_mean(name, [*names, *groups])}; name a group "
                f"({', '.join(groups)}) or a plant of docs/certify.md"
            )
    keep = {"nominal", HELD_OUT, *(wanted or groups)}
    return tuple(variant for variant in found if variant.name in keep or variant.group in keep)


def knows_uncertainty(model: Model) -> bool:
    """Return whether a model holds an uncertainty that `randomize="posterior"` can draw from."""
    known = model.uncertainty
    return bool(known.get("wheel", {}).get("covariance") or known.get("robot") or known.get("effects"))


def robot_level(model: Model) -> Model:
    """Return a model with the paper's robot-level effects, `ROBOT_LEVEL`, in place of its own."""
    torque = _FRICTION_OVER_SERVO_RAD_S * model.robot.servo_n_m_s_rad
    return replace(model, effects={**ROBOT_LEVEL, "coulomb_friction": {"torque_n_m": torque}})


def realistic_sizes(model: Model) -> dict[str, dict[str, float]]:
    """Return a size for each effect of the catalogue that a robot in use may well have; the values are ours.

    What counts in shares is a share of the model's own numbers.
    """
    return {name: dict(e.realistic(model)) for name, e in CATALOGUE.items() if e.realistic is not None}
