"""What the gap workflow finds in recordings of real robots, as a Markdown page.

Each recording is fitted as it is, the model compared with the same recording, the effects found added, and
the improved model compared again, until nothing more is found.

Example: python benchmarks/real_gap.py --out out/real_gap.json --markdown docs/results/real_gap.md

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder. No truth is known here:
the page says what is found and what is left.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from mecanum_env.cli import run
from mecanum_env.errors import MecanumError
from mecanum_env.files import write_json, write_text
from mecanum_env.model import Model, Robot, robot_from_dict
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.analyse import analyse
from sysid.gap.records import GapOptions, GapReport
from sysid.gap.subset import liveliest
from sysid.gap.verdict import (
    amount,
    concentrations,
    interval_text,
    place_name,
    set_name,
    sizes,
    unit_of,
    verdict_sentence,
)
from sysid.logs import Dataset, Run, read_dataset
from sysid.measure import seconds_of

BESIDE_THE_CHECKOUT = Path(__file__).parents[1].parent / "shared" / "data"
DATASETS = ("husky/body", "micromouse/duty_left", "micromouse/duty_right",
            "micromouse/closed_loop_left", "micromouse/closed_loop_right")  # fmt: skip
PIECE_S = 11.0
"""Two commands of the husky."""
BEFORE_S = 0.5
SHOWN = 6
"""Sets in the table of evidence."""


@dataclass(frozen=True)
class Round:
    """One study of a recording."""

    report: GapReport | None
    """None where it could not be made."""
    error: str
    """Why."""
    seconds: float


def main(
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = DATASETS,
    /,
    starts: int = 5,
    rounds: int = 3,
    max_effects: int = 3,
    seconds: float | None = None,
    only: tuple[str, ...] = (),
    jobs: int = 1,
    out: Path | None = None,
    markdown: Path | None = None,
) -> None:
    """Fit and study the recordings and print the page; say so and stop where there are none.

    Example: python benchmarks/real_gap.py micromouse/duty_left --rounds 1

    Args:
        names: which recordings.
        starts: of each fit.
        rounds: studies of each recording at most, each of the model that the one before improved.
        max_effects: largest set of effects in one study.
        seconds: of the liveliest fit and validation runs that decide; by default what the study takes.
        only: effects to consider; default: all.
        jobs: simulations at a time.
        out: JSON file to write.
        markdown: file to write the page to.
    """
    folder = Path(os.environ.get("MECANUM_REAL_LOGS", BESIDE_THE_CHECKOUT))
    if not (folder / "husky").is_dir():
        print("no real logs here; set MECANUM_REAL_LOGS to the folder that holds husky/ and micromouse/")
        return
    parts = [
        "# Results of `python benchmarks/real_gap.py`",
        "Written by the command itself; do not edit. Recordings of real robots, where no truth is known: "
        "what the gap workflow finds, and what is left. Each model was fitted to the recording that it is "
        "compared with, so how far a law errs by itself is not known from other logs.",
    ]
    if only:
        parts.append(f"Considered were only {', '.join(only)}.")
    if seconds is not None:
        parts.append(
            f"Decided on {seconds:g} s of each recording, in pieces of {PIECE_S:g} s and more, the liveliest."
        )
    results: dict[str, Any] = {}
    for name in names:
        data = shortened(read_dataset(folder / name), seconds)
        options = GapOptions(only=only, max_effects=max_effects, jobs=jobs, next_experiment=False)
        done = studies(data, fitted(data, folder / name / "robot.json", starts), options, rounds)
        parts += page(name, done)
        results[name] = [round_json(one) for one in done]
        print("\n\n".join(parts[-1:]), flush=True)
    text = "\n\n".join(parts) + "\n"
    print(text)
    if markdown is not None:
        write_text(markdown, text)
    if out is not None:
        write_json(out, results)


def shortened(data: Dataset, seconds: float | None) -> Dataset:
    """Return a recording with less to decide on, the test runs untouched.

    Fit and validation runs are cut into pieces of some commands, and the liveliest pieces kept; of a long
    run some all over it. A piece ends `BEFORE_S` before the next command, when the robot has settled.
    """
    if seconds is None:
        return data
    pieces: list[Run] = []
    for one in data.split("fit") + data.split("validation"):
        own = list(cut(one))
        pieces += own[:: max(1, round(2.0 * one.duration_s / seconds))]
    return replace(data, runs=(*liveliest(pieces, seconds), *data.split("test")))


def cut(run: Run) -> Iterator[Run]:
    """Yield pieces of a run, each at least `PIECE_S` long but for the last."""
    edges = [0.0]
    for change in run.command_changes()[0][1:]:
        if change - BEFORE_S - edges[-1] >= PIECE_S:
            edges.append(float(change) - BEFORE_S)
    ends = [*edges[1:], np.inf]
    for number, (start, end) in enumerate(zip(edges, ends, strict=True)):
        rows = (run.time_s >= start) & (run.time_s < end)
        columns = [getattr(run.command, field.name)[rows] for field in fields(run.command)]
        # The file keeps its name: by it the data check's findings are known.
        yield replace(
            run,
            group=f"{run.group}, piece {number}",
            time_s=run.time_s[rows] - run.time_s[rows][0],
            command=type(run.command)(*columns),
            channels={name: values[rows] for name, values in run.channels.items()},
        )


def fitted(data: Dataset, robot: Path, starts: int) -> Model:
    """Fit a recording, with the robot's known dimensions where a file has them."""
    options = FitOptions(starts=starts)
    if robot.is_file():
        known = json.loads(robot.read_text(encoding="utf-8"))
        options = replace(options, robot=robot_of(known), robot_given=tuple(known))
    return fitted_model(fit_dataset(data, options))


