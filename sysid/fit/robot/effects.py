"""Law, effects and robot parameters of robot logs that a law behind the servo does not explain.

As with a drive on the bench (`sysid.fit.effects.drive`), the law alone is the model as long as it is enough.
Where it leaves much more than the noise, a simple robot of a few physical numbers is the start
(`sysid.fit.robot.simple_robot`); a law of full order, the robot and the effects are then fitted together to
all channels on the planar plant, and further effects are added while they are worth it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import most_active_runs, observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import SimulationSettings
from sysid.compare.search_space import robot_deviations
from sysid.fit.effects import DriveEffects, EffectSearch, HeldOut, Reached, confirmed, searched
from sysid.fit.robot.grip import RobotParameter
from sysid.fit.robot.output_error import PlantData
from sysid.fit.robot.sensor_times import with_sensor_times
from sysid.fit.robot.simple_robot import ROBOT_NUMBERS, simple_robots
from sysid.logs import Dataset
from sysid.progress import Progress, silent

_FAR: Final = 4.0
"""Squared error of the law over the noise from which a simple robot is tried. Assumed: the search takes as
long as all else of a fit, and rollers leave more than noise."""
_BETTER: Final = 0.9
"""Largest ratio of the error on the validation runs to that of the law for which the result is taken.
Assumed."""
_SECONDS: Final = 30.0
_ROUNDS: Final = 3
_WIDTH: Final = 1
_PRUNED: Final = 1
"""Effort of the search, see `sysid.fit.effects.beam.searched`. Assumed: a robot is simulated far
more slowly than a wheel on the bench."""
_KNOWN: Final = (
    "command_latency",
    "body_acceleration_limit",
    "command_deadband",
    "speed_gain",
    "speed_saturation",
    "acceleration_limit",
    "acceleration_limit/s_curve",
    "coulomb_friction",
    "viscous_friction",
    "roller_friction",
    "sensor_latency/wheels",
    "sensor_latency/body",
    "sensor_latency/pose",
    "sensor_lowpass",
)
"""What any robot may have besides its law: not what belongs to a floor or to what it carries, and nothing
that slip, which the planar plant has not, may imitate."""


@dataclass(frozen=True, eq=False)
class RobotWithEffects:
    """Law, effects and robot that were fitted together."""

    drive: DriveEffects
    parameters: tuple[RobotParameter, ...]
    """Of the robot."""
    before: float
    """Rms error of the law behind the servo on the validation runs, in standard deviations of the noise."""
    after: float

    @property
    def note(self) -> str:
        """What was done, in a sentence."""
        windup = self.drive.model.robot.servo_windup
        return (
            f"the law behind the servo leaves {self.before:.2g} times the noise on the validation runs; law, "
            f"effects and robot, fitted together from a simple robot, leave {self.after:.2g} times the noise"
            + (
                f"; the drives' integral winds up at the torque limit (servo_windup {windup:g})"
                if windup
                else ""
            )
        )


def find_robot_effects(
    dataset: Dataset, alone: Model, given: Sequence[str], data: PlantData, progress: Progress = silent
) -> RobotWithEffects | None:
    """Return law, effects and robot that robot logs show; None if a law behind the servo is enough.

    Args:
        dataset: the logs.
        alone: law and robot that were fitted together without effects, but for a delay.
        given: names of the robot's parameters that were measured.
        data: runs of the fit that start at rest, with their wheel speeds.
        progress: called before each step.
    """
    settings = SimulationSettings("planar")
    observations = observe(replace(dataset, runs=most_active_runs(data.runs, _SECONDS)))
    whitener = Whitener(observations, measure_noise(dataset, observations), None)
    problem = ResidualProblem(replace(alone, uncertainty={}), whitener, settings)
    if float(problem.base_residual @ problem.base_residual) < _FAR * problem.size:
        return None
    held_out = HeldOut.of(dataset, settings)
    before, before_rpm = held_out.errors(alone)
    names = tuple(name for name in ROBOT_NUMBERS if name not in given)
    known = {name: CATALOGUE[name] for name in _KNOWN}
    starts = simple_robots(alone, given, data, progress)
    if any(block.channel not in data.channels for block in observations.blocks):
        starts = [with_sensor_times(start, problem.cost) for start in starts]
    searches = [EffectSearch(start, whitener, held_out, POLE_LIMIT, known, names) for start in starts]
    began = [first for search in searches if (first := search.begin()) is not None]
    if not began:
        return None
    # Only a law of full order tells which integral it is.
    first = min(began, key=lambda one: one.price(min(each.inflation for each in began)))
    reached = searched(searches, [first], progress, _ROUNDS, _WIDTH, _PRUNED)
    worthy = [one for one in reached if one.held_out <= _BETTER * before]
    best = confirmed(worthy, held_out.whitener.size)
    if best is None:
        return None
    model, covariance = best.stated()
    drive = DriveEffects(model, covariance, before_rpm, best.held_out_rpm)
    return RobotWithEffects(drive, _parameters(best, names, given), before, best.held_out)


def _parameters(best: Reached, names: Sequence[str], given: Sequence[str]) -> tuple[RobotParameter, ...]:
    """Return the robot's parameters with their standard errors."""
    deviations = robot_deviations(best.fitted.candidate.law, best.fitted.covariance(best.inflation))
    found = []
    for name in ROBOT_NUMBERS:
        value = float(getattr(best.model.robot, name))
        if name in given:
            found.append(RobotParameter(name, value, math.nan, False, "given, so not fitted"))
        else:
            # A limit that the logs never reach is part of the model, too, although its error is not known.
            error = float(value * deviations[names.index(name)])
            found.append(RobotParameter(name, value, error, True, "fitted with the law"))
    return tuple(found)
