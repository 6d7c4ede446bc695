"""Driving the experiments that a study asks for, on the same drive or robot, until its case is settled.

As the documentation tells a user: run the next experiment three times, put the recordings into the folder of
the logs, state in its `dataset.toml` that they are fitted, and study the same model again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, TypeAlias

import numpy as np
from tqdm import tqdm

from mecanum_env import parallel
from mecanum_env.files import write_json
from mecanum_env.parallel import Workers
from mecanum_env.units import FloatArray
from sysid.gap.design.trial import REPEATS
from sysid.gap.result import Experiment, GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, BodyCommand, Dataset, read_dataset
from sysid.logs.settings import FILE_NAME
from sysid.logs.writer import write_columns
from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.outcome import ERROR, Outcome, outcome_of
from sysid.studies.zoo.recorders import Recorder, recorder
from sysid.studies.zoo.settled import BUDGET_S, Names, Round, Settled, settled_from_json, settled_json
from sysid.studies.zoo.sources import fingerprint
from sysid.studies.zoo.work import WRITERS, Task, logs_of_fit

_STREAM: Final = 7
"""Sets the luck of these recordings apart from that of the case's logs, which have the same seed."""

Study: TypeAlias = Callable[[Dataset], GapReport]
"""Studies logs with the case's model, and designs the next experiment."""


def settle_cases(outcomes: Sequence[Outcome], out: Path, workers: Workers) -> tuple[Settled, ...]:
    """Drive the next experiments of ambiguous outcomes, on `workers`, and return what came of it.

    `out` receives FINGERPRINT/settled/NAME.json beside the outcomes; what is there is not driven again.
    """
    folder = out / fingerprint()
    tasks = [
        Task(one.case.level, one.case.seed, one.case.driven) for one in outcomes if one.verdict == "ambiguous"
    ]
    todo = [task for task in tasks if not settled_file(task, folder).is_file()]
    if todo:
        with tqdm(total=len(tasks), initial=len(tasks) - len(todo), unit="tie") as bar:

            def tell(index: int, done: Settled) -> None:
                write_json(settled_file(todo[index], folder), settled_json(done))
                bar.set_postfix_str(done.outcome.case.name, refresh=False)
                bar.update()

            work = [parallel.Task(task.name, settle_task, (task,)) for task in todo]
            parallel.run_tasks(work, workers, tell)
    return tuple(read_settled(settled_file(task, folder)) for task in tasks)


def settled_file(task: Task, folder: Path) -> Path:
    """Return the file, in the folder of a fingerprint, that says how a task's case was settled."""
    return folder / "settled" / f"{task.name}.json"


def read_settled(path: Path) -> Settled:
    """Return the settled case in a file that `settle_cases` wrote."""
    return settled_from_json(json.loads(path.read_text(encoding="utf-8")))


def settle_task(task: Task) -> Settled:
    """Draw the case of a task again, settle it, and return what came of it."""
    with TemporaryDirectory() as made:
        case = WRITERS[task.level](task.seed, Path(made), task.driven)
        model = nominal_model(Path(made))

        options = GapOptions(jobs=1, fitted_on=logs_of_fit(Path(made)))

        def study(dataset: Dataset) -> GapReport:
            return analyse(dataset, model, options)

        return settle(case, Path(made) / "logs", study, recorder(case))


def settle(case: Case, logs: Path, study: Study, record: Recorder) -> Settled:
    """Drive what each study asks for until a verdict other than `ambiguous`, or until the budget is spent.

    Args:
        case: what is hidden.
        logs: folder of the case's logs, to which the recordings are added.
        study: studies logs; whatever error it raises ends the case.
        record: drives an experiment on the changed drive or robot.
    """
    first: tuple[Names, ...] = ()
    rounds: list[Round] = []
    while True:
        began = time.perf_counter()
        try:
            dataset = read_dataset(logs)
            report = study(dataset)
        except Exception as error:
            # Whatever a user would have seen is an outcome: one case must not stop the others.
            why_not = f"{type(error).__name__}: {error}"
            return Settled(first, tuple(rounds), Outcome(case, ERROR, message=why_not), False, why_not)
        outcome = outcome_of(case, report, 0.0, time.perf_counter() - began)
        first = first or outcome.candidates
        if rounds:
            rounds[-1] = replace(rounds[-1], decides=_decides(dataset, len(rounds)))
        asked = report.next_experiment if report.verdict == "ambiguous" else None
        if asked is None:
            why_not = report.notes[-1] if report.verdict == "ambiguous" and report.notes else ""
            return Settled(first, tuple(rounds), outcome, False, why_not)
        driving_s = round(REPEATS * asked.duration_s, 9)
        spent_s = round(sum(one.driving_s for one in rounds), 9)
        if spent_s + driving_s > BUDGET_S:
            why_not = f"{spent_s:g} s were driven, and the next experiment takes {driving_s:g} s"
            return Settled(first, tuple(rounds), outcome, True, why_not)
        first_log = _drive(asked, case.seed, len(rounds) + 1, logs, record)
        kept = _changes(first_log, asked) / max(1, _changes(asked.columns, asked))
        reach = _largest_rpm(case, asked) / max(np.max(np.abs(r.command.wheels_rpm)) for r in dataset.runs)
        rounds.append(Round(outcome.candidates, driving_s, asked.power, True, float(reach), kept))


def _drive(asked: Experiment, seed: int, number: int, logs: Path, record: Recorder) -> dict[str, FloatArray]:
    """Add the recordings of a round, by its number, to a folder of logs; return the first one's columns."""
    recordings = [
        record(asked, np.random.default_rng([seed, _STREAM, number, repeat])) for repeat in range(REPEATS)
    ]
    with (logs / FILE_NAME).open("a", encoding="utf-8") as settings:
        for repeat, columns in enumerate(recordings, start=1):
            name = f"{_stem(number)}_{repeat}.csv"
            write_columns(columns, logs / name)
            settings.write(f'\n[[runs]]\nfile = "{name}"\nsplit = "fit"\n')
    return recordings[0]


def _changes(columns: Mapping[str, FloatArray], asked: Experiment) -> int:
    """Return how often the commands of an experiment change in columns that contain them."""
    rows = np.stack([columns[name] for name in asked.columns], axis=1)
    return int(np.count_nonzero(np.any(np.diff(rows, axis=0) != 0.0, axis=1)))


def _largest_rpm(case: Case, asked: Experiment) -> float:
    """Return the largest wheel speed that an experiment commands [rpm]."""
    command = BenchCommand if case.level == "bench" else BodyCommand
    return float(np.max(np.abs(command(*asked.columns.values()).wheels_rpm)))


def _decides(dataset: Dataset, number: int) -> bool:
    """Return whether the recordings of a round were among the runs that decide."""
    return any(run.split != "test" for run in dataset.runs if run.file.startswith(f"{_stem(number)}_"))


def _stem(number: int) -> str:
    """Return how the file names of a round's recordings begin."""
    return f"next_{number}"