def robot_of(known: dict[str, float]) -> Robot:
    """Return a robot of known dimensions and mass, its yaw inertia that of a solid plate of its size."""
    if "yaw_inertia_kg_m2" not in known:
        size = known["half_wheelbase_m"] ** 2 + known["half_track_m"] ** 2
        known = {**known, "yaw_inertia_kg_m2": known["mass_kg"] * size / 3.0}
    return robot_from_dict(known)


def studies(data: Dataset, model: Model, options: GapOptions, rounds: int) -> list[Round]:
    """Study a recording, then the improved model, until nothing more is found."""
    done: list[Round] = []
    for _ in range(rounds):
        try:
            report, seconds = seconds_of(lambda model=model: analyse(data, model, options))  # type: ignore[misc]
        except (MecanumError, ValueError) as error:
            return [*done, Round(None, str(error), 0.0)]
        done.append(Round(report, "", seconds))
        if not report.effects:
            break
        model = report.model
    return done


def page(name: str, done: Sequence[Round]) -> Iterator[str]:
    """Yield the paragraphs of one recording."""
    yield f"## {name}"
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
        yield table(
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
    yield table(
        ("channel", "before", "after", "removed"),
        [
            (name, amount(c.before, c.unit), amount(c.after, c.unit), f"{1.0 - c.after / c.before:.0%}")
            for name, c in report.channels.items()
        ],
    )
    yield table(
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
    """Return what all studies together removed on the test runs, channel by channel."""
    first, last = made[0], made[-1]
    share = [
        f"{name} {1.0 - last.channels[name].after / first.channels[name].before:.0%} "
        f"({amount(first.channels[name].before, first.channels[name].unit)} to "
        f"{amount(last.channels[name].after, last.channels[name].unit)})"
        for name in first.channels
    ]
    return "All studies together removed of the held-out rms: " + ", ".join(share) + "."


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Return a Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def round_json(one: Round) -> dict[str, Any]:
    """Return one study for the JSON file."""
    if one.report is None:
        return {"error": one.error}
    report = one.report
    return {
        "seconds": one.seconds,
        "verdict": report.verdict,
        "candidates": report.candidates,
        "effects": {
            f.name: {p: [i.value, i.low, i.high] for p, i in f.parameters.items()} for f in report.effects
        },
        "channels": {n: {"before": c.before, "after": c.after} for n, c in report.channels.items()},
        "notes": report.notes,
    }


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/real_gap.py"))
