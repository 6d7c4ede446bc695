"""Planar plants that differ in their numbers alone: written over a compiled one instead of compiled anew."""

from __future__ import annotations

import copy

import mujoco

from mecanum_env.effects.apply import active_effects, changed_model, wheels_differ
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.physics import wheel_inertia
from mecanum_env.mjcf.plants import planar_numbers
from mecanum_env.model import Model
from mecanum_env.plugin.layout import wheel_actuators, wheel_numbers


def is_rewritable(model: Model) -> bool:
    """Return whether all that effects do on the planar plant is in numbers that `PlanarTemplate` writes."""
    return not any(
        effect.change_spec is not None and effect.acts_in("planar") for effect, _ in active_effects(model)
    )


class PlanarTemplate:
    """A compiled planar plant whose copies get the numbers of other robots, bit for bit as if compiled.

    `mj_model` was compiled from `planar_spec` of a model that `is_rewritable`, with commands that are already
    rounded.
    """

    def __init__(self, mj_model: mujoco.MjModel) -> None:
        self._mj_model = mj_model
        self._scratch = mujoco.MjData(mj_model)
        self._actuators = wheel_actuators(mj_model)
        self._base = mj_model.body("base").id

    def with_numbers_of(self, model: Model) -> mujoco.MjModel | None:
        """Return a copy with the numbers of a model that `is_rewritable`; None: its arrays have other sizes.

        Its law and its commands have the periods of the compiled model.

        Raises:
            InputError: an effect that the plant cannot simulate, or an impossible inertia.
        """
        model = changed_model(model, "planar")
        inertia = wheel_inertia(model.robot)
        wheels = WHEELS if wheels_differ(model) else (None,)
        drives = [wheel_numbers(model, wheel, 0.0, inertia_kg_m2=inertia) for wheel in wheels]
        if any(len(drive.user) > self._mj_model.nuser_actuator for drive in drives):
            return None
        numbers, new = planar_numbers(model.robot, drives[0].rotor_kg_m2), copy.copy(self._mj_model)
        new.body_pos[self._base, 2] = model.robot.wheel_radius_m
        new.body_mass[self._base], new.body_inertia[self._base] = numbers.inertia
        new.dof_armature[:] = numbers.armature
        for i, (actuator, gear) in enumerate(zip(self._actuators, numbers.gears, strict=True)):
            new.actuator_gear[actuator] = gear
            drives[i % len(drives)].write(new, actuator)
        mujoco.mj_setConst(new, self._scratch)
        # What compiling does beside that: the means over joints and bodies.
        new.stat.meaninertia, new.stat.meanmass = new.dof_M0.mean(), numbers.inertia.mass
        return new
