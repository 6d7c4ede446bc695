"""Robots that differ in some numbers, such as those drawn for episodes: computed for a batch all at once.

The formulas are those of one robot (`planar_robot`), which take an array of each number that differs. Some do
not: lengths of the wheel, which are searched for, and choices by the size of a number. So robots are computed
at once only if this gives the first few of them to the bit, and otherwise one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from mecanum_env.batch.numbers import (
    CHANCE,
    ROTOR,
    PlanarRobot,
    body_numbers,
    planar_robot,
)
from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import active_effects, changed_drive, wheels_differ
from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.mjcf.masses import spin_inertia, surely_possible
from mecanum_env.model import Model, Robot
from mecanum_env.plugin.layout import drive_numbers
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.many import Laws, several

LAW: Final = tuple(f"law.{name}" for name in COEFFICIENTS)
"""Names of what is added to the coefficients of a robot's laws; their gain is kept (`WheelLaw.moved`)."""
ModelOf = Callable[[FloatArray], Model]
"""Makes the model of a robot from its numbers (k,)."""


# Parts of a model whose numbers may be arrays (m,), those of many robots. The parts of a single robot check
# their numbers; of drawn robots the ends of the ranges have been checked.
class _Models(Model):
    def __post_init__(self) -> None: ...


class _Robots(Robot):
    def __post_init__(self) -> None: ...


class Variations:
    """Makes robots for a batch that differ from a `model` in the numbers with some `names`, k of them.

    The names are those in `LAW`, "wheel.saturation_rpm", "robot.NAME" or "effects.EFFECT.PARAMETER", as in a
    model file, and `model_of` makes the model with such numbers. With the `first` robots, shape (k, m), it is
    tried whether all can be computed at once; all have the effects of the first one. `timestep_s` is that of
    `planar_robot`.

    Raises:
        InputError: one of the first robots cannot be simulated.
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        model_of: ModelOf,
        first: FloatArray,
        timestep_s: float | None = None,
    ) -> None:
        self._common, self._names, self._model_of = model, tuple(names), model_of
        self._timestep_s = timestep_s
        robots = self._one_by_one(first)
        self._typical, self._model = robots[0], robots[0].model
        # By name, since effects cannot be pickled.
        self._acting = [effect.name for effect, _ in active_effects(self._model)]
        self._wheels = WHEELS if wheels_differ(self._model) else (None,)
        self.at_once = first.shape[1] > 1 and self._agrees(first, robots)
        """Whether robots are computed at once."""

    def robots(self, values: FloatArray) -> list[PlanarRobot]:
        """Return the robots with the numbers `values`, shape (k, m).

        Raises:
            InputError: one of them cannot be simulated.
        """
        if not self.at_once:
            return self._one_by_one(values)
        m = values.shape[1]
        try:
            # Two of a single one: some functions take an array of one number for the number.
            drives, bodies = self._numbers(values if m > 1 else np.repeat(values, 2, axis=1))
        except (TypeError, ValueError, InputError):
            # A robot that cannot be is refused by its own number.
            return self._one_by_one(values)
        random = np.any(drives[CHANCE] != 0.0, axis=(0, 1)).tolist()
        common = self._typical
        return [
            PlanarRobot(
                partial(self._model_of, values[:, i].copy()),
                common.clocks,
                drives[:, :, i],
                common.programs,
                bodies[:, i],
                common.link,
                common.limits,
                random[i],
                common.alters_sensors,
            )
            for i in range(m)
        ]

    def _one_by_one(self, values: FloatArray) -> list[PlanarRobot]:
        return [planar_robot(self._model_of(one), self._timestep_s) for one in values.T]

    def _agrees(self, values: FloatArray, robots: Sequence[PlanarRobot]) -> bool:
        """Return whether the robots with `values` (k, m), computed at once, equal `robots` to the bit."""
        if self._model.custom or any(
            robot.limits or robot.clocks != self._typical.clocks for robot in robots
        ):
            return False
        try:
            drives, bodies = self._numbers(values)
        except (TypeError, ValueError, InputError):
            return False
        return all(
            np.array_equal(drives[:, :, i], robot.drives) and np.array_equal(bodies[:, i], robot.body)
            for i, robot in enumerate(robots)
        )

    def _numbers(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the drives, shape (P, 4, m), and the bodies, (23, m), of robots with `values` (k, m)."""
        given = dict(zip(self._names, values, strict=True))
        model = self._models(given)
        acting = tuple(
            (CATALOGUE[name], CATALOGUE[name].complete(model.effects[name], model)) for name in self._acting
        )
        for effect, full in acting:
            if effect.change_model is not None and effect.acts_in("planar"):
                model = effect.change_model(model, full)
        robot = model.robot
        if not np.all(surely_possible(robot)):
            raise InputError("robot.yaw_inertia_kg_m2 may be less than the wheels alone have at their places")
        geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
        inertia = spin_inertia(robot.mass_kg, geometry)
        # What is no array is as it is of the first robot.
        drives = np.repeat(self._typical.drives[:, :, None], values.shape[1], axis=2)
        for i, wheel in enumerate(self._wheels):
            drive = changed_drive(self._drives(given, wheel), acting, wheel)
            found = drive_numbers(robot, drive, 0.0, inertia_kg_m2=inertia)
            for row, number in zip(drives, found.chain, strict=True):
                if isinstance(number, np.ndarray):
                    row[slice(None) if wheel is None else i] = number
        bodies = body_numbers(robot, acting, self._typical.clocks.timestep_s, inertia + drives[ROTOR, 0])
        return drives, bodies

    def _models(self, given: Mapping[str, Any]) -> Model:
        """Return the models with the numbers that are `given` by name, as one."""
        robot: dict[str, Any] = {}
        effects = {name: dict(values) for name, values in self._model.effects.items()}
        for name, numbers in given.items():
            section, *rest = name.split(".")
            if section == "robot":
                robot[rest[0]] = numbers
            elif section == "effects":
                effects[rest[0]][rest[1]] = numbers
        own = vars(self._model)
        return _Models(**{**own, "robot": _Robots(**{**vars(own["robot"]), **robot}), "effects": effects})

    def _drives(self, given: Mapping[str, Any], wheel: str | None) -> DriveParameters:
        """Return the drives of a wheel of all robots without any effect, as one."""
        law = self._common.wheel.law if wheel is None else self._common.law_of(wheel)
        if LAW[0] in given:
            law = Laws(**vars(law)).moved([given[name] for name in LAW])
        drive = self._model.wheel.drive_parameters()
        limit = given.get("wheel.saturation_rpm", drive.saturation_rpm)
        return several(drive, law=law, saturation_rpm=limit)
