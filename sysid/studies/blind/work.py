"""Running blind cases in worker processes; each outcome is saved as soon as it is there.

The model of each nominal plant is fitted once, to logs without effects, by the program that users run.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

from mecanum_env.errors import MecanumError
from mecanum_env.files import write_json
from mecanum_env.model import Model, read_model, read_robot, write_model
from mecanum_env.parallel import process_pool
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset
from sysid.studies.blind.cases import Case, blind_tests
from sysid.studies.blind.outcome import Outcome, from_json, outcome_of, to_json


def nominal_model(plant: str, folder: Path) -> Model:
    """Return the model of a nominal plant; it is fitted if the folder of the run does not hold it yet.

    `nominal/PLANT/` in the folder receives logs, robot.json and model.json.
    """
    folder = folder / "nominal" / plant
    path = folder / "model.json"
    if not path.is_file():
        blind_tests().write_nominal(plant, folder)
        robot = folder / "robot.json"
        options = FitOptions(
            robot=read_robot(robot), robot_given=tuple(json.loads(robot.read_text(encoding="utf-8")))
        )
        write_model(fitted_model(fit_dataset(read_dataset(folder / "logs"), options)), path)
    return read_model(path)


def run_cases(cases: Sequence[Case], seed: int, folder: Path, jobs: int) -> list[Outcome]:
    """Run cases of a seed and return their outcomes in the order of the cases, whatever the number of `jobs`.

    The folder receives `nominal/PLANT/` and `cases/SEED/NAME.json`; results found there are not computed
    again.
    """
    todo = [case for case in cases if not saved(case, seed, folder).is_file()]
    plants = list(dict.fromkeys(case.plant for case in todo))
    with process_pool(jobs) as pool:
        for made in [pool.submit(nominal_model, plant, folder) for plant in plants]:
            made.result()
        running = [pool.submit(run_case, case, seed, folder) for case in todo]
        with tqdm(total=len(cases), initial=len(cases) - len(todo), unit="case") as bar:
            for future in as_completed(running):
                bar.set_postfix_str(future.result(), refresh=False)
                bar.update()
    return [from_json(json.loads(saved(case, seed, folder).read_text(encoding="utf-8"))) for case in cases]


def saved(case: Case, seed: int, folder: Path) -> Path:
    """Return the file in the folder of a run that holds the outcome of a case of a seed."""
    return folder / "cases" / f"{seed}" / f"{case.name}.json"


def run_case(case: Case, seed: int, folder: Path) -> str:
    """Write the logs of a case of a seed, analyse them, save the outcome and return the name of the case.

    An error of the workflow is an outcome, too: one case must not stop the others.
    """
    model = nominal_model(case.plant, folder)
    with TemporaryDirectory() as logs:
        blind_tests().write_case(case.name, seed, Path(logs))
        began = time.perf_counter()
        try:
            report = analyse(read_dataset(logs), model, GapOptions(jobs=1, next_experiment=False))
            outcome = outcome_of(case, report, time.perf_counter() - began)
        except MecanumError as error:
            outcome = Outcome(case, "error", seconds=time.perf_counter() - began, message=str(error))
    write_json(saved(case, seed, folder), to_json(outcome))
    return case.name
