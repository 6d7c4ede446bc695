"""When a fit may find a gap in the gear: drawn drives, fitted with and without one, as a page.

Example: python benchmarks/fit_gaps.py --markdown docs/results/fit_gaps.md
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

import numpy as np
from recordings import print_page, written
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model, cause_of
from mecanum_env.parallel import one_thread
from mecanum_env.statistics import rms
from sysid.compare.predicted import predict_all
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.fit.effects import HeldOut, drive
from sysid.logs import Dataset, read_dataset
from sysid.studies.zoo.cases.bench import draw as bench_draw
from sysid.studies.zoo.cases.write import write_bench_case, write_bench_logs

SEEDS: Final = (328, 630, 764, 769, 818, 837, 846, 870, 897, 918, 938, 2047, 2056, 2060, 2061, 2066, 2084)
"""Bench seeds of the zoo in which a fit found a gap, of those that were at hand: some fifty of 184-996, which
are for development, and 2044-2089, whose sealed run was over."""
HEAD: Final = (
    *("drive", "family", "true gap [deg]", "found [deg]", "validation error by the gap"),
    *("in other commands with it [rpm]", "without [rpm]"),
)


@dataclass(frozen=True)
class Gap:
    """A drive whose fit found a gap."""

    seed: int
    family: str
    true_deg: float
    found_deg: float
    share: float
    """Error on the validation runs [sigmas], with the times of the log, over that of the fit without one."""
    with_rpm: float
    """Error in commands that the fit did not drive, where nothing had changed."""
    without_rpm: float
    """The same of the fit without a gap."""


def main(seeds: tuple[int, ...] = SEEDS, markdown: Path | None = None) -> None:
    """Fit drawn drives with any gap that helps, and with none, and compare both in other commands.

    Example: python benchmarks/fit_gaps.py --seeds 2066

    Args:
        seeds: Bench seeds of the zoo.
        markdown: Markdown file to write the page to.
    """
    found = [measured(seed) for seed in tqdm(seeds, desc="drives", unit="drive", disable=None)]
    print_page(page([one for one in found if one is not None]), markdown)


def measured(seed: int) -> Gap | None:
    """Fit the drive of a seed twice; return what its gap does, None if no fit finds one."""
    with TemporaryDirectory() as made, one_thread():
        case = write_bench_case(seed, Path(made))
        _, nominal, _ = bench_draw.draw_bench_case(seed)
        write_bench_logs(Path(made) / "quiet", nominal, bench_draw.case_commands(case, nominal), case)
        fitted_to, others = (read_dataset(Path(made) / name) for name in ("nominal", "quiet"))
    # Any gap that helps is worth it, or none is.
    with_gap, without = (fitted(fitted_to, worth) for worth in (0.0, 1.0))
    gaps = [values for name, values in with_gap.effects.items() if cause_of(name) == drive.GAP]
    if not gaps:
        return None
    held_out = HeldOut.of(fitted_to)
    (sigmas, _), (sigmas_without, _) = (held_out.errors(model) for model in (with_gap, without))
    return Gap(
        seed,
        case.family,
        nominal.gear.play_deg,
        float(gaps[0]["gap_deg"]),
        sigmas / sigmas_without,
        *(error_rpm(model, others) for model in (with_gap, without)),
    )


def fitted(dataset: Dataset, gap_worth: float) -> Model:
    """Return the model of the logs of a fit, with a gap that lowers the validation error by such a share."""
    with patch.object(drive, "GAP_WORTH", gap_worth):
        return fitted_model(fit_dataset(dataset, FitOptions()))


def error_rpm(model: Model, dataset: Dataset) -> float:
    """Return the rms error of the wheel speed [rpm]."""
    pairs = zip(dataset.runs, predict_all(model, dataset.runs), strict=True)
    errors = np.concatenate([run.channels["speed_rpm"] - told["speed_rpm"] for run, told in pairs])
    return rms(errors[np.isfinite(errors)])


def page(found: Sequence[Gap]) -> Iterator[str]:
    """Yield the paragraphs of the page."""
    yield "# Results of `python benchmarks/fit_gaps.py`"
    yield (
        f"{written()} Drives of [the zoo](zoo.md), of seeds for development or of sealed runs that are over, "
        "in whose logs a fit finds a gap in the gear if any gap that helps is taken. Each is fitted again "
        "without one. Both models then predict commands that no fit has seen, in which nothing was changed. "
        "A fit that gives each command a time of its own judges a gap beside these; the table has the times "
        "of the log."
    )
    yield markdown_table(HEAD, [_row(one) for one in found])
    kept = [one for one in found if one.share <= 1.0 - drive.GAP_WORTH]
    left = [one for one in found if one not in kept]
    yield (
        f"A gap is kept if it lowers the validation error by {drive.GAP_WORTH:.0%} or more. The error in "
        f"other commands with the gap is, in the geometric mean, {_ratio(kept):.2f} times that without it "
        f"for the {len(kept)} drives where it is kept, and {_ratio(left):.2f} times for the {len(left)} "
        "where it is left out."
    )


def _ratio(found: Sequence[Gap]) -> float:
    """Return the geometric mean of the errors with a gap over those without, NaN of no drive."""
    logarithms = [math.log(one.with_rpm / one.without_rpm) for one in found]
    return math.exp(sum(logarithms) / len(found)) if found else math.nan


def _row(one: Gap) -> tuple[str, ...]:
    degrees = (f"{one.true_deg:.2g}", f"{one.found_deg:.2g}")
    return (
        *(str(one.seed), one.family, *degrees, f"{one.share - 1.0:+.1%}"),
        *(f"{one.with_rpm:.3g}", f"{one.without_rpm:.3g}"),
    )


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/fit_gaps.py"))
