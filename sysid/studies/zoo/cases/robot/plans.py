"""Command plans of robots: what is driven, as rows of V [rpm], theta [deg] and VC [rpm].

A plan is a series of manoeuvres. A manoeuvre draws levels, each held for a while: the share of the usable
wheel speed that the fastest wheel gets, a direction, and how much of it goes into turning.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sysid.studies.zoo.robots.robot import Robot

FloatArray = npt.NDArray[np.float64]

RUN_S = 4.5
_REST_S = 0.3
"""A run begins with zeros this long, so that the logs show where rest is, unless it is recorded without them
(`sysid.studies.zoo.cases.beginning`)."""
_SHARE_OF_TOP = 0.92
"""Of the top speed or the ceiling: commands stay below both, so that a lower ceiling is a change."""


@dataclass(frozen=True)
class Level:
    """One command, held."""

    share: float
    """Speed of the fastest wheel over the usable one, 0 to 1."""
    theta_deg: float = 0.0
    turn: float = 0.0
    """Part of the share that goes into VC, -1 to 1; negative turns clockwise."""


Manoeuvre = Callable[[np.random.Generator], list[Level]]
_REST = Level(0.0)


def _reversals(directions_deg: tuple[float, ...], rng: np.random.Generator) -> list[Level]:
    """Start, reverse, change speed and stop along each direction in a random order."""
    levels = []
    for theta in rng.permutation(directions_deg):
        fast, slow = rng.uniform(0.7, 1.0), rng.uniform(0.2, 0.5)
        levels += [Level(fast, theta), Level(fast, theta + 180.0), Level(slow, theta + 180.0), _REST]
    return levels


def _axes(rng: np.random.Generator) -> list[Level]:
    return _reversals((0.0, 90.0), rng)


def _diagonals(rng: np.random.Generator) -> list[Level]:
    return _reversals((45.0, 135.0), rng)


def _turns(rng: np.random.Generator) -> list[Level]:
    fast, slow = rng.uniform(0.7, 1.0), rng.uniform(0.15, 0.4)
    first = float(rng.choice([-1.0, 1.0]))
    shares = (fast, -fast, slow, -slow, 0.0, -0.6 * fast, fast)
    return [Level(abs(share), turn=math.copysign(first, share)) for share in shares]


def _mixed(rng: np.random.Generator) -> list[Level]:
    return [_any(rng, 0.3, 1.0) for _ in range(8)]


def _slow(rng: np.random.Generator) -> list[Level]:
    return [_any(rng, 0.04, 0.3) for _ in range(6)]


def _any(rng: np.random.Generator, low: float, high: float) -> Level:
    share = rng.uniform(low, high)
    return Level(share, 15.0 * float(rng.integers(-11, 13)), rng.uniform(-0.7, 0.7))


def _forward(rng: np.random.Generator) -> list[Level]:
    """Go faster in small steps, straight ahead and never back: turning and sideways motion stay unknown."""
    return [Level(float(share)) for share in np.cumsum(rng.uniform(0.05, 0.12, 5))]


PLANS: dict[str, tuple[Manoeuvre, ...]] = {
    "survey": (_axes, _diagonals, _turns, _slow, _mixed, _mixed),
    "all_round": (_axes, _diagonals, _turns, _mixed),
    "starts": (_axes, _diagonals, _axes, _turns),
    "free_driving": (_mixed, _mixed, _slow, _mixed),
    "slow": (_slow, _slow, _turns, _slow),
    "gentle": (_forward,),
}
"""Manoeuvres of the sequences of a plan, in turn. "survey" is driven for the fit; "gentle" leaves much
untested; the others are plans of studies."""
FIT_PLAN, GENTLE_PLAN = "survey", "gentle"
STUDY_PLANS = ("all_round", "starts", "free_driving", "slow")


def usable_rpm(robot: Robot) -> float:
    """Return the wheel speed [rpm] that plans go up to: below the robot's top speed and its ceiling."""
    controller = robot.drive.controller
    return _SHARE_OF_TOP * min(robot.drive.top_rpm, controller.ceiling_rpm - controller.ceiling_softness_rpm)


def top_speed_m_s(robot: Robot) -> float:
    """Return the speed of a wheel's surface [m/s] at the usable wheel speed."""
    return usable_rpm(robot) * math.pi / 30.0 * robot.wheels.radius_m


def sequences(robot: Robot, plan: str, count: int, rng: np.random.Generator) -> list[FloatArray]:
    """Draw command sequences, each (m, 3): V [rpm], theta [deg], VC [rpm], a row each command period.

    Args:
        robot: whose top speed and command period the rows are made for.
        plan: a key of `PLANS`.
        count: number of sequences; a plan with fewer manoeuvres begins anew with other levels.
        rng: draws the levels and how long each is held.
    """
    manoeuvres = PLANS[plan]
    return [_rows(robot, manoeuvres[k % len(manoeuvres)](rng), rng) for k in range(count)]


def _rows(robot: Robot, levels: list[Level], rng: np.random.Generator) -> FloatArray:
    period = robot.drive.link.period_s
    rest, length = math.ceil(_REST_S / period), round(RUN_S / period)
    weights = rng.uniform(0.7, 1.3, len(levels))
    ends = rest + np.rint((length - rest) * np.cumsum(weights) / weights.sum()).astype(int)
    rows = np.zeros((length, 3))
    first = rest
    for level, end in zip(levels, ends, strict=True):
        rows[first:end] = _command(level, usable_rpm(robot), robot.drive.controller.quantum_rpm)
        first = end
    return rows


def _command(level: Level, top_rpm: float, quantum_rpm: float) -> tuple[float, float, float]:
    """Return V, theta and VC of a level, rounded towards zero as their user would type them."""
    radians = math.radians(level.theta_deg)
    lengthening = abs(math.cos(radians)) + abs(math.sin(radians))
    step = quantum_rpm or 10.0 ** math.floor(math.log10(top_rpm / 300.0))
    speed = level.share * top_rpm
    v = round(math.floor(speed * (1.0 - abs(level.turn)) / lengthening / step) * step, 6)
    vc = round(math.trunc(speed * level.turn / step) * step, 6)
    theta = (level.theta_deg + 180.0) % 360.0 - 180.0
    return v, theta if v else 0.0, vc
