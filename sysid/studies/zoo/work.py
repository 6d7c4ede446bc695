"""Running cases on many processors; each outcome is saved as soon as it is there.

Workers send what they find to this process, which writes it, so a cluster needs no shared folder. Folders are
named by the fingerprint of the code: an interrupted run goes on where it was, and outcomes of another version
are never taken for those of this one.
"""

from __future__ import annotations

import fnmatch
import functools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from tqdm import tqdm

from mecanum_env import parallel
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.parallel import Workers
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, read_dataset
from sysid.logs.runs import Level
from sysid.studies.zoo.cases.case import Case, Driven, short_name
from sysid.studies.zoo.cases.write import write_bench_case, write_robot_case
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.outcome import ERROR, Outcome, case_from_json, from_json, outcome_of, to_json
from sysid.studies.zoo.sources import fingerprint

Writer = Callable[[int, Path, Driven], Case]
"""Writes the case of a seed to a folder: `nominal` and `logs`, of a robot also robot.json."""
WRITERS: Final[Mapping[Level, Writer]] = {"bench": write_bench_case, "robot": write_robot_case}


@dataclass(frozen=True)
class Task:
    """One case to run, before it is drawn."""

    level: Level
    seed: int
    driven: Driven = "other"

    @property
    def name(self) -> str:
        """Such as "bench-0042", with which the name of its case begins."""
        return short_name(self.level, self.seed, self.driven)


@dataclass(frozen=True)
class Results:
    """The outcomes of some tasks."""

    outcomes: tuple[Outcome, ...]
    """In the order of the tasks; without those that were not asked for by name."""
    undrawn: tuple[str, ...]
    """Name of a task and the error, where no case could be drawn: a fault of the zoo, not of the workflow."""


@dataclass(frozen=True)
class Ran:
    """What a worker sends back of a task."""

    name: str
    """Of the case, or of the task if no case could be drawn."""
    case: Case | None
    outcome: Outcome | None
    """None if the case was not drawn or not asked for."""
    error: str = ""
    """Why no case could be drawn."""


def run_tasks(tasks: Sequence[Task], out: Path, workers: Workers, only: str = "*") -> Results:
    """Run tasks on `workers` and return what was found; `out` receives FINGERPRINT/cases/NAME.json.

    What is found there is not computed again, and how much that is gets printed. Cases whose names do not
    match `only` are drawn, but not analysed. No case stops the others.

    Raises:
        InputError: the code was edited while the workers started.
    """
    code = fingerprint()
    folder = out / code
    todo = [task for task in tasks if not _is_done(task, folder, only)]
    print(_reuse(tasks, todo, out, code), flush=True)
    undrawn = []
    if todo:
        with tqdm(total=len(tasks), initial=len(tasks) - len(todo), unit="case") as bar:

            def tell(index: int, ran: Ran) -> None:
                save(todo[index], ran, folder)
                if ran.error:
                    undrawn.append(f"{ran.name}: {ran.error}")
                bar.set_postfix_str(ran.name, refresh=False)
                bar.update()

            work = [parallel.Task(task.name, run_task, (task, code, only)) for task in todo]
            parallel.run_tasks(work, workers, tell)
    found = [read_outcome(path) for task in tasks if (path := saved(task, folder)).is_file()]
    wanted = tuple(outcome for outcome in found if fnmatch.fnmatch(outcome.case.name, only))
    return Results(wanted, tuple(sorted(undrawn)))


def saved(task: Task, folder: Path) -> Path:
    """Return the file, in the folder of a fingerprint, that holds the outcome of a task."""
    return folder / "cases" / f"{task.name}.json"


def read_outcome(path: Path) -> Outcome:
    """Return the outcome in a file that `save` wrote."""
    return from_json(json.loads(path.read_text(encoding="utf-8")))


def save(task: Task, ran: Ran, folder: Path) -> None:
    """Write what was found of a task to the folder of a fingerprint."""
    if ran.case is not None:
        write_json(_drawn(task, folder), asdict(ran.case))
    if ran.outcome is not None:
        write_json(saved(task, folder), to_json(ran.outcome))


def run_task(task: Task, code: str, only: str = "*") -> Ran:
    """Draw the case of a task, analyse it and return what was found.

    An error is of the drawing: whatever the fit and the study raise is an outcome. `code` is the fingerprint
    of the run. A case that does not match `only` is not analysed.

    Raises:
        InputError: the code is another one by now.
    """
    _require_same_code(code)
    with TemporaryDirectory() as made:
        try:
            case = WRITERS[task.level](task.seed, Path(made), task.driven)
        except Exception as error:
            return Ran(task.name, None, None, _text(error, Path(made)))
        wanted = fnmatch.fnmatch(case.name, only)
        return Ran(case.name, case, analysed(case, Path(made)) if wanted else None)


def analysed(case: Case, folder: Path) -> Outcome:
    """Fit a model to the nominal logs in a case's `folder`, study its logs, and return the outcome."""
    stage, began, fit_s = "fit", time.perf_counter(), 0.0
    try:
        model = nominal_model(folder)
        stage, fit_s = "study", time.perf_counter() - began
        options = GapOptions(next_experiment=False, fitted_on=logs_of_fit(folder))
        report = analyse(read_dataset(folder / "logs"), model, options)
        return outcome_of(case, report, fit_s, time.perf_counter() - began - fit_s)
    except Exception as error:
        # Whatever a user would have seen is an outcome: one case must not stop the others.
        study_s = time.perf_counter() - began - fit_s
        return Outcome(case, ERROR, fit_s=fit_s, study_s=study_s, message=f"{stage}: {_text(error, folder)}")


def logs_of_fit(folder: Path) -> Dataset:
    """Return the nominal logs in the `folder` of a case, with which a study compares as the program does."""
    return read_dataset(folder / "nominal")


@functools.cache
def _require_same_code(code: str) -> None:
    """Refuse to work for a run that began with other code; a worker asks once, after its imports."""
    now = fingerprint()
    if now != code:
        raise InputError(f"the code changed from {code} to {now} while the run began; start it again")


def _text(error: Exception, folder: Path) -> str:
    """Return an error as one line without the place of the case's temporary `folder`, which says nothing.

    Nor does the type of an error say more where the project raises it on purpose.
    """
    text = " ".join(str(error).split()).replace(f"{folder}/", "")
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"


def _drawn(task: Task, folder: Path) -> Path:
    """Return the file that holds the case of a task, so that its name is known the next time."""
    return folder / "drawn" / f"{task.name}.json"


def _is_done(task: Task, folder: Path, only: str) -> bool:
    """Return whether the outcome of a task is saved, or its name known not to be asked for."""
    if saved(task, folder).is_file():
        return True
    path = _drawn(task, folder)
    if not path.is_file():
        return False
    return not fnmatch.fnmatch(case_from_json(json.loads(path.read_text(encoding="utf-8"))).name, only)


def _reuse(tasks: Sequence[Task], todo: Sequence[Task], out: Path, code: str) -> str:
    """Return in words how many outcomes are taken from an earlier run, and which are left alone."""
    kept, rest = len(tasks) - len(todo), f"{len(todo)} of {len(tasks)} cases to run"
    said = f"code {code}: {rest}" + (f", {kept} kept from an earlier run of the same code" if kept else "")
    others = {p.parents[1].name for p in out.glob("*/cases/*.json")} - {code}
    left = [f"{name} ({len(list((out / name).glob('cases/*.json')))})" for name in sorted(others)]
    return said + (f"; outcomes of other code in {out} are not used: {', '.join(left)}" if left else "")
