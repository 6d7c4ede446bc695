"""A run of the zoo: cases of some seeds drawn, their logs studied, and what came of it written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.files import write_json, write_text
from mecanum_env.parallel import Workers
from sysid.logs.runs import Level
from sysid.studies.zoo.cases.case import Driven
from sysid.studies.zoo.drives.families import FAMILIES
from sysid.studies.zoo.outcome import Outcome
from sysid.studies.zoo.page import Provenance, page_markdown, run_json, summary_text
from sysid.studies.zoo.power import write_power_plot
from sysid.studies.zoo.settle import settle_cases
from sysid.studies.zoo.settled import Settled, settled_json
from sysid.studies.zoo.settled_table import settle_table
from sysid.studies.zoo.work import Task, run_tasks

JSON: Final = "zoo.json"
TEXT: Final = "zoo.txt"


@dataclass(frozen=True)
class ZooRun:
    """What came of a run."""

    outcomes: tuple[Outcome, ...]
    undrawn: tuple[str, ...]
    """As in `sysid.studies.zoo.work.Results`."""
    settled: tuple[Settled, ...] | None = None
    """What the next experiments of ambiguous cases decided; None if they were not driven."""

    def write(self, folder: Path, about: Provenance) -> None:
        """Write zoo.json and zoo.txt of a run that is `about` something into a folder."""
        record = run_json(self.outcomes, self.undrawn, about)
        write_json(folder / JSON, {**record, "settled": [settled_json(one) for one in self.settled or ()]})
        summary = filter(None, (summary_text(self.outcomes, self.undrawn), self._settled_text()))
        write_text(folder / TEXT, "\n\n".join(summary) + "\n")

    def write_page(self, page: Path, picture: Path, about: Provenance) -> None:
        """Write the tables of a run that is `about` something as a page, and its power as a picture."""
        write_power_plot(self.outcomes, picture)
        settled = self._settled_text()
        write_text(page, page_markdown(self.outcomes, self.undrawn, about, FAMILIES, picture.name, settled))

    def _settled_text(self) -> str:
        return "" if self.settled is None else settle_table(self.settled)


def run_zoo(
    seeds: Mapping[Level, Sequence[int]],
    out: Path,
    workers: Workers = Workers(),
    *,
    driven: Driven = "other",
    only: str = "*",
    settle: bool = False,
) -> ZooRun:
    """Draw the cases of some seeds, fit a model to the nominal logs of each and study its logs.

    Args:
        seeds: of each level, bench and robot.
        out: folder in which finished cases are kept; those of the same code are not run again.
        workers: where the cases run; the result does not depend on it.
        driven: what the logs in which something is hidden drive.
        only: pattern of the cases' names.
        settle: whether the next experiments of ambiguous cases are driven, too.

    Raises:
        InputError: no case of these seeds has such a name, or none could be drawn.
    """
    tasks = [Task(level, seed, driven) for level, numbers in seeds.items() for seed in numbers]
    results = run_tasks(tasks, out, workers, only)
    outcomes, undrawn = results.outcomes, results.undrawn
    if not outcomes:
        raise InputError(
            f"only = {only}: no case of these seeds has such a name; try bench-*-single-*"
            if not undrawn
            else f"no case could be drawn; the first error: {undrawn[0]}"
        )
    return ZooRun(outcomes, undrawn, settle_cases(outcomes, out, workers) if settle else None)
