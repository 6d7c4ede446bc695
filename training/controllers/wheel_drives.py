"""The drives of a robot's four wheels, and what they make of commands, all four at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.kinematics import WHEELS
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.parameters import PROGRAMS
from mecanum_env.wheel_drive.program import PROGRAM_SIZE
from mecanum_env.wheel_drive.set_point import map_numbers
from mecanum_env.wheel_drive.shaping import rounded, shaped


@dataclass(frozen=True, eq=False)
class WheelDrives:
    """The drives of the wheels fl, fr, rl and rr; they round V, theta and VC, and not wheel by wheel."""

    each: tuple[DriveParameters, ...]

    @classmethod
    def of(cls, model: Model) -> WheelDrives:
        """Return the drives of a model, with the effects that act in them."""
        return cls(
            tuple(replace(drive_parameters(model, wheel), command_quantum_rpm=0.0) for wheel in WHEELS)
        )

    @property
    def without_dead_bands(self) -> WheelDrives:
        """The same drives without dead bands."""
        return WheelDrives(tuple(replace(drive, deadband_rpm=0.0) for drive in self.each))

    def received(self, wheels_rpm: FloatArray, seconds: float) -> FloatArray:
        """Return wheel commands, shape (4,) or (4, n), after the drives' effects at a time since the start.

        A ceiling of the supply counts as one of the command.
        """
        p = self._numbers
        sent = np.reshape(np.asarray(wheels_rpm, float), (len(self.each), -1))
        wanted = shaped(p, rounded(sent, 0.0), seconds)
        limited = np.minimum(np.maximum(wanted, -p["supply_rpm"]), p["supply_rpm"])
        return np.reshape(limited, np.shape(wheels_rpm))

    @cached_property
    def _numbers(self) -> dict[str, Any]:
        """The drives' parameters by name: numbers if they are equal, otherwise columns, shape (4, 1)."""
        rows = [{**vars(one), **map_numbers(one.knots_rpm, one.values_rpm)} for one in self.each]
        if all(one == self.each[0] for one in self.each):
            return rows[0]
        numbers = [name for name, value in rows[0].items() if isinstance(value, float | int)]
        columns: dict[str, Any] = {name: np.array([[row[name]] for row in rows], float) for name in numbers}
        for name in PROGRAMS:
            columns[name] = np.zeros((len(rows), PROGRAM_SIZE))
            for padded, row in zip(columns[name], rows, strict=True):
                padded[: len(row[name])] = row[name]
        return columns
