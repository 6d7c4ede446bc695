"""The opponents that a planner expects that is told none, and the chance that a strike of theirs misses.

Nothing that a robot sees before the hit tells how its opponent leads the aim and how far it reaches. A plan
that is best against one form of the lead may be one that another form hits, so plans are scored by the mean
over several opponents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from mecanum_env.tankendo import Opponent
from mecanum_env.tankendo.constants import LeadForm
from mecanum_env.units import FloatArray
from training.controllers.strike import RobotStates, miss_margin

_FORMS: Final[tuple[tuple[float, LeadForm], ...]] = (
    (0.5, "adaptive"),
    (0.25, "constant_velocity"),
    (0.25, "none"),
)
"""Probability of each form of the lead: the shares in which trainings draw them."""
_REACHES_M: Final = (0.0, 0.08)
"""Additions to the reach, each as probable: the usual one, and the largest that people are assumed to have
(`mecanum_env.tankendo.opponents.PARAMETERS`)."""


@dataclass(frozen=True)
class ExpectedOpponent:
    """An opponent that may be the one met."""

    probability: float
    opponent: Opponent


def expected_opponents(usual: Opponent) -> tuple[ExpectedOpponent, ...]:
    """Return the opponents to expect where one is met that is like the `usual` one but for lead and reach."""
    return tuple(
        ExpectedOpponent(share / len(_REACHES_M), replace(usual, lead_form=form, extra_reach_m=reach_m))
        for share, form in _FORMS
        for reach_m in _REACHES_M
    )


def miss_probability(
    expected: Sequence[ExpectedOpponent],
    technique: npt.NDArray[np.intp],
    origin: FloatArray,
    seen: RobotStates,
    landed: RobotStates,
    waiting: FloatArray,
    spread_m: float,
) -> FloatArray:
    """Return the probability that strikes miss the robots, in the shape of the robots' arrays.

    Args:
        expected: the opponents that may strike; they differ in lead and reach alone.
        technique: as `miss_margin` takes it, like the four arguments after it.
        origin: where the opponent stood.
        seen: the robots when they were last seen.
        landed: the robots when the strikes land.
        waiting: velocity of the robot when the sword rose.
        spread_m: standard deviation of the margin [m].
    """

    def of(one: ExpectedOpponent) -> FloatArray:
        margin = miss_margin(one.opponent, technique, origin, seen, landed, waiting)
        return np.asarray(one.probability * ndtr(margin / spread_m), float)

    return np.asarray(sum(of(one) for one in expected), float)
