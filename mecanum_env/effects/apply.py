"""Putting a model's effects into a simulation, always in the order of the chain."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.definition import Channels, Effect, Load, PlanarBody, PlantKind
from mecanum_env.errors import EffectRefusedError, InputError
from mecanum_env.kinematics import WHEELS
from mecanum_env.model import Model, Robot
from mecanum_env.model.custom import program_at
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.program import Program, evaluate

if TYPE_CHECKING:
    import mujoco


Acting = tuple[tuple[Effect, dict[str, float]], ...]
"""Effects that act, each with all its parameters."""
Sensors = Callable[[FloatArray, Channels], dict[str, FloatArray]]
"""Returns the channels as measured, given their uniform clock [s], shape (n,), and their true values."""

# The model that was asked for last, how many effects were known then, and its answer: to simulate a robot
# asks for them a dozen times, and a drawn robot is simulated in every episode.
_last: tuple[Model | None, int, Acting] = (None, 0, ())


def active_effects(model: Model) -> Acting:
    """Return the effects of a model that are not neutral, each with all its parameters."""
    global _last
    asked, known, found = _last
    if asked is not model or known != len(CATALOGUE):
        given = model.effects
        acting = ((CATALOGUE[name], given[name]) for name in CATALOGUE if name in given)
        full = ((effect, effect.acting(values, model)) for effect, values in acting)
        found = tuple((effect, values) for effect, values in full if values is not None)
        _last = model, len(CATALOGUE), found
    return found


def check_effects(model: Model, plant: PlantKind) -> None:
    """Refuse a model with an effect that a plant cannot simulate, or with an impossible value.

    Raises:
        EffectRefusedError: an effect that is not simulated at all, or not on this plant.
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
            where, value = f"effects.{effect.name}.{parameter.name}", values[parameter.name]
            (low, high), neutral = parameter.valid, parameter.neutral_in(model)
            if not low <= value <= high or (math.isinf(value) and value != neutral):
                raise InputError(f"{where} = {value:g}, must be a number {low:g} .. {high:g}")


def changed_model(model: Model, plant: PlantKind) -> Model:
    """Return the model for a plant with the effects that change its numbers written into its sections.

    Those that do nothing else are no longer listed in the result. The others stay, and change nothing when
    they are applied once more.

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
            with _named(effect):
                changed = effect.change_model(changed, values)
            if effect.change_drive is None and effect.change_spec is None:
                left = {name: kept for name, kept in changed.effects.items() if name != effect.name}
                changed = replace(changed, effects=left)
    return changed


def change_spec(spec: mujoco.MjSpec, model: Model, plant: PlantKind) -> None:
    """Write the effects that MuJoCo itself can express into the finished spec of a plant.

    The spec was made from this model, which `changed_model` returned.
    """
    for effect, values in active_effects(model):
        if effect.change_spec is not None and effect.acts_in(plant):
            effect.change_spec(spec, values, model, plant)


def planar_body(robot: Robot, acting: Acting) -> PlanarBody:
    """Return the planar plant's body of a robot on which effects are `acting`."""
    body = PlanarBody(robot.mass_kg, robot.yaw_inertia_kg_m2)
    for effect, values in acting:
        if effect.change_planar is not None:
            body = effect.change_planar(body, values)
    return body


def drive_parameters(model: Model, wheel_name: str | None = None) -> DriveParameters:
    """Return the drive of the wheel fl, fr, rl or rr, or the common one, with the effects that act in it.

    Raises:
        InputError: an effect needs something that a drive cannot do; the message names the effect.
    """
    law = model.wheel.law if wheel_name is None else model.law_of(wheel_name)
    wheel = model.wheel if law is model.wheel.law else replace(model.wheel, law=law)
    drive = changed_drive(wheel.drive_parameters(), active_effects(model), wheel_name)
    if not model.custom:
        return drive
    return replace(
        drive,
        command_program=program_at(model.custom, "command"),
        set_point_program=program_at(model.custom, "set_point"),
        load_program=program_at(model.custom, "load"),
    )


