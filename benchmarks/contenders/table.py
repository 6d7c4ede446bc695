"""Figures of repeated measurements, and tables of them as Markdown and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from mecanum_env.markdown import markdown_table

Cell = str | float | int | None


@dataclass(frozen=True)
class Spread:
    """Least, middle and largest of repeated measurements."""

    low: float
    median: float
    high: float

    def __str__(self) -> str:
        return f"{number(self.median)} ({number(self.low)} .. {number(self.high)})"


def spread(values: Sequence[float]) -> Spread:
    """Return the spread of some values."""
    return Spread(min(values), median(values), max(values))


def over(ones: Sequence[float], others: Sequence[float]) -> Spread:
    """Return the spread of the ratios of two measurements that were made in the same rounds."""
    return spread([one / other for one, other in zip(ones, others, strict=True)])


def number(value: float) -> str:
    """Return a number with three digits, thousands separated."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


@dataclass(frozen=True)
class Table:
    """A table with what stands above and below it."""

    title: str
    about: str
    """What was measured, how, and what the columns are; Markdown."""
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    """Cells; the first is the contender's name."""
    figures: Mapping[str, Any]
    """The same in full precision, for JSON: contender -> figure -> value, or list of one per round."""
    remarks: tuple[str, ...] = ()
    """Sentences that the figures decide: where this project loses, and who is not there."""

    def markdown(self) -> str:
        """Return title, text, table and remarks as Markdown."""
        parts = [f"## {self.title}", self.about, markdown_table(self.head, self.rows)]
        parts += ["\n".join(f"- {remark}" for remark in self.remarks)] if self.remarks else []
        return "\n\n".join(parts)

    def json(self) -> dict[str, Any]:
        """Return the table as a JSON object."""
        return {key: value for key, value in asdict(self).items() if key != "about"}
