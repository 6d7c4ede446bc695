"""How a drive answers a torque on its wheel: at once or late, for good or until integral action makes up.

A torque T on a wheel takes T / servo [rad/s] of its speed from a drive without integral action (`droop`); one
with integral action brings it back (`washed_out`). Both may answer late, as a rotor's inertia makes them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import Parameter, Values
from mecanum_env.model import Model
from mecanum_env.wheel_drive.drive import DriveParameters

ANSWER: Final = Parameter("answer_s", "s", None, (0.0, 0.3))
WASHOUT: Final = Parameter(
    "washout_s", "s", None, (0.02, 5.0), (1e-3, 1e6), default=0.3, scan=(0.05, 0.3, 1.5)
)


def answering(drive: DriveParameters, values: Values) -> DriveParameters:
    """Return a drive that answers its loads as late as the `values` of one say.

    Of several the latest answer counts.
    """
    answer_s = max(drive.load.answer_s, values["answer_s"])
    return replace(drive, load=replace(drive.load, answer_s=answer_s))


def rings(loads: Iterable[Values]) -> bool:
    """Return whether a drive answers its loads, given by the values of each, by ringing.

    Answer and wash-out make a second-order system with the damping ratio sqrt(washout_s / answer_s) / 2.
    Below a half, its step response overshoots by more than 16 %. Of several loads the latest answer and the
    strongest integral action count.
    """
    known = list(loads)
    answer_s = max((one.get("answer_s", 0.0) for one in known), default=0.0)
    return answer_s > min((one.get("washout_s", math.inf) for one in known), default=math.inf)


def washed_out(model: Model, values: Values) -> Model:
    """Return the model with the integral action that the `values` of a load ask for.

    Of several the strongest counts, the model's own included.
    """
    robot = model.robot
    action = max(robot.servo_integral_n_m_rad, robot.servo_n_m_s_rad / values["washout_s"])
    return replace(model, robot=replace(robot, servo_integral_n_m_rad=action))
