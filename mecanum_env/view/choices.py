"""The effects that the page offers: those of the model, and a few that many robots have."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import drive_parameters
from mecanum_env.effects.definition import Effect, PlantKind, Values
from mecanum_env.model import Model, cause_of

_COMMON: Final = (
    "command_latency",
    "command_loss",
    "wheel_gain_mismatch",
    "speed_saturation",
    "acceleration_limit",
    "backlash",
    "coulomb_friction",
    "low_grip",
    "floor_slope",
    "payload",
)
"""Effects that are offered for every model, in the size that a robot in use may well have."""


@dataclass(frozen=True)
class Choice:
    """One effect that can be switched on and off."""

    name: str
    values: Values
    """Its size when it is on."""
    in_model: bool
    """Whether the model file has it; then it is on at first."""
    why_not: str = ""
    """Why it cannot be switched here; empty if it can."""

    @property
    def label(self) -> str:
        """The name with the size of each parameter."""
        sizes = ", ".join(f"{name} {value:g}" for name, value in self.values.items())
        return f"{self.name.replace('_', ' ')} ({sizes})"

    @property
    def summary(self) -> str:
        """What the effect is, one line."""
        return CATALOGUE[self.name].summary


def choices_for(model: Model, plant: PlantKind, *, measured: bool) -> tuple[Choice, ...]:
    """Return the effects to offer for a model on a plant, in the order of the chain.

    `measured`: the view shows what sensors measure, so that effects of sensors make a difference. An effect
    that this view cannot switch comes with the reason, if the model has it; else it is left out.
    """
    causes = {cause_of(name) for name in model.effects}
    found = []
    for name, effect in CATALOGUE.items():
        why_not = _why_not(effect, plant, measured=measured)
        if name in model.effects:
            found.append(Choice(name, dict(model.effects[name]), True, why_not))
        elif name in _COMMON and cause_of(name) not in causes and effect.realistic and not why_not:
            values = dict(effect.realistic(model))
            if plant != "bench" or _seen_on_one_wheel(effect, values, model):
                found.append(Choice(name, values, False))
    return tuple(found)


def with_effects(model: Model, choices: Sequence[Choice], on: Collection[str]) -> Model:
    """Return the model with those of the `choices` that are `on`, by name, and no others."""
    return replace(model, effects={choice.name: choice.values for choice in choices if choice.name in on})


def first_on(choices: Sequence[Choice]) -> frozenset[str]:
    """Return the names of the `choices` that are on when the view opens: the model's that it can show."""
    return frozenset(choice.name for choice in choices if choice.in_model and not choice.why_not)


def _why_not(effect: Effect, plant: PlantKind, *, measured: bool) -> str:
    if plant in effect.refused_by:
        return f"the {plant} plant cannot simulate it"
    if not effect.acts_in(plant):
        return f"the {plant} plant has nothing that it acts on"
    if not measured and not effect.changes_motion:
        return "it changes what is measured, not the motion; a replay of a log shows it"
    return ""


def _seen_on_one_wheel(effect: Effect, values: Values, model: Model) -> bool:
    """Return whether an effect of these sizes changes the wheel on the bench, which is none of the four."""
    if effect.change_drive is None:
        return True
    drive = drive_parameters(model)
    return effect.change_drive(drive, effect.complete(values, model), None) != drive
