"""The robot case of a seed: a robot, what is hidden in it, and its logs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.cases.layouts import Layout
from sysid.studies.zoo.cases.logs import ListedRun, write_dataset, write_run
from sysid.studies.zoo.cases.robot_change import RobotChange
from sysid.studies.zoo.cases.robot_changes import ROBOT_CHANGES, UNSEEN_WHEN_GENTLE, twins
from sysid.studies.zoo.cases.robot_outsiders import ROBOT_OUTSIDERS
from sysid.studies.zoo.cases.robot_plans import FIT_PLAN, GENTLE_PLAN, RUN_S, STUDY_PLANS, sequences
from sysid.studies.zoo.cases.robot_schedule import in_turn, kind_of
from sysid.studies.zoo.cases.robot_size import Yardstick, solve_size, yardstick
from sysid.studies.zoo.robots.draw import draw_robot, known
from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.simulate import simulate

FloatArray = npt.NDArray[np.float64]
_Change = Callable[[Robot, float, np.random.Generator], Robot]

LAYOUTS: Final = (
    Layout("standard", sequences=4, repeats=2, seconds=RUN_S),
    Layout("few", sequences=2, repeats=2, seconds=RUN_S),
    Layout("no_repeats", sequences=8, repeats=1, seconds=RUN_S),
    Layout("slow_log", sequences=4, repeats=2, seconds=RUN_S, sample_s=0.05),
)
_LAYOUT_SHARES: Final = (0.55, 0.15, 0.15, 0.15)
_FIT_SPLITS: Final = ("fit", "fit", "fit", "fit", "validation", "test")
"""Of the sequences of the nominal logs, in the order of the plan's manoeuvres."""
_FIT_REPEATS: Final = 2
_SIGNALS: Final = (0.3, 30.0)
"""Range of the signals of single effects: from undetectable to gross."""
_CLEAR_SIGNALS: Final = (3.0, 30.0)
"""Of cases that ask what a visible effect is called, not whether it is there."""
_UNSEEN_SIGNAL: Final = 0.3
# Streams of random numbers of a seed.
_PLAN, _LAYOUT, _TARGET, _CHANGE, _RUNS, _RULER, _FIT = range(4100, 4107)


@dataclass(frozen=True)
class _Drawn:
    """What is hidden."""

    changed: Robot
    hidden: tuple[Hidden, ...] = ()
    outsider: str = ""
    twins: tuple[str, ...] = ()
    signal: float = 0.0


def draw_robot_case(seed: int) -> tuple[Case, Robot, Robot]:
    """Return the case of a seed, its robot as it was fitted, and the changed one that made the logs.

    Raises:
        RuntimeError: nothing of the wanted kind shows on the seed's robot.
    """
    kind, turn = kind_of(seed)
    rng = np.random.default_rng([seed, _LAYOUT])
    layout = LAYOUTS[int(rng.choice(len(LAYOUTS), p=_LAYOUT_SHARES))]
    plan = GENTLE_PLAN if kind == "untestable" else STUDY_PLANS[int(rng.integers(len(STUDY_PLANS)))]
    robot = draw_robot(seed)
    robot = replace(robot, drive=layout.sensed(robot.drive))
    case = Case(seed, "robot", kind, robot.drive.family, plan, layout.name)
    drawn = _drawn(case, robot, turn)
    case = replace(case, hidden=drawn.hidden, outsider=drawn.outsider, twins=drawn.twins, signal=drawn.signal)
    return case, robot, drawn.changed


def write_robot_case(seed: int, folder: Path) -> Case:
    """Write the case of a seed to a folder and return it.

    `nominal` receives the logs that a model is fitted to, with their splits, `robot.json` what a ruler and a
    scale tell of the robot, and `logs` those with something hidden.

    Raises:
        RuntimeError: nothing of the wanted kind shows on the seed's robot.
    """
    case, robot, changed = draw_robot_case(seed)
    nominal, logs = folder / "nominal", folder / "logs"
    rows = sequences(robot, FIT_PLAN, len(_FIT_SPLITS), np.random.default_rng([seed, _FIT]))
    files = _write_runs(robot, rows, _FIT_REPEATS, nominal, [seed, _RUNS, 0])
    listed = [
        ListedRun(file, group, split)
        for (group, names), split in zip(files.items(), _FIT_SPLITS, strict=True)
        for file in names
    ]
    write_dataset(nominal, f"robot {seed}, nothing hidden", listed)
    ruler = known(robot, np.random.default_rng([seed, _RULER]))
    (folder / "robot.json").write_text(json.dumps(ruler, indent=1) + "\n", encoding="utf-8")
    _write_runs(changed, study_commands(case, robot), _layout(case).repeats, logs, [seed, _RUNS, 1])
    return case


def study_commands(case: Case, robot: Robot) -> list[FloatArray]:
    """Return the command sequences of a case's logs, each (m, 3), made for the robot before its change."""
    return _commands(case, robot, case.plan)


def _layout(case: Case) -> Layout:
    return next(layout for layout in LAYOUTS if layout.name == case.layout)


