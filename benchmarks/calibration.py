"""What the thresholds of a verdict rest on: values of drawn cases on both sides of three, as a Markdown page.

Drives and robots of the zoo are drawn, quiet ones and some with a hidden effect, and fitted as the zoo fits
them. Their studies go as far as the values that are compared with `plainly_visible`, `least_on_bench` and
`least_elsewhere` of `sysid/gap/search/thresholds.py`. Of all other thresholds the page repeats what that file
says.

Example: python benchmarks/calibration.py --markdown docs/results/calibration.md
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from recordings import print_page, written

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json
from mecanum_env.markdown import markdown_table
from mecanum_env.model import cause_of
from mecanum_env.parallel import one_thread
from mecanum_env.reading import read_json
from sysid.compare.links import AlignedLogs
from sysid.compare.predicted import SimulationSettings, without_engine_warnings
from sysid.gap.inquiry import start_search
from sysid.gap.result import GapOptions
from sysid.gap.search import thresholds
from sysid.gap.search.beyond_fit import promised_gains, without_first_order
from sysid.gap.search.chance import expected
from sysid.gap.search.decision import explore
from sysid.gap.search.known_effects import effects_for
from sysid.gap.search.plain_squares import plain_ratio
from sysid.gap.search.sets import Search
from sysid.gap.search.study_data import StudyData, study_data
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import read_dataset
from sysid.logs.runs import Level
from sysid.logs.tails import weighted_down
from sysid.progress import silent
from sysid.studies.score import VISIBLE, size_of
from sysid.studies.zoo.cases.bench import draw as bench
from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.cases.robot import draw as robot
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.seeds import DEVELOPMENT
from sysid.studies.zoo.sources import fingerprint
from sysid.studies.zoo.work import WRITERS, logs_of_fit

COMPARED: Final = ("plainly_visible", "least_on_bench", "least_elsewhere")
"""The thresholds that the page measures."""
OPTIONS: Final = GapOptions(next_experiment=False)
"""Of each study, which gets the logs of the fit besides."""
LIMITS: Final = (
    *("body_speed_limit", "body_acceleration_limit", "acceleration_limit"),
    *("command_deadband", "backlash", "stiction"),
)
"""What is hidden in robots: limits and thresholds, which may act for the first time in new commands."""


@dataclass(frozen=True)
class Limit:
    """What a limit or a threshold promises in the logs of a robot, as shares of a right model's cost."""

    effect: str
    explains: float
    """By how much it would lower the cost."""
    least: float
    """By how much it must, to be looked for: `least_elsewhere`, or more where the logs of the fit show it."""

    @property
    def is_familiar(self) -> bool:
        """Whether the logs of the fit excuse it, whatever `least_elsewhere` is."""
        return self.explains < self.least and self.least > THRESHOLDS.least_elsewhere


@dataclass(frozen=True)
class Measured:
    """What a study compares with the thresholds."""

    seed: int
    hidden: str
    """Name of the hidden effect; empty if there is none."""
    signal: float
    """Rms of what it does to the logs, over the noise of repeats."""
    weighted: float
    """Cost of the model as it is, over that of a right one."""
    plain: float
    """The same of the plain squares, which decide on the bench alone."""
    limits: tuple[Limit, ...] = ()
    """Of a robot."""
    best: str = ""
    """The best set of effects of a drive; empty if chance would explain as much."""
    fall: float = 0.0
    """By how much it lowers the cost, as a share of a right model's."""

    @property
    def is_plain(self) -> bool:
        """Whether the squares, weighted or plain, are plainly visible."""
        return max(self.weighted, self.plain) > THRESHOLDS.plainly_visible

    @property
    def deciding(self) -> Limit:
        """The hidden one, by its best form; where nothing is hidden, the largest that is not familiar."""
        if self.hidden:
            return _most([one for one in self.limits if cause_of(one.effect) == self.hidden])
        return _most([one for one in self.limits if not one.is_familiar])

    @property
    def familiar(self) -> Limit:
        """The largest of those that the logs of the fit excuse."""
        return _most([one for one in self.limits if one.is_familiar])


