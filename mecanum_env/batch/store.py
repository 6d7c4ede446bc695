"""The parameters of many robots: a table of numbers, and views of it by name for the functions of `law`."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.batch.arrays import Arrays, OnArrays
from mecanum_env.batch.numbers import BODY, PlanarRobot
from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.parameters import CHAIN
from mecanum_env.wheel_drive.parts import Parts

_EACH_STEP: Final = (*COEFFICIENTS, "servo_n_m_s_rad", "inertia_kg_m2", "torque_limit_n_m", "rotor_kg_m2")
"""Parameters of each physics step: plain numbers while all robots agree, which saves memory traffic."""


class Store(OnArrays):
    """Parameters of n robots, at first those of `common`."""

    def __init__(self, common: PlanarRobot, n: int, arrays: Arrays) -> None:
        super().__init__(arrays)
        self.programs = common.programs
        self._first = (common.drives[:, 0].copy(), common.body.copy())
        self._agree = np.all(common.drives == common.drives[:, :1], axis=1), np.ones(len(BODY), bool)
        self._drives = self._array(np.repeat(common.drives[:, :, None], n, axis=2))
        self._bodies = self._array(np.repeat(common.body[:, None], n, axis=1))
        self._has_program = {name: any(program) for name, program in self.programs.items()}
        self._largest = common.drives.max(axis=1)
        self.parts = self._parts_of(self._largest)
        self._look()

    def put(self, rows: npt.NDArray[np.intp], robots: list[PlanarRobot]) -> None:
        """Give the `rows` these robots, one each.

        Raises:
            InputError: they have other custom effects than the common robot.
        """
        if any(robot.programs != self.programs for robot in robots):
            raise InputError("robots of one batch must have the same custom effects")
        drives = np.stack([robot.drives for robot in robots], axis=-1)
        bodies = np.stack([robot.body for robot in robots], axis=-1)
        at = self._array(rows)
        self._drives[:, :, at], self._bodies[:, at] = self._array(drives), self._array(bodies)
        largest = np.maximum(self._largest, drives.max(axis=(1, 2)))
        # What any robot had stays a part, so that the others do not change.
        if not np.array_equal(largest > 0.0, self._largest > 0.0):
            self.parts = self._parts_of(largest)
        self._largest = largest
        agree, body_agrees = self._agree
        still = agree & np.all(drives == self._first[0][:, None, None], axis=(1, 2))
        body_still = body_agrees & np.all(bodies == self._first[1][:, None], axis=1)
        # The views show new numbers by themselves.
        if not (np.array_equal(still, agree) and np.array_equal(body_still, body_agrees)):
            self._agree = still, body_still
            self._look()

    def _parts_of(self, largest: FloatArray) -> Parts:
        """Return the parts of drives whose largest parameters are `largest`, (P,)."""
        return Parts.of(dict(zip(CHAIN, largest.tolist(), strict=True)), self._has_program, self._xp)

    def __setstate__(self, kept: dict[str, Any]) -> None:
        """Make views of the tables in `kept`: those of a copy or a pickle are tables of their own."""
        vars(self).update(kept)
        self._look()

    def _look(self) -> None:
        """Bring the views up to date."""
        agree = dict(zip(CHAIN, self._agree[0].tolist(), strict=True))
        first = dict(zip(CHAIN, self._first[0].tolist(), strict=True))
        self.p: dict[str, Any] = {
            name: first[name] if agree[name] and name in _EACH_STEP else self._drives[i]
            for i, name in enumerate(CHAIN)
        }
        self.p |= self.programs
        self.body: dict[str, Any] = {
            name: float(self._first[1][i]) if self._agree[1][i] else self._bodies[i]
            for i, name in enumerate(BODY)
        }
        simple = BODY.index("is_simple")
        self.all_simple = bool(self._agree[1][simple] and self._first[1][simple])
        self.none_simple = bool(self._agree[1][simple] and not self._first[1][simple])
        axes = [BODY.index(name) for name in ("gravity_x", "gravity_y")]
        self.slopes = not all(self._agree[1][i] and self._first[1][i] == 0.0 for i in axes)
        """Whether gravity pulls any robot along the floor."""
        friction = [BODY.index(name) for name in ("rub", "drag")]
        self.rollers = not all(self._agree[1][i] and self._first[1][i] == 0.0 for i in friction)
        """Whether the rollers of any robot have friction."""
