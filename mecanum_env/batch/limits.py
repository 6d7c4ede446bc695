"""Limits on the commands of many robots as a whole: `mecanum_env.simulator.body_limits` for a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from mecanum_env.batch.arrays import Arrays, OnArrays
from mecanum_env.batch.latches import LINK, Latches
from mecanum_env.batch.numbers import PlanarRobot
from mecanum_env.batch.set_points import due_at
from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError
from mecanum_env.kinematics import body_to_wheels
from mecanum_env.units import FloatArray


class BatchLimits(OnArrays):
    """Wheel commands sent to n robots -> those of their drives; all have the limits that `common` has."""

    def __init__(self, common: PlanarRobot, n: int, arrays: Arrays) -> None:
        super().__init__(arrays)
        array, self._clocks = arrays.array, common.clocks
        self._latches = Latches(n, common.clocks.command_period_s, arrays)
        self._ticks = np.zeros(n)
        self._values = {name: {one: np.zeros(n) for one in values} for name, values in common.limits.items()}
        self._mixing = array(body_to_wheels(np.eye(3)).T)  # (4, 3)
        self._body, self._wheels = array(np.zeros((3, n))), array(np.zeros((4, n)))

    def restart(self, rows: npt.NDArray[np.intp], robots: list[PlanarRobot]) -> None:
        """Begin an episode in some `rows`, each with its robot of `robots`.

        Raises:
            InputError: a robot with other limits than the common one.
        """
        if any(robot.limits.keys() != self._values.keys() for robot in robots):
            raise InputError("robots of one batch must have the same limits on the body's command")
        self._latches.take(rows, {name: np.array([one.link[name] for one in robots]) for name in LINK})
        self._latches.restart(rows)
        for effect, values in self._values.items():
            for name, kept in values.items():
                kept[rows] = [robot.limits[effect][name] for robot in robots]
        self._acting = {
            effect: {name: self._array(kept) for name, kept in values.items()}
            for effect, values in self._values.items()
        }
        self._ticks[rows] = 0.0
        at = self._array(rows)
        self._body, self._wheels = self._body + 0.0, self._wheels + 0.0  # they may be other robots' results
        self._body[:, at] = self._wheels[:, at] = 0.0

    def step(self, wheels: Any, steps: FloatArray) -> Any:
        """Return the drives' commands [rpm], (4, n), in the physics step after `steps` others, shape (n,).

        `wheels` are the rounded commands that are sent now, (4, n).
        """
        now, tau = steps * self._clocks.timestep_s, self._clocks.sample_period_s
        any_due, due = due_at(now, self._latches.count, self._clocks.command_period_s)
        if any_due:
            self._latches.latch(due, wheels, lambda sent, _: sent)
        any_due, due = due_at(now, self._ticks, tau)
        if any_due:
            asked = sum(part * command for part, command in self._latches.held(self._ticks * tau, tau))
            body = self._mixing.T @ asked / 4.0
            opposed, mean = asked - self._mixing @ body, body
            for name, values in self._acting.items():
                limit = CATALOGUE[name].limit_bodies
                assert limit is not None  # `planar_robot` has refused such an effect
                body, mean = limit(body, self._body, values, tau)
            limited = self._mixing @ mean + opposed
            here = None if due is None else self._array(due)
            self._body = body if here is None else self._xp.where(here, body, self._body)
            self._wheels = limited if here is None else self._xp.where(here, limited, self._wheels)
            self._ticks = self._ticks + 1.0 if due is None else self._ticks + due
        return self._wheels