def main(
    drives: int = 40,
    hidden_drives: int = 20,
    robots: int = 4,
    hidden_robots: int = 4,
    out: Path = Path("out/calibration"),
    markdown: Path | None = None,
) -> None:
    """Draw cases, fit and study them, and print what their values say of two thresholds.

    An interrupted run goes on where it was, unless the code has changed since.

    Example: python benchmarks/calibration.py --robots 0 --hidden-robots 0

    Args:
        drives: Number of drives in which nothing changed.
        hidden_drives: Number of drives with a hidden effect of a clear size.
        robots: Number of robots in which nothing changed.
        hidden_robots: Number of robots with a hidden limit or threshold of a clear size.
        out: Folder for finished cases.
        markdown: Markdown file to write the page to.
    """
    require_at_least(0, drives=drives, hidden_drives=hidden_drives)
    require_at_least(0, robots=robots, hidden_robots=hidden_robots)
    folder = out / fingerprint()
    on_bench = [*quiet("bench", drives), *hidden("bench", hidden_drives)]
    on_wheels = [*quiet("robot", robots), *hidden("robot", hidden_robots)]
    print_page(
        page(
            [_kept("bench", seed, folder) for seed in on_bench],
            [_kept("robot", seed, folder) for seed in on_wheels],
        ),
        markdown,
    )


def quiet(level: Level, count: int) -> list[int]:
    """Return the first seeds of a level in which nothing is hidden."""
    kind_of = bench.kind_of if level == "bench" else robot.kind_of
    return list(islice((seed for seed in DEVELOPMENT if kind_of(seed)[0] == "quiet"), count))


def hidden(level: Level, count: int) -> list[int]:
    """Return the first seeds of a level that hide one clear effect; of robots, a limit or threshold."""
    kind_of = bench.kind_of if level == "bench" else robot.kind_of
    draw: Callable[[int], tuple[Case, object, object]] = (
        bench.draw_bench_case if level == "bench" else robot.draw_robot_case
    )

    def is_wanted(seed: int) -> bool:
        if kind_of(seed)[0] != "single":
            return False
        case = draw(seed)[0]
        is_limit = level == "bench" or case.hidden[0].name in LIMITS
        return is_limit and size_of(case.signal) in VISIBLE

    return list(islice(filter(is_wanted, DEVELOPMENT), count))


def _kept(level: Level, seed: int, folder: Path) -> Measured:
    """Return what the study of a case compares, from a `folder` of finished cases if it is there."""
    path = folder / f"{level}-{seed:04d}.json"
    if not path.is_file():
        with TemporaryDirectory() as made:
            write_json(path, asdict(_measured(level, seed, Path(made))))
        print(f"{level} {seed} is measured", file=sys.stderr, flush=True)
    return from_json(read_json(path))


def from_json(entry: Mapping[str, Any]) -> Measured:
    """Return what was measured, from the values that `dataclasses.asdict` gave."""
    return Measured(**{**entry, "limits": tuple(Limit(**limit) for limit in entry["limits"])})


def _measured(level: Level, seed: int, folder: Path) -> Measured:
    """Write the logs of a case to an empty `folder`, fit its model and begin its study."""
    case = WRITERS[level](seed, folder)
    data, search = _begun(folder)
    problem, base = search.problem, search.base
    limits: list[Limit] = []
    best, fall, right = "", 0.0, expected(problem, base)
    if level == "robot":
        library = [*search.considered.searched, *search.considered.left_out]
        gains, least = promised_gains(problem, library), search.considered.least
        limits = [
            Limit(name, gains.get(name, 0.0) / problem.size, least[name] / problem.size)
            for name in sorted(without_first_order(library))
        ]
    else:
        with without_engine_warnings(), one_thread():
            facts = explore(search, data.floor, OPTIONS.max_effects, np.random.default_rng(OPTIONS.seed))
        if facts.chosen is not None:
            best = " + ".join(facts.chosen.names)
            fall = (base.cost - facts.chosen.fitted.cost) / right
    return Measured(
        seed,
        "+".join(effect.name for effect in case.hidden),
        case.signal,
        base.cost / right,
        plain_ratio(problem, base),
        tuple(limits),
        best,
        fall,
    )


def _begun(folder: Path) -> tuple[StudyData, Search]:
    """Return what a case's study decides on, and its search before any set of effects is fitted."""
    model = nominal_model(folder)
    logs, fitted_on = (
        weighted_down(each)[0] for each in (read_dataset(folder / "logs"), logs_of_fit(folder))
    )
    late = AlignedLogs.stated(logs, model)
    if late is not None:
        logs, model, fitted_on = late.dataset, late.model, late.beside(fitted_on)
    options = replace(OPTIONS, fitted_on=fitted_on)
    considered = effects_for(logs, options.plant)
    settings = SimulationSettings(options.plant, options.jobs, seed=options.seed)
    with without_engine_warnings(), one_thread():
        data = study_data(logs, model, options)
        return data, start_search(data, model, settings, considered, silent)


