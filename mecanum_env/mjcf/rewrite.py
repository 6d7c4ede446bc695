"""Plants that differ in their numbers alone: written over a compiled one instead of compiled anew."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from typing import Any, Final

import mujoco

from mecanum_env.effects.apply import active_effects, changed_model, wheels_differ
from mecanum_env.effects.definition import RobotPlant
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.masses import Inertia, robot_masses
from mecanum_env.mjcf.physics import wheel_inertia
from mecanum_env.mjcf.plants import planar_numbers
from mecanum_env.model import Model
from mecanum_env.plugin.layout import WheelNumbers, wheel_actuators, wheel_numbers


def is_rewritable(model: Model, plant: RobotPlant) -> bool:
    """Return whether all that effects do on a plant is in numbers that its template writes."""
    return not any(
        effect.change_spec is not None and effect.acts_in(plant) for effect, _ in active_effects(model)
    )


class Template(ABC):
    """A compiled plant whose copies get the numbers of other robots, bit for bit as if compiled.

    `mj_model` was compiled for this `model`, which `is_rewritable`, with commands that are already rounded.
    """

    plant: RobotPlant
    fixed: tuple[str, ...] = ()
    """Numbers of the robot that say where its parts are, and must be those of the compiled one."""

    def __init__(self, model: Model, mj_model: mujoco.MjModel) -> None:
        self._model, self._mj_model = changed_model(model, self.plant), mj_model
        self._scratch = mujoco.MjData(mj_model)
        self._actuators = wheel_actuators(mj_model)
        self.spares: list[mujoco.MjModel] = []
        """Copies that nobody reads any more: a copy takes longer to make than to write."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: all but the spares."""
        return {**vars(self), "spares": []}

    def with_numbers_of(self, model: Model) -> mujoco.MjModel | None:
        """Return a copy with the numbers of a model that `is_rewritable`; None: more than those differs.

        Its law and its commands have the periods of the compiled model. The copy is a spare if there is one.

        Raises:
            InputError: an effect that the plant cannot simulate, or an impossible inertia.
        """
        model = changed_model(model, self.plant)
        if any(getattr(model.robot, name) != getattr(self._model.robot, name) for name in self.fixed):
            return None
        inertia = wheel_inertia(model.robot)
        wheels = WHEELS if wheels_differ(model) else (None,)
        drives = [wheel_numbers(model, wheel, 0.0, inertia_kg_m2=inertia) for wheel in wheels]
        if any(len(drive.user) > self._mj_model.nuser_actuator for drive in drives):
            return None
        new = self.spares.pop() if self.spares else copy.copy(self._mj_model)
        if len(drives) == 1:
            drives[0].write(new, self._actuators)
        else:
            for actuator, drive in zip(self._actuators, drives, strict=True):
                drive.write(new, actuator)
        self._write_body(new, model, drives)
        mujoco.mj_setConst(new, self._scratch)
        # What compiling does beside that: the means over joints and bodies.
        new.stat.meaninertia = sum(new.dof_M0.tolist()) / new.nv
        new.stat.meanmass = sum(new.body_mass.tolist()) / (new.nbody - 1)
        return new

    @abstractmethod
    def _write_body(self, mj_model: mujoco.MjModel, model: Model, drives: list[WheelNumbers]) -> None:
        """Write the body of a model, whose `drives` are one for all wheels or one for each."""


class PlanarTemplate(Template):
    """The template of the planar plant, on which dimensions are numbers, too."""

    plant = "planar"

    def __init__(self, model: Model, mj_model: mujoco.MjModel) -> None:
        super().__init__(model, mj_model)
        self._base = int(mj_model.body("base").id)

    def _write_body(self, mj_model: mujoco.MjModel, model: Model, drives: list[WheelNumbers]) -> None:
        numbers = planar_numbers(model.robot, drives[0].rotor_kg_m2)
        mj_model.body_pos[self._base, 2] = model.robot.wheel_radius_m
        _set_inertia(mj_model, [self._base], numbers.inertia)
        mj_model.dof_armature[:] = numbers.armature
        mj_model.actuator_gear[self._actuators] = numbers.gears


class RollersTemplate(Template):
    """The template of the robot on rollers: for robots of the same dimensions."""

    plant = "rollers"
    fixed = ("wheel_radius_m", "half_wheelbase_m", "half_track_m", "rollers_per_wheel")

    def __init__(self, model: Model, mj_model: mujoco.MjModel) -> None:
        super().__init__(model, mj_model)
        bodies = {mj_model.body(i).name: i for i in range(mj_model.nbody)}
        self._base, self._rocker = bodies["base"], bodies["rocker"]
        self._hubs = [bodies[f"wheel_{wheel}"] for wheel in WHEELS]
        self._rollers = [i for name, i in bodies.items() if "_roller_" in name]
        self._axles = [int(mj_model.joint(f"wheel_{wheel}").dofadr[0]) for wheel in WHEELS]

    def _write_body(self, mj_model: mujoco.MjModel, model: Model, drives: list[WheelNumbers]) -> None:
        masses = robot_masses(model.robot)
        for bodies, inertia in (
            ([self._base], masses.base),
            ([self._rocker], masses.rocker),
            (self._hubs, masses.hub),
            (self._rollers, masses.roller),
        ):
            _set_inertia(mj_model, bodies, inertia)
        mj_model.dof_armature[self._axles] = [drive.rotor_kg_m2 for drive in drives]
        # Both directions along the floor; turning and rolling have frictions of their own.
        mj_model.pair_friction[:, :2] = model.robot.friction


TEMPLATES: Final[dict[RobotPlant, type[Template]]] = {"planar": PlanarTemplate, "rollers": RollersTemplate}


def _set_inertia(mj_model: mujoco.MjModel, bodies: list[int], inertia: Inertia) -> None:
    mj_model.body_mass[bodies], mj_model.body_inertia[bodies] = inertia
