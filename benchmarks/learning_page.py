"""The page of `benchmarks/learning.py`: success by how much of the past is seen, and what differs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import ndtri, stdtrit

from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import wilson_interval
from mecanum_env.units import FloatArray

BASE: Final = "16 observations"
"""What the others are measured by; it is what `training.train.planned` fits."""
_TAIL: Final = 0.975
"""Probability below the upper end of an interval."""


@dataclass(frozen=True, eq=False)
class Success:
    """The success of a way on some episodes, or the difference of two, once for each seed."""

    values: FloatArray
    variance: float
    """That the mean has by the choice of the episodes, which are the same for all seeds."""

    def interval(self) -> tuple[float, float, float]:
        """Return the mean and the ends of its 95 % interval, which are NaN for a single seed.

        Half its length is the root of two squares: Student's over the seeds, and that of the episodes.
        """
        count, value = len(self.values), float(self.values.mean())
        if count < 2:
            return value, math.nan, math.nan
        by_seed = stdtrit(count - 1, _TAIL) * self.values.std(ddof=1) / math.sqrt(count)
        half = float(np.hypot(by_seed, ndtri(_TAIL) * math.sqrt(self.variance)))
        return value, value - half, value + half

    def minus(self, other: Success) -> Success:
        """Return the difference; its interval is as wide as if both had played other episodes."""
        return Success(self.values - other.values, self.variance + other.variance)

    @property
    def sign(self) -> int:
        """1 or -1 if the whole interval of a difference is above or below 0, else 0."""
        _, low, high = self.interval()
        return int(low > 0.0) - int(high < 0.0)

    def text(self, sign: str = "") -> str:
        """Return mean and interval in words."""
        value, low, high = (round(number, 2) + 0.0 for number in self.interval())
        return f"{value:{sign}.2f} ({low:{sign}.2f} .. {high:{sign}.2f})"


def success_of(shares: Sequence[float], episodes: int) -> Success:
    """Return the success of which every seed has a share, in so many episodes."""
    mean = float(np.mean(shares))
    return Success(np.array(shares), mean * (1.0 - mean) / episodes)


def over_rows(rows: Mapping[str, Success]) -> Success:
    """Return the mean of the rows, whose episodes are others for each row."""
    values = np.mean([one.values for one in rows.values()], axis=0)
    return Success(values, sum(one.variance for one in rows.values()) / len(rows) ** 2)


def page(found: Mapping[str, Any], ways: Sequence[str], about: str) -> Iterator[str]:
    """Yield the paragraphs of the page.

    Args:
        found: what `learning.measure` found.
        ways: names of what is compared, `BASE` among them.
        about: how the networks were fitted.
    """
    episodes, runs, planner = found["plan"]["episodes"], found["runs"], found["planner"]
    seeds = sorted(set.intersection(*(set(runs[way]) for way in ways)), key=int)
    success = {
        way: {row: success_of([runs[way][seed]["rows"][row] for seed in seeds], episodes) for row in planner}
        for way in ways
    }
    yield "# How much of the past a policy needs"
    yield (
        "Written by `python benchmarks/learning.py --markdown docs/results/learning.md`; do not edit. Commit "
        f"{found['commit'][:12]}, {len(seeds)} seeds. [What follows](../training.md#how-much-of-the-past)."
    )
    yield about
    yield "## Success"
    yield (
        "Mean over the seeds, which draw robots, episodes with advice and weights, with a 95 % interval: "
        "Student's over the seeds and that of the episodes, added in squares. `told` is the teacher, the "
        "planner that knows the row's true robot and opponent, with Wilson's."
    )
    lines = [
        [row, *(success[way][row].text() for way in ways), _share(told, episodes)]
        for row, told in planner.items()
    ]
    together = {way: over_rows(success[way]) for way in ways}
    lines.append(["mean of the rows", *(one.text() for one in together.values()), _mean(planner)])
    minutes = [np.mean([runs[way][seed]["fit_minutes"] for seed in seeds]) for way in ways]
    lines.append(["fit, processor minutes", *(f"{one:.1f}" for one in minutes), ""])
    yield markdown_table(("row", *ways, "`told`"), lines)
    yield "## What it shows"
    yield (
        f"Success beyond that of the network of {BASE}, seed by seed on the same advice, with an interval as "
        "wide as if both had played other episodes. A difference is one whose interval does not contain 0."
    )
    others = [way for way in ways if way != BASE]
    beyond = {way: {row: success[way][row].minus(success[BASE][row]) for row in planner} for way in others}
    overall = {way: together[way].minus(together[BASE]) for way in others}
    lines = [[row, *(beyond[way][row].text("+") for way in others)] for row in planner]
    lines.append(["mean of the rows", *(one.text("+") for one in overall.values())])
    yield markdown_table(("row", *others), lines)
    yield "\n".join(f"- {_sentence(way, overall[way], beyond[way])}" for way in others)


def _sentence(way: str, overall: Success, beyond: Mapping[str, Success]) -> str:
    """Return what the differences of a way from `BASE` say: of all rows together, and of single ones."""
    named = {
        word: ", ".join(row for row, one in beyond.items() if one.sign == sign)
        for word, sign in (("better", 1), ("worse", -1))
    }
    sides = " and ".join(f"{word} on {rows}" for word, rows in named.items() if rows)
    told = {1: "more", -1: "less", 0: "as far as can be told neither more nor less"}[overall.sign]
    return f"{way}: wins {told} than {BASE}; {sides or 'no single row differs'}."


def _share(share: float, episodes: int) -> str:
    low, high = wilson_interval(round(share * episodes), episodes)
    return f"{share:.2f} ({low:.2f} .. {high:.2f})"


def _mean(shares: Mapping[str, float]) -> str:
    return f"{np.mean(list(shares.values())):.2f}"