def page(drives: Sequence[Measured], robots: Sequence[Measured]) -> Iterator[str]:
    """Yield the paragraphs of the page."""
    yield "# Results of `python benchmarks/calibration.py`"
    yield (
        f"{written()} Drives and robots of [the zoo](zoo.md), of development seeds: the first ones in which "
        "nothing changed, and the first ones that hide an effect of a clear size or more, in robots a limit "
        "or a threshold. A model is fitted to the logs before. A study of the logs after, beside those of "
        "the fit, goes as far as the values that are compared with three thresholds. The signal is the rms "
        "of what the hidden effect does to the logs over the noise of repeats."
    )
    yield "## Both sides of three thresholds"
    yield markdown_table(
        (
            "threshold",
            "value",
            "what is compared",
            "quiet, largest",
            "above it",
            "hidden, smallest",
            "above it",
        ),
        summary(drives, robots),
    )
    yield "## Drives"
    yield (
        "The squared difference between logs and model over what the logs of the fit let expect of a right "
        "model, weighted and in plain squares: `plainly_visible`."
    )
    yield markdown_table(
        ("drive", "hidden", "signal", "weighted", "plain squares"),
        [(*_case(one), f"{one.weighted:.2f}", f"{one.plain:.2f}") for one in drives],
    )
    yield "## Robots"
    yield (
        "The limit or the threshold that explains most and that the logs of the fit do not excuse, or the "
        "hidden one, as a share of a right model's cost; and what it must explain to be looked for: "
        "`least_elsewhere`, or more where the logs of the fit show it, too. Then the largest one that these "
        "excuse, and the weighted squares as above."
    )
    yield markdown_table(
        ("robot", "hidden", "signal", "limit or threshold", "explains", "must", "excused", "explains", "must",
         "weighted"),
        [
            (*_case(one), *_cells(one.deciding), *_cells(one.familiar), f"{one.weighted:.2f}")
            for one in robots
        ],
    )  # fmt: skip
    yield "## All thresholds"
    yield "What `sysid/gap/search/thresholds.py` says of the others, and of where their values come from."
    source = Path(thresholds.__file__).read_text(encoding="utf-8")
    said = comments(source, "Thresholds")
    yield markdown_table(
        ("threshold", "value", "what it is, and its source"),
        [
            (f"`{name}`", f"{getattr(THRESHOLDS, name):g}", text)
            for name, text in said.items()
            if name not in COMPARED
        ],
    )


def summary(drives: Sequence[Measured], robots: Sequence[Measured]) -> list[tuple[str, ...]]:
    """Return, for each comparison with a threshold, its largest quiet and smallest hidden value.

    Beside each is how many values are above the threshold.
    """
    visible, on_bench, elsewhere = COMPARED
    hardly = [one for one in drives if not one.is_plain]
    compared: list[tuple[str, str, Sequence[Measured], Callable[[Measured], float]]] = [
        (visible, "drives, plain squares", drives, lambda one: one.plain),
        (visible, "drives, weighted squares", drives, lambda one: one.weighted),
        (visible, "robots, weighted squares", robots, lambda one: one.weighted),
        (on_bench, "drives, best set where nothing is plainly visible", hardly, lambda one: one.fall),
        (elsewhere, "robots, limits and thresholds", robots, lambda one: one.deciding.explains),
    ]
    rows = []
    for name, words, cases, value_of in compared:
        threshold = getattr(THRESHOLDS, name)
        without = [value_of(one) for one in cases if not one.hidden]
        within = [value_of(one) for one in cases if one.hidden]
        largest = f"{max(without):.3g}" if without else "-"
        smallest = f"{min(within):.3g}" if within else "-"
        above = [f"{sum(value > threshold for value in side)} of {len(side)}" for side in (without, within)]
        rows.append((f"`{name}`", f"{threshold:g}", words, largest, above[0], smallest, above[1]))
    return rows


def comments(source: str, name: str) -> dict[str, str]:
    """Return the text below each field of the class of some `name` in a source, as one line."""
    (found,) = (n for n in ast.parse(source).body if isinstance(n, ast.ClassDef) and n.name == name)
    texts = {}
    for field, below in zip(found.body, found.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            value = below.value if isinstance(below, ast.Expr) else None
            text = value.value if isinstance(value, ast.Constant) else ""
            texts[field.target.id] = " ".join(str(text).split())
    return texts


def _case(one: Measured) -> tuple[str, str, str]:
    return (str(one.seed), one.hidden or "nothing", f"{one.signal:.2g}" if one.hidden else "-")


def _cells(one: Limit) -> tuple[str, str, str]:
    return (one.effect, f"{one.explains:.3f}", f"{one.least:.3f}") if one.effect else ("-", "-", "-")


def _most(limits: Collection[Limit]) -> Limit:
    return max(limits, key=lambda one: one.explains, default=Limit("", 0.0, 0.0))


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/calibration.py"))
