"""The robot case of a seed: a robot, what is hidden in it, and the commands of its logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np
import numpy.typing as npt

from sysid.studies.zoo.cases.case import Case, Driven, Hidden
from sysid.studies.zoo.cases.layouts import Layout, layout_again
from sysid.studies.zoo.cases.robot.changes import MAY_HAVE_TWINS, ROBOT_CHANGES, UNSEEN_WHEN_GENTLE, twins
from sysid.studies.zoo.cases.robot.outsiders import ROBOT_OUTSIDERS
from sysid.studies.zoo.cases.robot.plans import FIT_PLAN, GENTLE_PLAN, RUN_S, STUDY_PLANS, sequences
from sysid.studies.zoo.cases.robot.schedule import in_turn, kind_of
from sysid.studies.zoo.cases.robot.size import Yardstick, solve_size, yardstick
from sysid.studies.zoo.robots.draw import draw_robot
from sysid.studies.zoo.robots.robot import Robot

FloatArray = npt.NDArray[np.float64]
_Change = Callable[[Robot, float, np.random.Generator], Robot]
_Thing = TypeVar("_Thing")

LAYOUTS: Final = (
    Layout("standard", sequences=4, repeats=2, seconds=RUN_S),
    Layout("few", sequences=2, repeats=2, seconds=RUN_S),
    Layout("no_repeats", sequences=8, repeats=1, seconds=RUN_S),
    Layout("slow_log", sequences=4, repeats=2, seconds=RUN_S, sample_s=0.05),
)
FITTED: Final = Layout("fitted", sequences=6, repeats=2, seconds=RUN_S)
"""The layout of the nominal logs: one sequence of each manoeuvre of their plan."""
_LAYOUT_SHARES: Final = (0.55, 0.15, 0.15, 0.15)
_SIGNALS: Final = (0.3, 30.0)
"""Range of the signals of single effects: from undetectable to gross."""
_CLEAR_SIGNALS: Final = (3.0, 30.0)
"""Of cases that ask what a visible effect is called, not whether it is there."""
_UNSEEN_SIGNAL: Final = 0.3
_PLAN, _LAYOUT, _TARGET, _CHANGE, RUNS, RULER, _FIT = range(4100, 4107)
"""Streams of random numbers of a seed."""


@dataclass(frozen=True)
class _Drawn:
    """What is hidden."""

    changed: Robot
    hidden: tuple[Hidden, ...] = ()
    outsider: str = ""
    twins: tuple[str, ...] = ()
    signal: float = 0.0


@dataclass(frozen=True)
class _Solved:
    """A change of the wanted size."""

    size: float
    changed: Robot
    signal: float


def draw_robot_case(seed: int, driven: Driven = "other") -> tuple[Case, Robot, Robot]:
    """Return the case of a seed, its robot as it was fitted, and the changed one that made the logs.

    `driven` says which commands these drive.

    Raises:
        RuntimeError: nothing of the wanted kind shows on the seed's robot.
    """
    kind, turn = kind_of(seed)
    rng = np.random.default_rng([seed, _LAYOUT])
    layout = LAYOUTS[int(rng.choice(len(LAYOUTS), p=_LAYOUT_SHARES))]
    plan = GENTLE_PLAN if kind == "untestable" else STUDY_PLANS[int(rng.integers(len(STUDY_PLANS)))]
    if driven == "same":
        # Gentle commands are not those of a fit.
        kind, plan = "quiet" if kind == "untestable" else kind, FIT_PLAN
    robot = draw_robot(seed)
    robot = replace(robot, drive=layout.sensed(robot.drive))
    if kind == "twin":
        # A voltage that is logged on time would tell a late command from late sensors.
        robot = replace(robot, drive=replace(robot.drive, battery=replace(robot.drive.battery, logged=False)))
    case = Case(seed, "robot", kind, robot.drive.family, plan, layout.name, driven=driven)
    drawn = _drawn(case, robot, turn)
    case = replace(case, hidden=drawn.hidden, outsider=drawn.outsider, twins=drawn.twins, signal=drawn.signal)
    return case, robot, drawn.changed


def study_commands(case: Case, robot: Robot) -> list[FloatArray]:
    """Return the command sequences of a case's logs, each (m, 3), made for the robot before its change."""
    return _commands(case, robot, case.plan)


def fit_commands(seed: int, robot: Robot) -> list[FloatArray]:
    """Return the command sequences of a seed's nominal logs, each (m, 3)."""
    return sequences(robot, FIT_PLAN, FITTED.sequences, np.random.default_rng([seed, _FIT]))


def layout_of(case: Case) -> Layout:
    """Return the layout of a case's logs."""
    layout = next(layout for layout in LAYOUTS if layout.name == case.layout)
    return layout_again(layout, FITTED) if case.driven == "same" else layout


