"""What the paper itself suspects, fitted alone and together: load, rolling friction, latency, saturation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.paper_gap.drives import DRIVES, PAPER, turn_losses
from sysid.paper_gap.sets import Fitter, SetFit

_CEILING: Final = (("speed_saturation", "softness_rpm"),)
_FRICTION: Final = ("coulomb_friction", "viscous_friction")
ALL_SOFT: Final = "all, saturation a soft knee"
"""Title of the suspects together."""
TURN: Final = len(DRIVES) - 1
"""Which of the six figures is the turn's loss."""
TURN_SPEEDS_RPM: Final = np.array([5.0, *range(10, 131, 10)])
"""Wheel speeds at which turns are looked at: the text does not print that of its turn."""
INTEGRAL_N_M_RAD: Final = 50.0
"""Of a drive with integral action."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """One of the paper's suspects, or several, at their best."""

    title: str
    fit: SetFit


@dataclass(frozen=True, eq=False)
class Turn:
    """All suspects fitted to everything but the turn, and what they then make of it."""

    fit: SetFit
    losses: FloatArray
    """At `TURN_SPEEDS_RPM`."""


def suspects(base: Model) -> list[Suspect]:
    """Fit the paper's suspects to its six figures.

    Sensor latency is in none of the sets: it moves no figure, whatever is beside it.

    Args:
        base: the paper's model.
    """
    plain, ceiling = Fitter(base), Fitter(base, neutral=_CEILING)
    integral = Fitter(with_integral(base))
    together = ("speed_saturation", "coulomb_friction", "viscous_friction", "payload")
    return [
        Suspect("load", plain.built(["payload"])),
        Suspect("sensor latency", plain.built(["sensor_latency"])),
        Suspect("rolling friction", plain.built(_FRICTION)),
        Suspect("saturation, a ceiling", ceiling.built(["speed_saturation"])),
        Suspect("saturation, a soft knee", plain.built(["speed_saturation"])),
        Suspect("load and rolling friction", plain.built([*_FRICTION, "payload"])),
        Suspect("all, saturation a ceiling", ceiling.built(together)),
        Suspect(ALL_SOFT, plain.built(together)),
        Suspect("the same, a drive with integral action", integral.built(together)),
    ]


def suspects_turning(base: Model) -> Turn:
    """Fit all suspects to what the paper prints of straight drives, and look at turns at all speeds.

    Args:
        base: the paper's model.
    """
    counted = np.ones(PAPER.size)
    counted[TURN] = 0.0
    fitter = Fitter(base, counted=counted)
    found = fitter.built(("speed_saturation", "coulomb_friction", "weak_servo"))
    return Turn(found, turn_losses(fitter.model(found.chosen, found.place), TURN_SPEEDS_RPM))


def with_integral(base: Model) -> Model:
    """Return the model with integral action in its drives."""
    return replace(base, robot=replace(base.robot, servo_integral_n_m_rad=INTEGRAL_N_M_RAD))
