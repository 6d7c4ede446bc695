"""The plants that a controller is certified on: the model, what it leaves open, and what may come on top.

| group | plants |
|---|---|
| `nominal` | the model with all its effects |
| `effects` | each of the model's effects alone, and none of them (`bare`) |
| `posterior` | for each episode a robot drawn from what the identification left open |
| `robot-level` | the model with the losses and the rise time that the paper measured of its robot |
| `latency` | the model, its commands 0.1 s later |
| `what-if` | the model with one more effect of the catalogue, each in turn, at a realistic size |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal, get_args

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant

Group = Literal["nominal", "effects", "posterior", "robot-level", "latency", "what-if"]
GROUPS: Final[tuple[Group, ...]] = get_args(Group)
"""In the order in which plants are listed."""

EXTRA_LATENCY_S: Final = 0.1
"""What the plant of the group `latency` adds to the model's own latency [s]: one command period."""

_FRICTION_OVER_SERVO_RAD_S: Final = 0.767 / 5.0
ROBOT_LEVEL: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "speed_saturation": {"limit_rpm": 97.1, "softness_rpm": 73.0},
        "track_width": {"scale": 0.887},
        "sensor_bias": {"vx_m_s": -0.00317, "yaw_rate_rad_s": -0.0107},
    }
)
"""Effects that, with Coulomb friction of 0.153 rad/s times the servo, give the six figures that the paper
prints of its robot: losses of .186, .0689, .156 and .310 at 10, 40, 80 and 130 rpm, .0306 in rotation, rise
.19 s. Of the sets that do (docs/results/paper_gap.md) it is the one that lays the least on the sensors, so
that the robot in truth moves as slowly as it is shown to."""


@dataclass(frozen=True)
class NamedPlant:
    """A robot to play on."""

    name: str
    """Unique, such as "with-backlash"."""
    group: Group
    summary: str
    """What it is, one line."""
    model: Model
    """Wheel, robot and effects; where `randomize` is "posterior", what is drawn around."""
    physics: RobotPlant = "planar"
    """How it is simulated; "rollers" for effects that the planar plant cannot express."""
    randomize: Literal["none", "posterior"] = "none"
    """As for the environments."""


def plants(model: Model, physics: RobotPlant = "planar") -> tuple[NamedPlant, ...]:
    """Return every plant for a model, in the order of `GROUPS`; `posterior` only where it is known.

    Args:
        model: as a file gives it.
        physics: of all plants but those with an effect that the planar plant refuses; these run on rollers.
    """
    late = model.effects.get("command_latency", {}).get("delay_s", 0.0) + EXTRA_LATENCY_S
    found = [
        NamedPlant("nominal", "nominal", "the model with all its effects", model),
        *_own_effects(model),
    ]
    if knows_uncertainty(model):
        drawn = "for each episode a robot drawn from what the identification left open"
        found.append(NamedPlant("posterior", "posterior", drawn, model, randomize="posterior"))
    losses = "losses and rise time as the paper measured them of its robot, in place of the model's effects"
    found += [
        NamedPlant("robot-level", "robot-level", losses, robot_level(model)),
        NamedPlant(
            f"latency+{EXTRA_LATENCY_S:g}s",
            "latency",
            f"every command acts {EXTRA_LATENCY_S:g} s later",
            model.with_effect("command_latency", delay_s=late),
        ),
    ]
    for name, values in realistic_sizes(model).items():
        if name not in model.effects:
            size = ", ".join(f"{key} {value:g}" for key, value in values.items())
            changed = model.with_effect(name, **values)
            found.append(NamedPlant(f"with-{name}", "what-if", f"the model with {name}: {size}", changed))
    return tuple(replace(plant, physics=_physics(plant.model, physics)) for plant in found)


def select(found: Sequence[NamedPlant], wanted: Sequence[str]) -> tuple[NamedPlant, ...]:
    """Return the plants that are wanted, in their order, the nominal one always; all for no names.

    Args:
        found: what there is.
        wanted: names and groups.

    Raises:
        InputError: a name that is neither.
    """
    names = [plant.name for plant in found]
    for name in wanted:
        if name == "posterior" and name not in names:
            raise InputError(
                "plants: posterior: the model holds no uncertainty; make one with `python -m sysid.fit LOGS`"
            )
        if name not in (*names, *GROUPS):
            raise InputError(
                f"plants: no plant {name!r}{did_you_mean(name, [*names, *GROUPS])}; known are the groups "
                f"{', '.join(GROUPS)} and the plants {', '.join(names)}"
            )
    keep = {"nominal", *(wanted or GROUPS)}
    return tuple(plant for plant in found if plant.name in keep or plant.group in keep)


def knows_uncertainty(model: Model) -> bool:
    """Return whether a model holds what `randomize="posterior"` draws from."""
    known = model.uncertainty
    return bool(known.get("wheel", {}).get("covariance") or known.get("robot") or known.get("effects"))


def robot_level(model: Model) -> Model:
    """Return a model with the paper's robot-level effects, `ROBOT_LEVEL`, in place of its own."""
    torque = _FRICTION_OVER_SERVO_RAD_S * model.robot.servo_n_m_s_rad
    return replace(model, effects={**ROBOT_LEVEL, "coulomb_friction": {"torque_n_m": torque}})


def realistic_sizes(model: Model) -> dict[str, dict[str, float]]:
    """Return a size for each effect of the catalogue that a robot in use may well have; the values are ours.

    Args:
        model: what counts in shares is a share of its own numbers.
    """
    return {
        name: dict(effect.realistic(model))
        for name, effect in CATALOGUE.items()
        if effect.realistic is not None
    }


def _own_effects(model: Model) -> list[NamedPlant]:
    if not model.effects:
        return []
    bare = replace(model, effects={})
    found = [NamedPlant("bare", "effects", "the model without its effects", bare)]
    if len(model.effects) > 1:
        for name, values in model.effects.items():
            alone = bare.with_effect(name, **values)
            found.append(NamedPlant(f"only-{name}", "effects", f"of the model's effects {name} alone", alone))
    return found


def _physics(model: Model, wanted: RobotPlant) -> RobotPlant:
    refused = any(wanted in CATALOGUE[name].refused_by for name in model.effects)
    return "rollers" if refused else wanted
