"""What a study sees of small, known changes of a robot on eight short runs, as a Markdown page.

The robots are drawn at random and driven by the zoo's own physics, which shares nothing with the simulator of
the models. A model is fitted to the nominal logs of each. Then one thing at a time is changed by as much as a
user would want to hear of, and the robot drives the commands of the fit again, or eight other runs with
starts and reversals; the study compares either with the logs of the fit.

Example: python benchmarks/robot_sensitivity.py --markdown docs/results/robot_sensitivity.md
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Literal

import numpy as np
from recordings import print_page

from mecanum_env.checkout import commit
from mecanum_env.cli import run
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model, read_model
from mecanum_env.units import FloatArray
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.wording import set_name, sizes_in
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, read_dataset
from sysid.studies.score import word_of
from sysid.studies.zoo.cases.robot.change import with_body, with_sensors
from sysid.studies.zoo.cases.robot.draw import fit_commands
from sysid.studies.zoo.cases.robot.plans import RUN_S, sequences
from sysid.studies.zoo.cases.robot.size import yardstick
from sysid.studies.zoo.cases.write import write_robot_logs, write_robot_nominal
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.robots.draw import draw_robot
from sysid.studies.zoo.robots.robot import Robot

RUNS, PLAN, STREAM = 8, "starts", 4200
SEEDS = (38, 41, 42)
"""Of three drawn robots. The first one was at hand when thresholds were set, the others were not."""
REPEATS = 2
"""Of each command sequence, where those of the fit are driven again."""
QUIET_SEEDS = 2
"""Sets of logs in which nothing is changed, of each kind of commands."""
_LUCK = 1000
"""What is added to a seed for other starts and other noise."""
PAYLOAD_HEIGHT_M = 0.2


def _heavier(robot: Robot) -> Robot:
    return with_body(robot, payload_kg=0.2 * robot.body.mass_kg, payload_height_m=PAYLOAD_HEIGHT_M)


def _larger_wheels(robot: Robot) -> Robot:
    fl, fr, rl, rr = (1.02 * scale for scale in robot.wheels.radius_scale)
    return replace(robot, wheels=replace(robot.wheels, radius_scale=(fl, fr, rl, rr)))


def _wider(robot: Robot) -> Robot:
    body = robot.body
    return with_body(
        robot, half_wheelbase_m=1.02 * body.half_wheelbase_m, half_track_m=1.02 * body.half_track_m
    )


def _turned(robot: Robot) -> Robot:
    return with_sensors(robot, turned_deg=robot.sensors.turned_deg + 1.0)


def _rubbing(robot: Robot) -> Robot:
    gear = robot.drive.gear
    rubbing = replace(gear, wheel_coulomb_n_m=gear.wheel_coulomb_n_m + 0.1)
    return replace(robot, drive=replace(robot.drive, gear=rubbing))


CHANGES: tuple[tuple[str, str, Callable[[Robot], Robot]], ...] = (
    ("nothing", "", lambda robot: robot),
    ("20 % of the mass on top", "payload", _heavier),
    ("wheels 2 % larger", "wheel_radius", _larger_wheels),
    ("wheels 2 % farther apart", "track_width", _wider),
    ("sensor mount turned by 1 degree", "mount_yaw", _turned),
    ("0.1 N m of friction at each wheel", "coulomb_friction", _rubbing),
)
"""What is changed, in words; the name of the effect; the robot with it."""


@dataclass(frozen=True, eq=False)
class Driven:
    """What the robot drives after the change."""

    words: str
    commands: Sequence[FloatArray]
    repeats: int


def main(
    seeds: tuple[int, ...] = SEEDS,
    driven: Literal["same", "other"] = "same",
    folder: Path = Path("out/sensitivity"),
    markdown: Path | None = None,
) -> None:
    """Fit drawn robots, change one thing at a time, study the logs and print the page.

    Example: python benchmarks/robot_sensitivity.py --seeds 38 --driven other

    Args:
        seeds: Of the robots, development seeds of the zoo.
        driven: After a change: the same commands as for the fit, or other ones.
        folder: For logs and models; a model that is there already is not fitted again.
        markdown: Markdown file to write the page to.
    """
    print_page(page(seeds, driven, folder), markdown)


def page(seeds: Sequence[int], which: Literal["same", "other"], folder: Path) -> Iterator[str]:
    """Yield the paragraphs of the page; after a change the robots drive `which` commands."""
    option = "" if tuple(seeds) == SEEDS else f" --seeds {' '.join(map(str, seeds))}"
    option += "" if which == "same" else " --driven other"
    yield f"# Results of `python benchmarks/robot_sensitivity.py{option}`"
    yield (
        f"Written by the command itself with commit `{(commit() or 'unknown')[:12]}`; do not edit. A model "
        "of each robot is fitted to its nominal logs. Then one thing at a time is changed, or nothing, in "
        f"{QUIET_SEEDS} sets of logs with other luck; each row is a study beside the logs of the fit. The "
        "signal is the rms of what the change does to the logs over the scatter of repeats, in the channel "
        "that shows most. The smallest detectable value is what the study itself says that it could have "
        "seen. The words are those of [GapBench](gapbench.md)."
    )
    count = found = 0
    for seed in seeds:
        robot, own = draw_robot(seed), folder / str(seed)
        if not (own / "model.json").is_file():
            own.mkdir(parents=True, exist_ok=True)
            write_robot_nominal(seed, robot, own)
            nominal_model(own)
        model, nominal = read_model(own / "model.json"), read_dataset(own / "nominal")
        driven = _plan(seed, robot, which)
        yield f"## Robot {seed} of the zoo"
        yield (
            f"{robot.body.mass_kg:.3g} kg, wheels of {robot.wheels.radius_m * 100:.1f} cm, drives of the "
            f"kind {robot.drive.family}. Its model is fitted to {len(nominal.runs)} runs of {RUN_S:g} s. "
            f"After the change it drives {driven.words}."
        )
        rows = list(_rows(seed, own / which, robot, driven, model, nominal))
        yield markdown_table(
            ("changed", "signal", "found", "now", "that is", "smallest detectable", "study"), rows
        )
        count += len(rows)
        found += sum(row[4] in ("right", "rightly ambiguous", "quiet") for row in rows)
    yield f"Right or rightly ambiguous: {found} of {count}."


def _plan(seed: int, robot: Robot, which: Literal["same", "other"]) -> Driven:
    """Return what is driven after a change of a robot."""
    if which == "same":
        own = fit_commands(seed, robot)
        return Driven(f"the commands of the fit, {len(own)} sequences, {REPEATS} runs each", own, REPEATS)
    other = sequences(robot, PLAN, RUNS, np.random.default_rng([seed, STREAM]))
    return Driven(f"other commands, {RUNS} runs with starts and reversals", other, 1)


def _rows(
    seed: int, folder: Path, robot: Robot, driven: Driven, model: Model, nominal: Dataset
) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each study."""
    measure = yardstick(robot, driven.commands, seed)
    nothing, *changes = CHANGES
    quiet = [(*nothing, luck) for luck in range(QUIET_SEEDS)]
    for words, name, change, luck in [*quiet, *((*one, 0) for one in changes)]:
        logs, changed = folder / (name or f"quiet_{luck}"), change(robot)
        if not logs.is_dir():
            write_robot_logs(logs, changed, driven.commands, seed + _LUCK * luck, driven.repeats)
        began = process_time()
        report = analyse(
            read_dataset(logs), model, GapOptions(fitted_on=nominal, jobs=1, next_experiment=False)
        )
        claims = tuple(map(frozenset, report.candidates))
        hidden = frozenset([name]) if name else frozenset[str]()
        word = word_of("single" if name else "quiet", hidden, report.verdict, claims)
        found = " or ".join(set_name(names) for names in report.candidates) or report.verdict
        now = "; ".join(f"{set_name([e.name])} {sizes_in(report.model, e.name)}" for e in report.effects)
        signal = f"{measure.signal(changed):.2g}" if name else "-"
        seconds = f"{process_time() - began:.0f} s"
        row = (words, signal, found, now or "-", word, _detectable(report, name), seconds)
        print(*row, sep=" | ", file=sys.stderr, flush=True)
        yield row


def _detectable(report: GapReport, name: str) -> str:
    """Return the smallest sizes of an effect that a study says it could have seen."""
    sizes = report.smallest_detectable.get(name, {})
    return ", ".join(f"{key} {value:.3g}" for key, value in sizes.items()) or "-"


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/robot_sensitivity.py"))
