"""The paper's five drives and the six numbers that it prints of them, simulated for any model.

The numbers are the relative loss of steady speed at 10, 40, 80 and 130 rpm straight ahead and at 1.484
rad/s in place, and one rise time. The text does not say which drive it is of; here it is the mean of all
five.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import command_to_twist, round_command, twist_to_command
from mecanum_env.law.metrics import step_metrics
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, RobotPlant, Trajectory, compile_plant, drive
from mecanum_env.units import FloatArray
from sysid.studies.reproduce import published

DRIVES: Final = tuple(published.ROBOT_LOSS)
"""Names of the five drives."""
NUMBERS: Final = (*(f"loss, {name}" for name in DRIVES), "rise s")
"""Names of the six numbers."""
PAPER: Final = np.array([*published.ROBOT_LOSS.values(), published.ROBOT_RISE_S])
"""The six numbers as printed."""
TOLERANCE: Final = np.array([0.01] * len(DRIVES) + [0.01])
"""Largest deviation of a prediction from each number: of the losses, and of the rise time [s].

The losses are printed to three digits and the rise to two, without spread or number of repeats. A loss of
0.01 is 0.1 rpm at 10 rpm and 1.3 rpm at 130 rpm; commands are whole rpm."""
HOLD_S: Final = 3.0
"""Duration of each drive [s]; the mean of its last fifth is the steady speed."""
SEARCH_HOLD_S: Final = 1.2
"""Duration of each drive in a search, which looks for nothing slow [s]."""
_ROBOT: Final = paper_model().robot
TURN_RPM: Final = float(twist_to_command([0.0, 0.0, published.ROTATION_RAD_S], _ROBOT)[2])
"""VC of the turn with this project's dimensions; the text prints neither VC nor dimensions [rpm]."""

COMMANDS: Final = {
    name: (float(v), 0.0) for name, v in zip(DRIVES, published.FIT_STEPS_RPM, strict=False)
} | {DRIVES[-1]: (0.0, TURN_RPM)}
"""Drive -> V and VC [rpm]."""


@dataclass(frozen=True)
class DriveMetrics:
    """What a model predicts of the drives."""

    losses: FloatArray
    """(commanded - steady) / commanded of the body as measured, per drive, shape (5,)."""
    rises_s: FloatArray
    """Rise time from 10 to 90 % of the steady speed, per drive, shape (5,) [s]."""

    @property
    def six(self) -> FloatArray:
        """The numbers that the paper prints, shape (6,)."""
        return np.array([*self.losses, float(np.mean(self.rises_s))])


def drive_metrics(model: Model, plant: RobotPlant = "planar", hold_s: float = HOLD_S) -> DriveMetrics:
    """Simulate the five drives on a plant, each for `hold_s`; return their metrics as sensors show them."""
    # Without rollers half the steps are enough.
    timestep_s = TRAINING_TIMESTEP_S if plant == "planar" else None
    compiled = compile_plant(model, plant, timestep_s)
    found = []
    for v_rpm, vc_rpm in COMMANDS.values():
        v, _, vc = (float(x) for x in round_command(v_rpm, 0.0, vc_rpm, model.wheel.command_quantum_rpm))
        path = drive(model, BodyCommands.constant(v, 0.0, vc), hold_s, plant=plant, mj_model=compiled)
        found.append(loss_and_rise(path, v, vc))
    losses, rises = np.array(found).T
    return DriveMetrics(losses, rises)


def loss_and_rise(path: Trajectory, v_rpm: float, vc_rpm: float) -> tuple[float, float]:
    """Return the relative loss of steady speed and the rise time [s] of a drive from rest.

    `v_rpm` is the forward and `vc_rpm` the turning command, one of them 0. The commanded speed is that of the
    paper's robot without any effect. The rise time of a robot that never moves is the duration of the drive.
    """
    channel, axis = ("vx_m_s", 0) if v_rpm != 0.0 else ("yaw_rate_rad_s", 2)
    commanded = float(command_to_twist(v_rpm, 0.0, vc_rpm, _ROBOT)[axis])
    speed = path.channels_at(path.time_s)[channel]
    # The ripple of the rollers is not noise; it must not widen the settling band.
    found = step_metrics(path.time_s, speed, 0.0, commanded, noise_rpm=0.0)
    rise = found.rise_time_s
    return -found.relative_steady_state_error, rise if math.isfinite(rise) else float(path.time_s[-1])


def turn_losses(model: Model, speeds_rpm: FloatArray) -> FloatArray:
    """Return the losses of turns in place at several wheel speeds (n,), shape (n,)."""
    compiled = compile_plant(model, "planar", TRAINING_TIMESTEP_S)
    paths = [
        drive(model, BodyCommands.constant(0.0, 0.0, vc), SEARCH_HOLD_S, plant="planar", mj_model=compiled)
        for vc in speeds_rpm.tolist()
    ]
    return np.array([loss_and_rise(path, 0.0, vc)[0] for path, vc in zip(paths, speeds_rpm, strict=True)])