def changed_drive(drive: DriveParameters, acting: Acting, wheel_name: str | None) -> DriveParameters:
    """Return a drive with what the effects that are `acting` change in it.

    `wheel_name` is as for `drive_parameters`, whose rules hold.
    """
    for effect, values in acting:
        if effect.change_drive is not None:
            with _named(effect):
                drive = effect.change_drive(drive, values, wheel_name)
    return drive


def wheels_differ(model: Model) -> bool:
    """Return whether the drives of a model's four wheels may have different numbers."""
    return bool(model.wheels) or any(
        effect.change_drive is not None and any(p.name.endswith(WHEELS) for p in effect.parameters)
        for effect, _ in active_effects(model)
    )


def delayed(model: Model, seconds: float) -> Model:
    """Return the model with commands that act later by some seconds, in the form of latency that it has."""
    name = next(
        (one for one in model.effects if CATALOGUE[one].cause == "command_latency"), "command_latency"
    )
    values = dict(model.effects.get(name, {}))
    return model.with_effect(name, **{**values, "delay_s": values.get("delay_s", 0.0) + seconds})


def alters_sensors(model: Model) -> bool:
    """Return whether effects act on what a robot measures of itself."""
    return any(effect.change_channels is not None for effect, _ in active_effects(model))


def added_load(model: Model) -> Load:
    """Return what the effects of a model add to the robot's mass and to the friction of each wheel."""
    loads = (effect.load(values) for effect, values in active_effects(model) if effect.load is not None)
    return sum(loads, start=Load())


def without_sensors(model: Model) -> Model:
    """Return the model without the effects that only change the measurement: it moves the same."""
    known = {name: CATALOGUE[name] for name in model.effects}
    kept = [name for name, effect in known.items() if effect.changes_motion or not effect.simulated]
    custom = tuple(effect for effect in model.custom if effect.station != "sensor")
    if len(kept) == len(model.effects) and len(custom) == len(model.custom):
        return model
    return replace(model, effects={name: model.effects[name] for name in kept}, custom=custom)


def measured(model: Model, time_s: FloatArray, channels: Channels) -> dict[str, FloatArray]:
    """Return the channels of a motion as the model's sensors show them, given the true ones.

    The channels are columns of a log by name, shape (n,), on the uniform clock `time_s` (n,) [s], whose 0 is
    the start of the motion.
    """
    return sensors_of(model)(time_s, channels)


def sensors_of(model: Model) -> Sensors:
    """Return the sensors of a model, as a function that does what `measured` does."""
    acting = [(e.change_channels, values) for e, values in active_effects(model) if e.change_channels]
    program = program_at(model.custom, "sensor")

    def read(time_s: FloatArray, channels: Channels) -> dict[str, FloatArray]:
        shown = _with_custom(program, time_s, channels) if program else dict(channels)
        for change, values in acting:
            shown = change(time_s, shown, values)
        return shown

    return read


def _with_custom(program: Program, time_s: FloatArray, channels: Channels) -> dict[str, FloatArray]:
    """Add the value of a custom effect, which is that of the true motion, to each wheel speed."""
    shown = dict(channels)
    for name, speed in channels.items():
        if name.startswith("speed_"):
            turned = np.diff(time_s, prepend=time_s[:1]) * speed * RAD_S_PER_RPM
            given = {"speed": speed, "angle": np.cumsum(turned), "time": time_s}
            shown[name] = speed + evaluate(program, given)
    return shown


def in_turned_axes(model: Model, yaw_rad: float) -> Model:
    """Return the model with directions in the world counted from axes that are turned by `yaw_rad`."""
    turned = {
        name: effect.turned(values, yaw_rad)
        for name, values in model.effects.items()
        if (effect := CATALOGUE[name]).turned is not None
    }
    return replace(model, effects={**model.effects, **turned}) if turned and yaw_rad != 0.0 else model


@contextmanager
def _named(effect: Effect) -> Iterator[None]:
    """Name the effect in any input error of the block."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"effects.{effect.name}: {error}") from error
