"""The last stage of a fit to robot logs: on the rollers, where the model will be used.

The stages before it work on the planar plant, which is much faster and has no slip. A law and a servo that
are right there are a little wrong on the rollers, which take up torque and slip. Here law, servo and yaw
inertia are moved until the robot on its rollers does what the fit runs say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.fitted import fit
from sysid.gap.law_again import LawAgain
from sysid.gap.noise import measure_noise
from sysid.gap.observations import observe
from sysid.gap.problem import Problem
from sysid.gap.simulator import without_engine_warnings
from sysid.gap.subset import liveliest
from sysid.gap.whitening import Whitener
from sysid.logs import Dataset, Run

SECONDS: Final = 30.0
"""Of log that is simulated, of each split."""
_FACTOR: Final = 3.0  # by which a robot's parameter may move
_SIMULATIONS: Final = 20


@dataclass(frozen=True)
class LawAndRobot:
    """The law's five free numbers and some of the robot's, each 0 .. 1."""

    law: LawAgain
    robot: tuple[str, ...]
    """Names of the robot's parameters that move."""

    @property
    def names(self) -> tuple[str, ...]:
        """What it is, for a message."""
        return (*self.law.names, *self.robot)

    @property
    def parameter_count(self) -> int:
        """Free numbers."""
        return self.law.parameter_count + len(self.robot)

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """None of them jumps."""
        return (False,) * self.parameter_count

    @property
    def owners(self) -> tuple[str, ...]:
        """None of them belongs to an effect."""
        return ("",) * self.parameter_count

    def start(self) -> FloatArray:
        """Return the place of the model as it is."""
        return np.concatenate([self.law.start(), np.full(len(self.robot), 0.5)])

    def model(self, base: Model, unit: Sequence[float] | FloatArray) -> Model:
        """Return the `base` model at a place `unit`, shape (5 + robot,)."""
        places = np.asarray(unit, float)
        count = self.law.parameter_count
        factors = _FACTOR ** (2.0 * places[count:] - 1.0)
        moved: dict[str, Any] = {
            name: getattr(base.robot, name) * float(factor)
            for name, factor in zip(self.robot, factors, strict=True)
        }
        return replace(self.law.model(base, places[:count]), robot=replace(base.robot, **moved))


def on_rollers(model: Model, dataset: Dataset, robot: Sequence[str]) -> tuple[Model, str]:
    """Return a model that is right on the rollers, and a sentence; the model as it was if that is no better.

    Args:
        model: fitted on the planar plant.
        dataset: robot logs; fit runs decide, validation runs check.
        robot: names of the robot's parameters that may move.
    """
    runs = dataset.split("fit")
    candidate = LawAndRobot(LawAgain(model), tuple(robot))
    plain = replace(model, uncertainty={})
    with without_engine_warnings():
        problem = _problem(plain, dataset, runs)
        found = fit(problem, candidate, candidate.start(), most=_SIMULATIONS)
        if found is None:
            return model, "the law was not fitted on the rollers: they cannot be simulated with it"
        check = _problem(plain, dataset, dataset.split("validation") or runs)
        moved = candidate.model(plain, found.place)
        after = check.residual(moved)
    if after is None or float(after @ after) >= float(check.base_residual @ check.base_residual):
        return model, "law and servo fitted again on the rollers predict validation runs no better: left"
    share = float(np.linalg.norm(after) / np.linalg.norm(check.base_residual))
    return replace(moved, uncertainty=model.uncertainty), (
        f"law{''.join(', ' + name for name in robot)} fitted again on the rollers: there the error on "
        f"validation runs is {share:.0%} of what it is with the planar plant's"
    )


def _problem(model: Model, dataset: Dataset, runs: Sequence[Run]) -> Problem:
    observations = observe(replace(dataset, runs=liveliest(runs, SECONDS)))
    return Problem(model, Whitener(observations, measure_noise(dataset, observations), None))
