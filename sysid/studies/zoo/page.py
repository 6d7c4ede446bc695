"""The results of a run as a page of the documentation, as text and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.checkout import commit
from mecanum_env.files import plain_json
from mecanum_env.markdown import markdown_table
from sysid.studies.score import SIZES, WORDS
from sysid.studies.zoo.calibration import calibrate, left_out_table
from sysid.studies.zoo.drives.drive import Family
from sysid.studies.zoo.goals import GOAL_HEAD, goals
from sysid.studies.zoo.outcome import Outcome, to_json
from sysid.studies.zoo.power import power_table
from sysid.studies.zoo.seeds import Block, spans
from sysid.studies.zoo.sources import fingerprint
from sysid.studies.zoo.tables import Table, coverage_table, false_alarm_table, word_tables

FORMAT: Final = "mecanum-zoo/1"


@dataclass(frozen=True)
class Provenance:
    """What a page is of."""

    command: str
    version: str
    commit: str
    """With "+" if files differed from it; "unknown" outside of a checkout."""
    fingerprint: str
    """Of the source files (`sysid.studies.zoo.sources`)."""
    date: str
    """Such as 2027-01-31."""
    seeds: Mapping[str, str]
    """Level -> seeds in words."""
    sealed: bool
    """Whether these seeds were spent on this run."""

    def text(self) -> str:
        """Return all of it as a sentence."""
        seeds = "; ".join(f"{level} {which}" for level, which in self.seeds.items())
        kind = "Sealed seeds, which no calibration has seen" if self.sealed else "Seeds for development"
        return (
            f"Written by `{self.command}` on {self.date} with version {self.version}, commit "
            f"`{self.commit[:12]}{'+' if self.commit.endswith('+') else ''}` (code {self.fingerprint}); do "
            f"not edit. {kind}: {seeds}."
        )


def provenance_of(
    outcomes: Sequence[Outcome], command: str, date: str, block: Block | None = None
) -> Provenance:
    """Return what a page of outcomes is of, on a run by a command on a date; a sealed run has a `block`."""
    return Provenance(
        command=command,
        version=mecanum_env.__version__,
        commit=(commit() or "unknown") if block is None else block.commit,
        fingerprint=fingerprint(),
        date=date,
        seeds=seeds_of(outcomes),
        sealed=block is not None,
    )


def seeds_of(outcomes: Sequence[Outcome]) -> dict[str, str]:
    """Return the seeds of the outcomes of each level, in words."""
    return {
        level: spans(seeds)
        for level in ("bench", "robot")
        if (seeds := [o.case.seed for o in outcomes if o.case.level == level])
    }


def tables(outcomes: Sequence[Outcome], sealed: bool) -> tuple[Table, ...]:
    """Return all tables of a run that have a row, in the order of the page.

    Only on seeds that are not `sealed` thresholds are calibrated.
    """
    found = (
        power_table(outcomes),
        *word_tables(outcomes),
        false_alarm_table(outcomes),
        *(() if sealed else (left_out_table(calibrate(outcomes)),)),
        coverage_table(outcomes),
    )
    return tuple(table for table in found if table.rows)


def page_markdown(
    outcomes: Sequence[Outcome],
    undrawn: Sequence[str],
    provenance: Provenance,
    families: Mapping[Family, str],
    picture: str,
    settled: str = "",
) -> str:
    """Return the page of a run.

    Args:
        outcomes: of the run.
        undrawn: name of a case and the error, where none could be drawn.
        provenance: what the page is of.
        families: family -> what it is and which products have it.
        picture: file name of the power curves, beside the page.
        settled: what became of ambiguous cases, as Markdown; empty if that was not tried.
    """
    sizes = ", ".join(f"{size} below {end:g}" for size, (_, end) in list(SIZES.items())[:-1])
    parts = [
        "# Results of the zoo",
        provenance.text(),
        "Drives and robots are drawn at random, each with its own nominal logs. A model is fitted to "
        "them as a user would; then something is changed, or nothing, and "
        f"{driven_text(outcomes)}. The study sees both sets of logs and the model.",
        "## In short",
        markdown_table(GOAL_HEAD, [goal.row() for goal in goals(outcomes)]),
        "In brackets 95 % Wilson intervals. A target is reached if the whole interval is on its right side, "
        "missed if it is on the wrong one, and open between. Found: right or rightly ambiguous. Closure: "
        "(before - after)/(before - noise floor) on test runs, 0 where nothing was named. Beside the logs of "
        "the fit: the same without what the model errs by in these, where they hold the same commands.",
        f"The size of a change is the rms of what it does to the logs, over the noise: {sizes}, gross above. "
        "Several effects are as large as the smallest of them is alone.",
        time_text(outcomes),
        "## Words",
        "\n".join(f"- **{word}**: {meaning}." for word, meaning in WORDS.items()),
        "## Power curves",
        f"![Share of cases found over the size of the change]({picture})",
        *(f"## {table.title}\n\n{_markdown(table)}" for table in tables(outcomes, provenance.sealed)),
        *(["## Ambiguous cases, after the next experiments", settled] if settled else []),
        "## Families of drives",
        markdown_table(("family", "what it is"), list(families.items())),
    ]
    errors = _error_rows(outcomes, undrawn)
    if errors:
        parts += ["## Errors", markdown_table(("case", "message"), errors)]
    return "\n\n".join(parts) + "\n"


def summary_text(outcomes: Sequence[Outcome], undrawn: Sequence[str]) -> str:
    """Return one line per case, the metrics and the errors of a run, as text.

    `undrawn` has the name of a case and the error, where none could be drawn.
    """
    cases = [
        (o.case.name, o.case.family, o.case.layout, f"{o.case.signal:.2f}", o.word, _claimed(o))
        for o in outcomes
    ]
    return f"{_aligned(cases)}\n\n{short_text(outcomes, undrawn)}"


def short_text(outcomes: Sequence[Outcome], undrawn: Sequence[str]) -> str:
    """Return the metrics of a run, the time that it took and its errors as text.

    `undrawn` has the name of a case and the error, where none could be drawn.
    """
    rows = [GOAL_HEAD, *(goal.row() for goal in goals(outcomes))]
    errors = [f"{name}: {message}" for name, message in _error_rows(outcomes, undrawn)]
    return "\n\n".join([_aligned(rows), time_text(outcomes), *(["\n".join(errors)] if errors else [])])


def run_json(outcomes: Sequence[Outcome], undrawn: Sequence[str], provenance: Provenance) -> dict[str, Any]:
    """Return a run as JSON objects: metrics, tables, and each case with its word.

    `undrawn` has the name of a case and the error, where none could be drawn; `provenance` is what made them.
    """
    return {
        "format": FORMAT,
        **asdict(provenance),
        "metrics": plain_json(goals(outcomes)),
        "tables": plain_json(tables(outcomes, provenance.sealed)),
        "undrawn": list(undrawn),
        "cases": [{"name": o.case.name, "word": o.word, **to_json(o)} for o in outcomes],
    }


def driven_text(outcomes: Sequence[Outcome]) -> str:
    """Return in words what the logs with something hidden drive."""
    if all(outcome.case.driven == "same" for outcome in outcomes):
        return "the commands of the fit are driven again"
    return "commands that the fit has not seen are driven"


def time_text(outcomes: Sequence[Outcome]) -> str:
    """Return in words how long fit and study of a case took."""
    parts = []
    for level in ("bench", "robot"):
        known = [o for o in outcomes if o.case.level == level]
        if known:
            fit_s, study_s = np.array([(o.fit_s, o.study_s) for o in known]).T
            parts.append(
                f"{len(known)} {level} cases: fit {np.median(fit_s):.1f} s, study {np.median(study_s):.1f} s "
                f"in the median, {max(study_s):.0f} s at most"
            )
    return "; ".join(parts) + "."


def _markdown(table: Table) -> str:
    grid = markdown_table(table.head, table.rows)
    return f"{table.note}\n\n{grid}" if table.note else grid


def _claimed(outcome: Outcome) -> str:
    sets = sorted(" + ".join(sorted(claim)) for claim in outcome.claims)
    return " | ".join(sets) if sets else outcome.verdict


def _error_rows(outcomes: Sequence[Outcome], undrawn: Sequence[str]) -> list[tuple[str, str]]:
    failed = [(outcome.case.name, outcome.message) for outcome in outcomes if outcome.message]
    return [*failed, *((name, text) for name, _, text in (line.partition(": ") for line in undrawn))]


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
