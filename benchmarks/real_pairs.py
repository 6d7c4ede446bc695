"""What the gap workflow says of real recordings before and after one known change, as a Markdown page.

A law and the effects of its drive are fitted to the recording before the change, and compared with the one
after it. What was changed is known, so that answers are right or wrong; how much they close is compared with
a free correction (`sysid.studies.free_correction`).

Example: python benchmarks/real_pairs.py --markdown docs/results/real_pairs.md

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import numpy as np
from harmonics import harmonics_rpm
from recordings import print_page, recordings, written

from mecanum_env.cli import run
from mecanum_env.effects import CATALOGUE
from mecanum_env.markdown import markdown_table
from mecanum_env.units import FloatArray
from sysid.compare.least_squares.phases import FREQUENCIES
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.wording import set_name, sizes_in
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset
from sysid.studies.free_correction import free_correction
from sysid.studies.score import FOUND, WRONG_ANSWERS, word_of

PAIRS = (
    ("robotino/bench_with_integral", "robotino/bench_without_integral", "the drive's integral term is off: "
     "Coulomb friction as a droop", "coulomb_friction"),
    ("robotino/floor_table", "robotino/floor_gray", "another floor: 2.5 rpm more of Coulomb friction",
     "coulomb_friction"),
)  # fmt: skip
"""Recordings before and after one known change: two folders with the same motors, what changed, its name."""
RIPPLES = frozenset(effect.cause for effect in CATALOGUE.values() if effect.follows_angle)


def main(starts: int = 5, jobs: int = 1, markdown: Path | None = None) -> None:
    """Fit and study the pairs and print the page; without recordings, say so and stop.

    Example: python benchmarks/real_pairs.py

    Args:
        starts: Number of starts of each fit.
        jobs: Simulations at a time.
        markdown: Markdown file to write the page to.
    """
    folder = recordings("robotino")
    if folder is not None:
        print_page(page(folder, starts, jobs), markdown)


def page(folder: Path, starts: int, jobs: int) -> Iterator[str]:
    """Yield the paragraphs of the page."""
    yield "# Results of `python benchmarks/real_pairs.py`"
    yield (
        f"{written()} Recordings of a Robotino's motors before and after one "
        "known change. A law and the effects of its drive are fitted to the recording before, and compared "
        "with the one after. Frictions are in rpm of droop. A free correction is a regression of the "
        "difference on smooth functions of command, speed and time: what could be removed at all on test "
        "runs. Closure is the share of that which the set named first removes. Times are of one processor. "
        "The words are those of [GapBench](gapbench.md); a ripple that all motors of a recording share is "
        "taken as there."
    )
    rows, words, closures, swings = [], [], [], []
    for before, after, _, truth in PAIRS:
        motors = sorted(path.name for path in (folder / before).iterdir() if path.is_dir())
        logs = {name: [read_dataset(folder / name / motor) for motor in motors] for name in (before, after)}
        ripples = {name: [harmonics_rpm(one) for one in of_motors] for name, of_motors in logs.items()}
        swings += [(Path(name).name, *map(_most, of_motors)) for name, of_motors in ripples.items()]
        most = {FREQUENCIES[int(np.argmax(one))] for one in ripples[after]}
        for motor, old, new in zip(motors, logs[before], logs[after], strict=True):
            began = process_time()
            model = fitted_model(fit_dataset(old, FitOptions(starts=starts)))
            fit_s, began = process_time() - began, process_time()
            report = analyse(new, model, GapOptions(fitted_on=old, jobs=jobs, next_experiment=False))
            took = process_time() - began
            gap, (plain, free) = report.gap, free_correction(new, model)
            closure = (1.0 - gap.after / gap.before) / (1.0 - free / plain)
            claims = _claims(report, most)
            words.append(word_of("single", frozenset([truth]), report.verdict, claims))
            closures.append(closure)
            had = "; ".join(f"{set_name([name])} {sizes_in(model, name)}" for name in model.effects)
            found = " or ".join(set_name(names) for names in report.candidates) or report.verdict
            now = "; ".join(f"{set_name([e.name])} {sizes_in(report.model, e.name)}" for e in report.effects)
            rows.append(
                (Path(after).name, motor, had, report.verdict, found, now or "-", words[-1],
                 f"{gap.before:.3g} -> {gap.after:.3g} rpm", f"{free:.3g} rpm", f"{closure:.0%}",
                 f"{fit_s:.0f} + {took:.0f} s")
            )  # fmt: skip
            print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    yield "; ".join(f"{Path(after).name}: {changed}" for _, after, changed, _ in PAIRS) + "."
    yield markdown_table(
        ("after", "motor", "fitted before", "verdict", "found", "now", "that is", "test rms",
         "free correction", "closure", "fit + study"),
        rows,
    )  # fmt: skip
    yield (
        "Largest ripple in the measured speeds themselves, without a model (`benchmarks/harmonics.py`), as "
        f"periods per turn of 1 to {FREQUENCIES[-1]}: its amplitude, and in brackets the median of all:"
    )
    yield markdown_table(("recording", *motors), swings)
    good, wrong = (sum(one in known for one in words) for known in (FOUND, WRONG_ANSWERS))
    yield (
        f"Right or rightly ambiguous: {good} of {len(words)}; false names: {wrong}; median closure "
        f"{np.median(closures):.0%} of what a free correction removes."
    )


def _most(amplitudes_rpm: FloatArray) -> str:
    """Return the largest ripple in words."""
    largest = int(np.argmax(amplitudes_rpm))
    median = np.median(amplitudes_rpm)
    return f"{FREQUENCIES[largest]}: {amplitudes_rpm[largest]:.2f} rpm ({median:.2f})"


def _claims(report: GapReport, most: set[int]) -> tuple[frozenset[str], ...]:
    """Return the sets that a report names, without a ripple whose periods per turn all motors have `most`."""
    ripples = [effect.name for effect in report.effects if effect.cause in RIPPLES]
    shared = len(most) == 1 and {report.model.effects[name]["per_turn"] for name in ripples} == most
    return tuple(frozenset(names) - (RIPPLES if shared else frozenset()) for names in report.candidates)


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/real_pairs.py"))
