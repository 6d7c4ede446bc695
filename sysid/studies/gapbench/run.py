"""Running methods on the cases of a benchmark; each answer is saved as soon as it is there."""

from __future__ import annotations

import functools
import json
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from tqdm import tqdm

from mecanum_env.checkout import commit
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import write_json
from mecanum_env.outputs import finish_interrupted, output_folder
from mecanum_env.parallel import Task, Workers, run_tasks
from sysid.studies.gapbench.adapters.registry import ADAPTERS, load
from sysid.studies.gapbench.cases import Answer, answer_json, answers_json, read_case, write_predictions

ANSWERS: Final = "answers.json"
"""All answers of a method, in its folder."""
_COMMAND: Final = "sysid.studies.gapbench run"


def run_adapters(cases: Path, out: Path, names: Sequence[str], jobs: int = 1) -> dict[str, float]:
    """Let methods answer all cases of a folder; return the median of the seconds per case of each.

    Args:
        cases: folder of cases.
        out: receives NAME/answers.json and NAME/predictions of each method.
        names: of `ADAPTERS`, or "all", which leaves out those whose package is not installed.
        jobs: number of worker processes.

    Raises:
        InputError: no cases, an unknown method, or one whose package is not installed.
    """
    folders = sorted(path.parent for path in cases.glob("*/case.json"))
    if not folders:
        raise InputError(f"{cases}: no CASE/case.json in it; give the folder cases of a benchmark")
    seconds = {}
    for name in _wanted(names):
        finish_interrupted(out / name)
        todo = [folder for folder in folders if not (out / name / _saved(folder.name)).is_file()]
        tasks = [Task(f"{name}, {folder.name}", answer_case, (name, folder, out)) for folder in todo]
        with tqdm(total=len(todo), desc=name, unit="case") as bar:
            run_tasks(tasks, Workers(jobs=jobs), functools.partial(_count, bar))
        answers = {
            folder.name: json.loads((out / name / _saved(folder.name)).read_text(encoding="utf-8"))
            for folder in folders
        }
        with output_folder(out / name, _COMMAND, shared=True) as staged:
            write_json(staged / ANSWERS, answers_json(ADAPTERS[name].words, answers))
        seconds[name] = statistics.median(answer["seconds"] for answer in answers.values())
    return seconds


def answer_case(name: str, folder: Path, out: Path) -> None:
    """Let the method of a `name` answer the case in a folder, and save what it says and predicts in `out`."""
    case = read_case(folder)
    method = load(name)
    began = time.perf_counter()
    try:
        answer = method(case)
    except Exception as error:
        # Whatever a user of the method would have seen is an answer: one case must not stop the others.
        answer = Answer("error", message=f"{type(error).__name__}: {' '.join(str(error).split())}")
    seconds = time.perf_counter() - began
    made_by = {"commit": commit() or "unknown"}
    # Other processes write other answers meanwhile.
    with output_folder(out / name, _COMMAND, shared=True) as staged:
        write_predictions(answer, case, staged / "predictions" / case.name)
        write_json(staged / _saved(case.name), answer_json(answer, seconds) | made_by)


def _count(bar: Any, _index: int, _done: object) -> None:
    bar.update()


def _saved(case: str) -> Path:
    """Return where the answer to a case is in the folder of a method."""
    return Path("cases", f"{case}.json")


def _wanted(names: Sequence[str]) -> list[str]:
    """Return the methods that are asked for."""
    if list(names) == ["all"]:
        able = [name for name, adapter in ADAPTERS.items() if not adapter.missing()]
        for name in ADAPTERS.keys() - set(able):
            print(f"{name} is left out: {ADAPTERS[name].missing()}")
        return able
    for name in names:
        if name not in ADAPTERS:
            raise InputError(f"no method {name}{did_you_mean(name, ADAPTERS)}; known: {', '.join(ADAPTERS)}")
        if missing := ADAPTERS[name].missing():
            raise InputError(f"{name}: {missing}")
    return list(names)
