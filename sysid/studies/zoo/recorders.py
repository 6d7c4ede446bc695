"""Driving an experiment once on the drive or robot of a case, and writing down what its user would see."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from mecanum_env.kinematics import BODY_COMMAND
from mecanum_env.units import FloatArray
from sysid.gap.result import Experiment
from sysid.logs.runs import BENCH_COMMAND, TIME
from sysid.studies.zoo.cases.bench.draw import draw_bench_case
from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.cases.robot.draw import draw_robot_case
from sysid.studies.zoo.drives.simulate import simulate
from sysid.studies.zoo.robots.simulate import simulate as simulate_robot

_ROUNDING_S: Final = 1e-6
"""Rounding of the stamps of an experiment's commands [s]."""

Recorder: TypeAlias = Callable[[Experiment, np.random.Generator], dict[str, FloatArray]]
"""Drives an experiment once and returns the columns of its log, each (n,)."""


def recorder(case: Case) -> Recorder:
    """Return what drives experiments on the changed drive or robot of a case, logged as it was."""
    return bench_recorder(case) if case.level == "bench" else robot_recorder(case)


def bench_recorder(case: Case) -> Recorder:
    """Return what drives experiments on the changed drive of a bench case."""
    _, _, drive = draw_bench_case(case.seed, case.driven)

    def record(asked: Experiment, rng: np.random.Generator) -> dict[str, FloatArray]:
        sent = commands_on_link(asked, BENCH_COMMAND, drive.link.period_s)
        log = simulate(drive, sent[:, 0], rng)
        columns = {TIME: log.time_s, BENCH_COMMAND[0]: log.command_rpm, "speed_rpm": log.speed_rpm}
        return columns if log.battery_v is None else {**columns, "battery_v": log.battery_v}

    return record


def robot_recorder(case: Case) -> Recorder:
    """Return what drives experiments on the changed robot of a robot case."""
    _, _, robot = draw_robot_case(case.seed, case.driven)

    def record(asked: Experiment, rng: np.random.Generator) -> dict[str, FloatArray]:
        sent = commands_on_link(asked, BODY_COMMAND, robot.drive.link.period_s)
        log = simulate_robot(robot, sent, rng)
        return {TIME: log.time_s, **dict(zip(BODY_COMMAND, log.commands.T, strict=True)), **log.channels}

    return record


def commands_on_link(asked: Experiment, columns: Sequence[str], period_s: float) -> FloatArray:
    """Return the commands of an experiment as a link of another period sends them: the last one given.

    Args:
        asked: the experiment, with one command per period of its model.
        columns: names of its columns.
        period_s: of the link [s].

    Returns:
        One row per period from the start to the end of the experiment, shape (n, columns).
    """
    sent_s = np.arange(math.ceil(asked.duration_s / period_s - _ROUNDING_S)) * period_s
    last = np.searchsorted(asked.time_s, sent_s + _ROUNDING_S, side="right") - 1
    return np.stack([asked.columns[name][last] for name in columns], axis=1)
