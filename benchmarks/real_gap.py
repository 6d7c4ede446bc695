"""What the gap workflow finds in recordings of real robots, as a Markdown page.

A law is fitted to the part of each recording with small commands, the model is compared with the whole, and
the effects found are added; the improved model is studied again until nothing more is found. Robots are
simulated on the planar plant: these are no Mecanum robots, and rollers would be wrong as well as slow.

Example: python benchmarks/real_gap.py --out out/real_gap.json --markdown docs/results/real_gap.md

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder. Their true effects are
not known; the page says what is found and what is left.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Annotated, Any

import numpy as np
import tyro
from recordings import recordings, written

from mecanum_env.cli import run
from mecanum_env.errors import MecanumError
from mecanum_env.files import write_json, write_text
from mecanum_env.law import WheelLaw
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model, read_robot
from sysid.compare.measured import select_runs, small_command_runs
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.fit.pipeline import Fit
from sysid.gap.report.output import gap_json
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.wording import (
    amount,
    compared_runs,
    concentrations,
    interval_text,
    place_name,
    set_name,
    sizes,
    sizes_in,
    unit_of,
    verdict_sentence,
    with_share,
)
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, read_dataset

DATASETS = ("husky/body", "micromouse/duty_left", "micromouse/duty_right",
            "micromouse/closed_loop_left", "micromouse/closed_loop_right")  # fmt: skip
SECONDS = {"bench": 60.0, "robot": 40.0}
"""Duration of the runs that decide [s], for which a study takes a minute or two of processor time."""
FIT_S = 40.0
"""Duration of the runs that a law is fitted to [s], if those with small commands do not suffice."""
SHOWN = 6
"""Number of sets in the table of evidence."""


@dataclass(frozen=True)
class Round:
    """One study of a recording."""

    report: GapReport | None
    """None if the study failed."""
    error: str
    """Why it failed."""
    seconds: float
    """Processor time [s]."""


def main(
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = DATASETS,
    /,
    starts: int = 5,
    rounds: int = 1,
    max_effects: int = 3,
    seconds: float | None = None,
    only: tuple[str, ...] = (),
    jobs: int = 1,
    out: Path | None = None,
    markdown: Path | None = None,
) -> None:
    """Fit and study the recordings and print the page; without recordings, say so and stop.

    Example: python benchmarks/real_gap.py micromouse/duty_left --rounds 1

    Args:
        names: Recordings to study, as subfolders.
        starts: Number of starts of each fit.
        rounds: Largest number of studies of a recording, each of the model that the one before improved.
        max_effects: Size of the largest set of effects in one study.
        seconds: Duration of the fit and validation runs that decide [s]; default 60 (bench), 40 (robot).
        only: Effects to consider; default: all.
        jobs: Simulations at a time.
        out: JSON file to write.
        markdown: Markdown file to write the page to.
    """
    folder = recordings("husky", "micromouse")
    if folder is None:
        return
    parts = [
        "# Results of `python benchmarks/real_gap.py`",
        f"{written()} Recordings of real robots, whose true effects "
        "are not known: what the gap workflow finds, and what is left. A law is fitted to a part of each "
        "recording, and pieces of its fit and validation runs that cover the speeds decide; test runs take "
        "part in neither and are shown whole. Times are of one processor. The robot is simulated on the "
        "planar plant: it is no Mecanum robot, and only drives ahead and turns.",
    ]
    if only:
        parts.append(f"Only {', '.join(only)} were considered.")
    results: dict[str, Any] = {}
    for name in names:
        data = read_dataset(folder / name)
        options = GapOptions(
            only=only,
            max_effects=max_effects,
            seconds=SECONDS[data.level] if seconds is None else seconds,
            plant="planar" if data.level == "robot" else "rollers",
            jobs=jobs,
            next_experiment=False,
        )
        began = process_time()
        model, how = fitted(data, folder / name / "robot.json", starts)
        took = process_time() - began
        done = studies(data, model, options, rounds)
        had = "; ".join(f"{set_name([one])} {sizes_in(model, one)}" for one in model.effects)
        beside = f" Beside the law it has {had}." if had else ""
        shown = [f"## {name}", f"{how} {took:.0f} s.{beside}", *page(done)]
        print("\n\n".join(shown), flush=True)
        parts += shown
        results[name] = [
            {"error": one.error} if one.report is None else {"seconds": one.seconds, **gap_json(one.report)}
            for one in done
        ]
    if markdown is not None:
        write_text(markdown, "\n\n".join(parts) + "\n")
    if out is not None:
        write_json(out, results)


def fitted(data: Dataset, robot: Path, starts: int) -> tuple[Model, str]:
    """Fit a recording, with the robot's known dimensions if a file has them; return the model and how.

    The part with small commands is fitted if its law settles while a command is held; otherwise something in
    it (a dead band, say) is not linear, and a selection that covers all speeds is fitted.
    """
    options = FitOptions(starts=starts)
    if robot.is_file():
        given = tuple(json.loads(robot.read_text(encoding="utf-8")))
        options = replace(options, robot=read_robot(robot), robot_given=given)
    period = min(run.median_interval_s for run in data.runs)
    part = small_command_runs(data, period)
    if part is not data:
        fit = fit_dataset(part, options)
        if settles(fit, fitted_model(fit).wheel.law):
            said = f"{part_text(part)}, in which commands stay below half of the fastest"
            return fitted_model(fit), f"Fitted to {said}."
    runs = select_runs(data.split("fit") + data.split("validation"), FIT_S, period)
    part = replace(data, runs=runs)
    return fitted_model(fit_dataset(part, options)), f"Fitted to {part_text(part)} that cover all speeds."


def settles(fit: Fit, law: WheelLaw) -> bool:
    """Return whether the slowest mode of a law, as the model has it, settles while a command is held."""
    slowest = float(np.max(np.abs(law.poles)))
    held = max(
        float(np.max(np.diff([*run.command_changes()[0], run.duration_s]))) for run in fit.dataset.runs
    )
    return slowest < 1.0 and -law.sample_period_s / math.log(max(slowest, 1e-300)) < held


def part_text(part: Dataset) -> str:
    """Return the number and the duration of runs."""
    seconds = sum(run.duration_s for run in part.runs)
    return f"{len(part.runs)} runs or pieces of runs ({seconds:.0f} s)"


def studies(data: Dataset, model: Model, options: GapOptions, rounds: int) -> list[Round]:
    """Study a recording, then with the improved model again, until nothing more is found."""
    done: list[Round] = []
    for _ in range(rounds):
        try:
            began = process_time()
            report = analyse(data, model, options)
        except (MecanumError, ValueError) as error:
            return [*done, Round(None, str(error), 0.0)]
        done.append(Round(report, "", process_time() - began))
        if not report.effects:
            break
        model = report.model
    return done


def page(done: Sequence[Round]) -> Iterator[str]:
    """Yield the paragraphs of one recording."""
    for number, one in enumerate(done, start=1):
        if len(done) > 1:
            yield f"### Study {number}" + (" (of the improved model)" if number > 1 else "")
        if one.report is None:
            yield f"The study could not be made: {one.error}"
            continue
        yield from study(one.report)
        yield f"{one.seconds:.0f} s."
    made = [one.report for one in done if one.report is not None]
    if made:
        yield whole(made)


def study(report: GapReport) -> Iterator[str]:
    """Yield the paragraphs of one study."""
    yield verdict_sentence(report)
    if report.effects:
        yield markdown_table(
            ("effect", "parameter", "value", "90 % interval", "selected"),
            [
                (found.name, name, *interval_text(estimate, unit_of(found.name, name)),
                 f"{found.selection_frequency:.0%}")
                for found in report.effects
                for name, estimate in found.parameters.items()
            ],
        )  # fmt: skip
    if len(report.candidates) > 1:
        yield "As good: " + "; ".join(set_name(names) for names in report.candidates[1:]) + "."
    yield markdown_table(
        ("channel", "before", "after", "removed"),
        [
            (name, with_share(c.before, c), with_share(c.after, c), f"{1.0 - c.after / c.before:.0%}")
            for name, c in report.channels.items()
        ],
    )
    yield markdown_table(
        ("set", "sizes", "score", "validation rms", "test rms"),
        [
            (set_name(e.effects), "; ".join(f"{n}: {sizes(n, v)}" for n, v in e.parameters.items()),
             f"{e.score:.0f}", f"{e.validation_rms:.3g}", f"{e.test_rms:.3g}")
            for e in report.evidence[:SHOWN]
        ],
    )  # fmt: skip
    places = concentrations(report)
    if places:
        yield "Most of the error before: " + "; ".join(
            f"{place_name(p.region)} ({p.region.share:.0%} of it, {p.sample_share:.0%} of the samples)"
            for p in places
        ) + "."  # fmt: skip
    left = sorted(report.where, key=lambda r: -r.rms_after * r.samples**0.5)[:3]
    yield "Most of what is left: " + "; ".join(
        f"{place_name(r)} ({amount(r.rms_after, report.channels[r.channel].unit)} rms)" for r in left
    ) + "."  # fmt: skip
    if report.notes:
        yield "\n".join(f"- {note}" for note in report.notes)


def whole(made: Sequence[GapReport]) -> str:
    """Return what all studies together removed of each channel's error."""
    first, last = made[0], made[-1]
    share = [
        f"{name} {1.0 - last.channels[name].after / first.channels[name].before:.0%} "
        f"({amount(first.channels[name].before, first.channels[name].unit)} to "
        f"{amount(last.channels[name].after, last.channels[name].unit)})"
        for name in first.channels
    ]
    return f"All studies together removed of the rms error on {compared_runs(last)}: {', '.join(share)}."


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/real_gap.py"))