def _commands(case: Case, robot: Robot, plan: str) -> list[FloatArray]:
    if case.driven == "same":
        return fit_commands(case.seed, robot)[: layout_of(case).sequences]
    rng = np.random.default_rng([case.seed, _PLAN])
    return sequences(robot, plan, layout_of(case).sequences, rng)


def _measure(case: Case, robot: Robot, plan: str) -> Yardstick:
    return yardstick(robot, _commands(case, robot, plan), case.seed)


def _drawn(case: Case, robot: Robot, turn: int) -> _Drawn:
    if case.kind == "quiet":
        return _Drawn(robot)
    measure = _measure(case, robot, case.plan)
    if case.kind in ("near_outsider", "far_outsider"):
        return _outsider(case, measure, turn)
    if case.kind == "untestable":
        return _unseen(case, measure, turn)
    if case.kind == "pair":
        return _pair(case, measure, turn)
    return _twin(case, measure, turn) if case.kind == "twin" else _single(case, measure, turn)


def _single(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    """Hide one effect that no other name stands for."""
    robot = measure.robot
    for change in _in_turn(ROBOT_CHANGES, turn, 0):
        if change.possible(robot) and not twins(change, robot):
            solved = _solved(case, measure, change.apply, _SIGNALS)
            if solved:
                return _Drawn(
                    solved.changed,
                    (change.hidden(robot, solved.changed, solved.signal),),
                    signal=solved.signal,
                )
    raise _nothing_shows(case)


def _twin(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    robot = measure.robot
    for change in _in_turn([c for c in ROBOT_CHANGES if c.label in MAY_HAVE_TWINS], turn, 1):
        names = twins(change, robot)
        if change.possible(robot) and names:
            solved = _solved(case, measure, change.apply, _CLEAR_SIGNALS)
            if solved:
                return _Drawn(
                    solved.changed,
                    (change.hidden(robot, solved.changed, solved.signal),),
                    "",
                    names,
                    solved.signal,
                )
    raise _nothing_shows(case)


def _pair(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    """Hide two effects of different names, each of which would show alone."""
    robot, changed, hidden = measure.robot, measure.robot, list[Hidden]()
    for change in _in_turn(ROBOT_CHANGES, 2 * turn, 2):
        part = len(hidden)
        if (part and change.name == hidden[0].name) or not change.possible(changed) or twins(change, robot):
            continue
        alone = _solved(case, measure, change.apply, _CLEAR_SIGNALS, part)
        if alone:
            before, changed = changed, change.apply(changed, alone.size, _change_rng(case, part))
            hidden.append(change.hidden(before, changed, alone.signal))
            if part == 1:
                return _Drawn(changed, tuple(hidden), signal=measure.signal(changed))
    raise _nothing_shows(case)


def _unseen(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    """Hide what the gentle plan does not show and a rich one would."""
    robot, rich = measure.robot, _measure(case, measure.robot, STUDY_PLANS[0])
    for change in _in_turn([c for c in ROBOT_CHANGES if c.label in UNSEEN_WHEN_GENTLE], turn, 3):
        if change.possible(robot):
            solved = _solved(case, rich, change.apply, _CLEAR_SIGNALS)
            if solved and (signal := measure.signal(solved.changed)) < _UNSEEN_SIGNAL:
                return _Drawn(solved.changed, (change.hidden(robot, solved.changed, signal),), signal=signal)
    raise _nothing_shows(case)


def _outsider(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    is_near = case.kind == "near_outsider"
    for outsider in _in_turn([o for o in ROBOT_OUTSIDERS if bool(o.near) == is_near], turn, 4 + is_near):
        if outsider.possible(measure.robot):
            solved = _solved(case, measure, outsider.apply, _CLEAR_SIGNALS)
            if solved:
                return _Drawn(solved.changed, outsider=outsider.words, signal=solved.signal)
    raise _nothing_shows(case)


def _in_turn(things: Sequence[_Thing], turn: int, stream: int) -> Iterable[_Thing]:
    return (things[k] for k in in_turn(len(things), turn, stream))


def _nothing_shows(case: Case) -> RuntimeError:
    return RuntimeError(f"robot {case.seed}: nothing that its logs show makes a case of kind {case.kind}")


def _solved(
    case: Case, measure: Yardstick, apply: _Change, signals: tuple[float, float], part: int = 0
) -> _Solved | None:
    """Return a change whose signal is drawn log-uniformly; None where even a gross one shows too little."""

    def changed(size: float) -> Robot:
        return apply(measure.robot, size, _change_rng(case, part))

    low, high = signals[0], min(signals[1], measure.signal(changed(1.0)))
    if high < low:
        return None
    rng = np.random.default_rng([case.seed, _TARGET, part])
    target = math.exp(rng.uniform(math.log(low), math.log(high)))
    size, signal = solve_size(lambda size: measure.signal(changed(size)), target)
    return _Solved(size, changed(size), signal)


def _change_rng(case: Case, part: int) -> np.random.Generator:
    return np.random.default_rng([case.seed, _CHANGE, part])
