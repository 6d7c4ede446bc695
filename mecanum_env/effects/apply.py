"""Putting a model's effects into a simulation; always in the order of the chain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.definition import Channels, Effect, PlantKind
from mecanum_env.errors import EffectRefusedError, InputError
from mecanum_env.law.drive import DriveParameters
from mecanum_env.model import Model
from mecanum_env.units import FloatArray


def active_effects(model: Model) -> Iterator[tuple[Effect, dict[str, float]]]:
    """Yield the model's effects that are not neutral, with all their parameters."""
    for name, effect in CATALOGUE.items():
        if name in model.effects and not effect.is_neutral(model.effects[name], model):
            yield effect, effect.complete(model.effects[name], model)


def check_effects(model: Model, plant: PlantKind) -> None:
    """Refuse a model with an effect that a plant would leave out, or with a value it cannot have.

    Args:
        model: its effects count.
        plant: where they are to act.

    Raises:
        EffectRefusedError: an effect that is not simulated (there).
        InputError: a parameter out of range.
    """
    for effect, values in active_effects(model):
        if not effect.simulated:
            known = ", ".join(name for name, known in CATALOGUE.items() if known.simulated)
            raise EffectRefusedError(
                f"effects.{effect.name}: not simulated yet (simulated: {known}); "
                "remove it from the model file to simulate without it"
            )
        if plant in effect.refused_by:
            raise EffectRefusedError(
                f"effects.{effect.name}: the {plant} plant cannot simulate it; use the rollers, or "
                "remove it from the model file to simulate without it"
            )
        for parameter in effect.parameters:
            value, (low, high) = values[parameter.name], parameter.valid
            if not parameter.simulated and value != parameter.neutral_in(model):
                raise InputError(f"effects.{effect.name}.{parameter.name}: not simulated yet, leave it out")
            endless = math.isinf(value) and value != parameter.neutral_in(model)
            if not low <= value <= high or endless:
                raise InputError(
                    f"effects.{effect.name}.{parameter.name} = {value:g}, "
                    f"must be a number {low:g} .. {high:g}"
                )


def changed_model(model: Model, plant: PlantKind) -> Model:
    """Return the model with the effects that are other numbers in its sections put there, unlisted.

    Args:
        model: as read from its file.
        plant: where the effects are to act.

    Raises:
        EffectRefusedError: as `check_effects`, or an effect that acts before the wheels' commands.
        InputError: as `check_effects`.
    """
    check_effects(model, plant)
    changed = model
    for effect, values in active_effects(model):
        if effect.limit_body is not None and effect.acts_in(plant):
            raise EffectRefusedError(
                f"effects.{effect.name}: acts on the robot's command, not in its physics; drive the robot "
                "through mecanum_env.simulator, or remove it from the model file"
            )
        if effect.change_model is not None and effect.acts_in(plant):
            left = {name: kept for name, kept in changed.effects.items() if name != effect.name}
            with _named(effect):
                changed = replace(effect.change_model(changed, values), effects=left)
    return changed


def change_spec(spec: mujoco.MjSpec, model: Model, plant: PlantKind) -> None:
    """Write the effects that are MuJoCo's own parts into the finished spec of a plant.

    Args:
        spec: written in place.
        model: the one it was made from, as `changed_model` returned it.
        plant: what the spec is.
    """
    for effect, values in active_effects(model):
        if effect.change_spec is not None and effect.acts_in(plant):
            effect.change_spec(spec, values, model, plant)


def drive_parameters(model: Model, wheel_name: str | None = None) -> DriveParameters:
    """Return the drive of one wheel, with the effects that act in it.

    Args:
        model: wheel and effects.
        wheel_name: fl, fr, rl or rr; None for the common one.

    Raises:
        InputError: an effect asks for what a drive cannot do; the message names the effect.
    """
    law = model.wheel.law if wheel_name is None else model.law_of(wheel_name)
    drive = DriveParameters.from_wheel(replace(model.wheel, law=law))
    for effect, values in active_effects(model):
        if effect.change_drive is not None:
            with _named(effect):
                drive = effect.change_drive(drive, values, wheel_name)
    return drive


def without_sensors(model: Model) -> Model:
    """Return the model without the effects that act on the measurement only: what happens is the same."""
    kept = {n: values for n, values in model.effects.items() if not CATALOGUE[n].measured_only}
    return replace(model, effects=kept)


def measured(model: Model, time_s: FloatArray, channels: Channels) -> dict[str, FloatArray]:
    """Return what the sensors make of a motion.

    Args:
        model: its effects count.
        time_s: uniform clock (n,) [s].
        channels: column of a log -> true values (n,) on that clock.
    """
    shown = dict(channels)
    for effect, values in active_effects(model):
        if effect.change_channels is not None:
            shown = effect.change_channels(time_s, shown, values)
    return shown


@contextmanager
def _named(effect: Effect) -> Iterator[None]:
    """Say in an error within the block which effect it is about."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"effects.{effect.name}: {error}") from error
