"""What the formula errors of robots rest on: what right effects leave beside the logs of a fit, as a page.

Robots of the zoo with one hidden effect drive the commands of their fit again. Of all sets of effects that a
study fits, this compares the hidden effect alone with the best single effect and with the best set, as
`robot_formula` and `crude_robot_formula` of `sysid/gap/search/thresholds.py` do.

Example: python benchmarks/robot_formulas.py --markdown docs/results/robot_formulas.md
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from recordings import print_page, written

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import plain_json, write_json
from mecanum_env.markdown import markdown_table
from mecanum_env.model import cause_of
from mecanum_env.parallel import one_thread
from mecanum_env.reading import read_json
from sysid.compare.predicted import without_engine_warnings
from sysid.gap.inquiry import Inquiry, inquire
from sysid.gap.result import GapOptions
from sysid.gap.search.known_effects import effects_for
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import read_dataset
from sysid.logs.tails import weighted_down
from sysid.progress import silent
from sysid.studies.score import VISIBLE, size_of
from sysid.studies.zoo.cases.robot.draw import draw_robot_case
from sysid.studies.zoo.cases.robot.schedule import kind_of
from sysid.studies.zoo.cases.write import write_robot_case
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.seeds import DEVELOPMENT
from sysid.studies.zoo.sources import fingerprint
from sysid.studies.zoo.work import logs_of_fit


@dataclass(frozen=True)
class Left:
    """What the hidden effect of a robot leaves."""

    seed: int
    hidden: str
    signal: float
    """Rms of what it does to the logs, over the noise of repeats."""
    beside_single: float
    """Rms that it leaves beyond the best single effect, relative to what that one explains; NaN if it was not
    fitted, since nothing was significant."""
    beside_best: float
    """The same beyond the best set of any size."""


HEAD: Final = ("robot", "hidden", "signal", "beyond the best single effect", "beyond the best set")


def main(
    robots: int = 4,
    first_seed: int = 64,
    out: Path = Path("out/robot_formulas"),
    markdown: Path | None = None,
) -> None:
    """Draw robots with one hidden effect, fit and study them, and print what that effect leaves.

    An interrupted run goes on where it was, unless the code has changed since.

    Example: python benchmarks/robot_formulas.py --robots 8

    Args:
        robots: Number of robots with one hidden effect of a clear size.
        first_seed: Seed from which they are drawn, one for development.
        out: Folder for finished cases.
        markdown: Markdown file to write the page to.
    """
    require_at_least(1, robots=robots)
    folder = out / fingerprint()
    print_page(page([_kept(seed, folder) for seed in seeds(robots, first_seed)]), markdown)


def seeds(count: int, first: int) -> list[int]:
    """Return the first development seeds from one on of robots that hide one clear effect."""

    def is_wanted(seed: int) -> bool:
        return kind_of(seed)[0] == "single" and size_of(draw_robot_case(seed)[0].signal) in VISIBLE

    return list(islice(filter(is_wanted, range(first, DEVELOPMENT.stop)), count))


def _kept(seed: int, folder: Path) -> Left:
    """Return what a robot's hidden effect leaves, from a `folder` of finished cases if it is there."""
    path = folder / f"robot-{seed:04d}.json"
    if not path.is_file():
        with TemporaryDirectory() as made:
            write_json(path, plain_json(asdict(_measured(seed, Path(made)))))
        print(f"robot {seed} is measured", file=sys.stderr, flush=True)
    entry = read_json(path)
    shares = {key: math.nan if entry[key] is None else entry[key] for key in ("beside_single", "beside_best")}
    return Left(**{**entry, **shares})


def _measured(seed: int, folder: Path) -> Left:
    """Write the logs of a robot to an empty `folder`, fit its model and study what was changed."""
    case = write_robot_case(seed, folder, "same")
    model = nominal_model(folder)
    logs, fitted_on = (
        weighted_down(each)[0] for each in (read_dataset(folder / "logs"), logs_of_fit(folder))
    )
    options = GapOptions(fitted_on=fitted_on, next_experiment=False)
    considered = effects_for(logs, options.plant)
    with without_engine_warnings(), one_thread():
        found = inquire(logs, model, options, considered, THRESHOLDS.false_alarm, silent)
    (hidden,) = case.hidden
    return Left(seed, hidden.name, case.signal, *left(hidden.name, *costs_of(found)))


def costs_of(found: Inquiry) -> tuple[float, dict[tuple[str, ...], float]]:
    """Return the cost of the model as it is, and that of each set of effects that a study fitted."""
    fitted = found.search.fitted.values()
    return found.search.base.cost, {one.names: one.cost for one in fitted if one.names}


def left(hidden: str, base: float, costs: dict[tuple[str, ...], float]) -> tuple[float, float]:
    """Return what the `hidden` cause leaves beyond the best single effect, and beyond the best set.

    Each is an rms relative to what the better one explains of the cost of the model as it is, `base`. Both
    are NaN where the cause was not fitted.
    """
    alone = {names: cost for names, cost in costs.items() if len(names) == 1}
    right = min((cost for (name,), cost in alone.items() if cause_of(name) == hidden), default=math.nan)
    beside_single, beside_best = (
        _share(right, min(better.values(), default=base), base) for better in (alone, costs)
    )
    return beside_single, beside_best


def _share(right: float, best: float, base: float) -> float:
    return math.sqrt((right - best) / (base - best)) if best < base else math.nan


def page(found: Sequence[Left]) -> Iterator[str]:
    """Yield the paragraphs of the page."""
    yield "# Results of `python benchmarks/robot_formulas.py`"
    yield (
        f"{written()} Robots of [the zoo](zoo_robots.md), of development seeds, that hide one effect of a "
        "clear size or more and drive the commands of their fit again. A model is fitted to the logs before "
        "and compared with those after. What the hidden effect alone leaves (rms) is given relative to what "
        "the best single effect explains, and relative to what the best set of any size does: 0 where it is "
        "the best. The signal is the rms of what it does to the logs over the noise of repeats."
    )
    yield markdown_table(HEAD, [_row(one) for one in found])
    yield markdown_table(
        ("threshold", "value", "right effects that leave no more"),
        [
            _covered("robot_formula", [one.beside_single for one in found]),
            _covered("crude_robot_formula", [one.beside_best for one in found]),
        ],
    )


def _row(one: Left) -> tuple[str, ...]:
    shares = (f"{one.beside_single:.2f}", f"{one.beside_best:.2f}")
    told = ("not fitted", "not fitted") if math.isnan(one.beside_single) else shares
    return (str(one.seed), one.hidden, f"{one.signal:.2g}", *told)


def _covered(name: str, shares: Sequence[float]) -> tuple[str, str, str]:
    value, known = getattr(THRESHOLDS, name), [share for share in shares if not math.isnan(share)]
    return f"`{name}`", f"{value:g}", f"{sum(share <= value for share in known)} of {len(known)}"


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/robot_formulas.py"))
