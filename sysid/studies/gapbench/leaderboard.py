"""The leaderboard: all methods' scores on one benchmark, as text and as a page of the documentation."""

from __future__ import annotations

import datetime
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mecanum_env.checkout import commit
from mecanum_env.errors import InputError
from mecanum_env.markdown import markdown_table
from mecanum_env.outputs import require_whole
from sysid.studies.gapbench.adapters.registry import ADAPTERS
from sysid.studies.gapbench.bench import MANIFEST
from sysid.studies.score import WORDS, AnswerError, Metric, Scored, metrics, score_folder

_OURS: Final = "ours"


@dataclass(frozen=True)
class Board:
    """The scores of one method."""

    name: str
    words: str
    """What the method does."""
    scored: tuple[Scored, ...]
    commits: tuple[str, ...] = ()
    """Of the code that gave the answers, as far as they say so."""

    @property
    def metrics(self) -> dict[str, Metric]:
        """Name -> headline metric."""
        return {metric.name: metric for metric in metrics(self.scored)}


def read_boards(bench: Path, answers: Path) -> tuple[Board, ...]:
    """Return the scores of every method that has answered, most right answers first.

    Args:
        bench: the benchmark's folder.
        answers: has one folder per method.

    Raises:
        InputError: no answers, some that do not follow their format, or a file of another run.
    """
    boards = []
    for path in sorted(answers.glob("*/answers.json")):
        require_whole(path)
        try:
            scored = tuple(score_folder(path.parent, bench))
        except AnswerError as error:
            raise InputError(str(error)) from error
        said = json.loads(path.read_text(encoding="utf-8"))
        commits = {entry["commit"][:12] for entry in said["cases"].values() if "commit" in entry}
        boards.append(Board(path.parent.name, said["method"], scored, tuple(sorted(commits))))
    if not boards:
        raise InputError(f"{answers}: no METHOD/answers.json in it; let methods answer with the command run")
    return tuple(sorted(boards, key=lambda b: (-b.metrics["right answers"].value, b.name)))


def leaderboard_table(boards: Sequence[Board]) -> str:
    """Return the headline metrics of all methods as a table in Markdown, with 95 % Wilson intervals."""
    counted = [name for name in boards[0].metrics if any(board.metrics[name].count for board in boards)]
    rows = [(board.name, *(board.metrics[name].text() for name in counted)) for board in boards]
    return markdown_table(("method", *counted), rows)


def leaderboard_page(boards: Sequence[Board], bench: Path) -> str:
    """Return the leaderboard's page, for the benchmark in the folder `bench`."""
    made = json.loads((bench / MANIFEST).read_text(encoding="utf-8"))
    kinds = Counter(one.kind for one in boards[0].scored)
    parts = [
        "# Leaderboard of GapBench",
        _provenance(made, boards),
        "Name the effect that a simulator lacks, from logs before and after a change. "
        "[GapBench](../gapbench.md) says how, what the words mean and how to add a method.",
        "Cases: " + ", ".join(f"{count} {kind}" for kind, count in kinds.most_common()) + ".",
        leaderboard_table(boards),
        "In brackets 95 % Wilson intervals. Right answers: right, rightly ambiguous or quiet. Wrong answers: "
        "wrong, overclaimed, false alarm or false name. Closure: median over clear and gross cases; seconds: "
        "median per case, without the fit of the simulator, which all methods are given.",
        *([lead] if (lead := _lead(boards)) else []),
        "## Words",
        _word_table(boards),
        "## Methods",
        "\n".join(f"- **{board.name}**: {board.words}{_answered(board)}" for board in boards),
    ]
    if absent := [name for name in ADAPTERS if name not in {board.name for board in boards}]:
        parts.append(f"Not run: {', '.join(absent)}.")
    return "\n\n".join(parts) + "\n"


def _provenance(made: dict[str, Any], boards: Sequence[Board]) -> str:
    kind = "Sealed seeds, which no method has seen" if made["sealed"] else "Seeds for development"
    now = commit() or "unknown"
    today = datetime.date.today().isoformat()
    return (
        f"Written by `python -m sysid.studies.gapbench leaderboard` on {today} with commit `{now[:12]}"
        f"{'+' if now.endswith('+') else ''}`; do not edit. {len(boards[0].scored)} cases, made with version "
        f"{made['version']}, commit `{made['commit'][:12]}`. {kind}: {made['seeds']}."
    )


def _lead(boards: Sequence[Board]) -> str:
    """Return in words how far this project's method is ahead of the best other one, if both are there."""
    ours = next((board for board in boards if board.name == _OURS), None)
    others = [board for board in boards if board.name != _OURS]
    if ours is None or not others:
        return ""
    best = max(others, key=lambda board: board.metrics["right answers"].value)
    points, wrong = (
        100.0 * (ours.metrics[name].value - best.metrics[name].value)
        for name in ("right answers", "wrong answers")
    )
    return (
        f"Against the best other method, {best.name}, {_OURS} has {points:+.0f} points of right answers and "
        f"{wrong:+.0f} points of wrong ones; wanted were +30 or more, and fewer wrong ones."
    )


def _answered(board: Board) -> str:
    return f" Answered with commit `{'`, `'.join(board.commits)}`." if board.commits else ""


def _word_table(boards: Sequence[Board]) -> str:
    used = [word for word in WORDS if any(one.word == word for board in boards for one in board.scored)]
    rows = []
    for board in boards:
        counts = Counter(one.word for one in board.scored)
        rows.append((board.name, *(str(counts[word] or "") for word in used)))
    return markdown_table(("method", *used), rows)