def _commands(case: Case, robot: Robot, plan: str) -> list[FloatArray]:
    rng = np.random.default_rng([case.seed, _PLAN])
    return sequences(robot, plan, _layout(case).sequences, rng)


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
    has_twins = case.kind == "twin"
    signals = _CLEAR_SIGNALS if has_twins else _SIGNALS
    for change in _changes(robot, turn, lambda change: bool(twins(change, robot)) == has_twins):
        changed = _solved(case, measure, change.apply, signals)
        if changed is not None:
            hidden = (change.hidden(robot, changed),)
            return _Drawn(changed, hidden, twins=twins(change, robot), signal=measure.signal(changed))
    raise RuntimeError(f"robot {case.seed}: no {case.kind} change shows in its logs")


def _outsider(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    is_near = case.kind == "near_outsider"
    outsiders = [each for each in ROBOT_OUTSIDERS if bool(each.near) == is_near]
    for k in in_turn(len(outsiders), turn, stream=1 + is_near):
        if outsiders[k].possible(measure.robot):
            changed = _solved(case, measure, outsiders[k].apply, _CLEAR_SIGNALS)
            if changed is not None:
                return _Drawn(changed, outsider=outsiders[k].words, signal=measure.signal(changed))
    raise RuntimeError(f"robot {case.seed}: no outsider shows in its logs")


def _unseen(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    """Hide what the gentle plan does not show and a rich one would."""
    robot = measure.robot
    rich = _measure(case, robot, STUDY_PLANS[0])
    for change in _changes(robot, turn, lambda change: change.label in UNSEEN_WHEN_GENTLE):
        changed = _solved(case, rich, change.apply, _CLEAR_SIGNALS)
        if changed is not None and (signal := measure.signal(changed)) < _UNSEEN_SIGNAL:
            return _Drawn(changed, (change.hidden(robot, changed),), signal=signal)
    raise RuntimeError(f"robot {case.seed}: gentle driving shows every change")


def _pair(case: Case, measure: Yardstick, turn: int) -> _Drawn:
    """Hide two effects of different names, each of which would show alone."""
    robot, hidden = measure.robot, list[Hidden]()
    changed = robot
    for change in _changes(robot, 2 * turn, lambda change: not twins(change, robot)):
        part = len(hidden)
        if (part and change.name == hidden[0].name) or not change.possible(changed):
            continue
        size = _size(case, measure, change.apply, _CLEAR_SIGNALS, part)
        if size is not None:
            before, changed = changed, change.apply(changed, size, _change_rng(case, part))
            hidden.append(change.hidden(before, changed))
            if part == 1:
                return _Drawn(changed, tuple(hidden), signal=measure.signal(changed))
    raise RuntimeError(f"robot {case.seed}: no pair of changes shows in its logs")


def _changes(robot: Robot, turn: int, wanted: Callable[[RobotChange], bool]) -> Iterable[RobotChange]:
    """Yield the changes that a robot can have and that are wanted, in the order of a turn."""
    for k in in_turn(len(ROBOT_CHANGES), turn, stream=0):
        if ROBOT_CHANGES[k].possible(robot) and wanted(ROBOT_CHANGES[k]):
            yield ROBOT_CHANGES[k]


def _solved(case: Case, measure: Yardstick, apply: _Change, signals: tuple[float, float]) -> Robot | None:
    size = _size(case, measure, apply, signals, part=0)
    return None if size is None else apply(measure.robot, size, _change_rng(case, 0))


def _size(
    case: Case, measure: Yardstick, apply: _Change, signals: tuple[float, float], part: int
) -> float | None:
    """Return a size whose signal is drawn log-uniformly; None where even a gross change shows too little."""

    def signal(size: float) -> float:
        return measure.signal(apply(measure.robot, size, _change_rng(case, part)))

    low, high = signals[0], min(signals[1], signal(1.0))
    if high < low:
        return None
    rng = np.random.default_rng([case.seed, _TARGET, part])
    return solve_size(signal, math.exp(rng.uniform(math.log(low), math.log(high))))


def _change_rng(case: Case, part: int) -> np.random.Generator:
    return np.random.default_rng([case.seed, _CHANGE, part])


def _write_runs(
    robot: Robot, commands: list[FloatArray], repeats: int, folder: Path, stream: list[int]
) -> dict[str, list[str]]:
    """Drive each sequence so many times and write the logs; return group -> file names."""
    folder.mkdir(parents=True)
    files: dict[str, list[str]] = {}
    for number, rows in enumerate(commands):
        for repeat in range(repeats):
            log = simulate(robot, rows, np.random.default_rng([*stream, number, repeat]))
            v, theta, vc = log.commands.T
            columns = {"time_s": log.time_s, "command_v_rpm": v, "command_theta_deg": theta}
            name = f"run_{number:02d}_{repeat + 1}.csv"
            write_run(folder / name, columns | {"command_vc_rpm": vc} | log.channels)
            files.setdefault(f"run_{number:02d}", []).append(name)
    return files
