"""Identification of a wheel by several methods from the same logs: error on held-out runs, and time."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from tqdm import tqdm

from contenders.identify import METHODS, SPEED, Method, held_out
from contenders.table import Table, over, spread
from mecanum_env.files import asset_path
from mecanum_env.statistics import rms
from sysid.logs import Dataset, read_dataset
from sysid.logs.noise import noise_from_repeats

REAL = ("robotino/bench_with_integral/motor1", "husky/left")
"""Recordings of real wheels, in the folder of MECANUM_REAL_LOGS."""
OURS = METHODS[0].name
TITLE = "Identification: a wheel from its logs"
NEAR = 1.02
"""Error over the smallest one up to which a method is counted among the best."""
HEAD = ("method", "error over ours", "best or within 2 %", "seconds over ours", "processor seconds")
DETAIL_TITLE = "Identification: error on held-out runs [rpm], by logs"


@dataclass
class Measured:
    """What one method did with one set of logs."""

    rms_rpm: float = math.nan
    """Error on held-out runs; NaN if the method is not installed."""
    seconds: list[float] = field(default_factory=list)
    """Processor time of the identification, one per round."""


Found = Mapping[str, Mapping[str, Measured]]
"""Logs -> method -> what it did with them."""


def bundled() -> dict[str, Dataset]:
    """Return the logs that the package contains."""
    names = ("examples/logs", "examples/gap_logs")
    return {f"bundled {name}": read_dataset(asset_path(name)) for name in names}


def few() -> dict[str, Dataset]:
    """Return one run of each sequence of the bundled logs."""
    (name, dataset), *_ = bundled().items()
    return {name: replace(dataset, runs=tuple({run.group: run for run in dataset.runs}.values()))}


def drawn(count: int, first: int) -> dict[str, Dataset]:
    """Return the nominal logs of a `count` of drives of the zoo, of development seeds from `first`."""
    # The zoo compiles its simulation when it is imported.
    from sysid.studies.zoo.cases.write import write_bench_case
    from sysid.studies.zoo.seeds import development_seeds

    found = {}
    for seed in development_seeds(count, first):
        with TemporaryDirectory() as folder:
            case = write_bench_case(seed, Path(folder))
            found[f"drawn drive {seed} ({case.family})"] = read_dataset(Path(folder) / "nominal")
    return found


def real() -> dict[str, Dataset]:
    """Return the recordings of real wheels, if MECANUM_REAL_LOGS names their folder."""
    folder = os.environ.get("MECANUM_REAL_LOGS")
    if folder is None:
        return {}
    return {f"real {name}": read_dataset(Path(folder) / name) for name in REAL}


def measure(rounds: int, logs: Mapping[str, Dataset], methods: Sequence[Method] = METHODS) -> list[Table]:
    """Identify from every set of logs with every method, by turns; return the summary and the details."""
    there = [method for method in methods if method.load()]
    found = {name: {method.name: Measured() for method in methods} for name in logs}
    with tqdm(total=rounds * len(logs) * len(there), desc="fit", unit="fit", disable=None) as bar:
        for turn in range(rounds):
            for name, dataset in logs.items():
                for method in there:
                    bar.set_postfix_str(f"{name}, {method.name}", refresh=False)
                    one = found[name][method.name]
                    begin = time.process_time()
                    errors = method.fit(dataset)
                    one.seconds.append(time.process_time() - begin)
                    if turn == 0:
                        one.rms_rpm = rms(errors(held_out(dataset)))
                    bar.update()
    return [_summary(found), _details(found, logs)]


def _summary(found: Found) -> Table:
    rows, remarks = [], []
    for method in next(iter(found.values())):
        done = {name: methods[method] for name, methods in found.items() if methods[method].seconds}
        if not done:
            rows.append((method, *["not installed"] * (len(HEAD) - 1)))
            continue
        errors = [one.rms_rpm / found[name][OURS].rms_rpm for name, one in done.items()]
        best = sum(one.rms_rpm <= NEAR * least(found[name]) for name, one in done.items())
        seconds = [median(one.seconds) for one in done.values()]
        ours = [median(found[name][OURS].seconds) for name in done]
        rows.append(
            (
                method,
                str(spread(errors)),
                f"{best} of {len(done)}",
                str(over(seconds, ours)),
                str(spread(seconds)),
            )
        )
        if method.startswith("ours"):
            continue
        lost = [name for name, error in zip(done, errors, strict=True) if error < 1.0]
        if lost:
            remarks.append(f"{method} predicts better than ours on {', '.join(lost)}.")
        if median(seconds) < median(ours):
            ratio = over(ours, seconds)
            remarks.append(f"Ours takes {ratio} times as long as {method}.")
    return Table(TITLE, _ABOUT, HEAD, tuple(rows), _figures(found), tuple(remarks))


def least(methods: Mapping[str, Measured]) -> float:
    """Return the smallest error [rpm] of the methods that are installed."""
    return min(one.rms_rpm for one in methods.values() if one.seconds)


def _details(found: Found, logs: Mapping[str, Dataset]) -> Table:
    rows = []
    for name, methods in found.items():
        noise = (noise_from_repeats(logs[name].runs) or {}).get(SPEED)
        cells = [f"{one.rms_rpm:.3g}" if one.seconds else "-" for one in methods.values()]
        rows.append((name, *cells, f"{noise.std:.3g}" if noise else "no repeats"))
    head = ("logs", *next(iter(found.values())), "noise between repeats")
    about = "Rms of measured minus simulated speed; no method can be below the noise, but for chance."
    return Table(DETAIL_TITLE, about, head, tuple(rows), {})


def _figures(found: Found) -> dict[str, dict[str, dict[str, float | list[float]]]]:
    return {
        name: {
            method: {"rms_rpm": one.rms_rpm, "seconds": one.seconds}
            for method, one in methods.items()
            if one.seconds
        }
        for name, methods in found.items()
    }


_ABOUT = """\
Every method gets the same runs and is judged by free-running simulation, from the commands alone, of test
runs that it has not seen. *Ours* is `python -m sysid.fit` with its defaults: law, delay, ceiling, what the
drive does beside its law, and the statistics of all this; *law alone* is the same without effects, from
three starts. *mujoco.sysid* is the toolbox in MuJoCo on a hinge with a velocity servo: inertia, gain,
friction, delay, torque limit and ceiling are free. *scipy output error* is `least_squares` on a second-order
lag with gain and delay. *SIPPY ARX* (`sippy-unipi`) chooses orders and delay by BIC, on the runs end to end.
The others fit the validation runs, too, on which ours decides.

*Error over ours*: ratio of the rms errors, over all logs: median (least .. largest). *Best*: logs on which
the error is at most 2 % above the smallest of all methods. Seconds are processor time on one thread, rounds
by turns, the median of the rounds for each set of logs, then median (least .. largest) over the logs."""
